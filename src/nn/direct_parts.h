/* Inside of direct.h: its weights, and what its kernels share. Files with kernels include this one last. */
#ifndef RX_NN_DIRECT_PARTS_H
#define RX_NN_DIRECT_PARTS_H

#include <stdint.h>

#include "nn/direct.h"

enum {
    LANES = 16,        /* floats of a vector */
    ACCUMULATORS = 24, /* sums that stay in registers */
    FINE = 4,          /* outputs of a fine one */
    POINTS = 16,       /* of Winograd's algorithm */
    SUMS = 12,         /* as many in registers leave room in the fastest cache for a strip of it */
    MOST_IN = 64       /* channels that it takes */
};

struct rx_direct {
    rx_conv_shape shape;
    int fine, winograd;
    int words;     /* 32-bit words of a pixel of x */
    int step;      /* words from the first one of an output to that of the next */
    int blocks;    /* vectors of outputs that run together: 2 where these are even */
    float *bias;   /* [out] */
    void *weights; /* Winograd: [out / (16 blocks)][point][in][blocks][16] floats; wide: [out / (16
                      blocks)][k][k][words][blocks][16] words; fine: [k][vectors][4][16] words */
};

int rx_direct_has_kernels(void); /* the compiler makes them */
/* Whether there are kernels for these words from pixel to pixel. */
int rx_direct_has_rows(const rx_direct *direct);
void rx_direct_wide(const rx_direct *direct, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                    rx_direct_area area);
void rx_direct_fine(const rx_direct *direct, const rx_plane *x, const rx_plane *y, rx_direct_area area);

/* By Winograd's algorithm; the rows in pairs. */
void rx_direct_winograd(const rx_direct *direct, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                        rx_direct_area area, float *scratch);
void rx_direct_winograd_load(rx_direct *direct, const float *weights);

/* ---- vectors ---- */

#if defined(__x86_64__) && defined(__GNUC__) && defined(__has_include)
#if __has_include(<avx512bf16intrin.h>)
#define RX_DIRECT_KERNELS 1
#endif
#endif

#ifdef RX_DIRECT_KERNELS
#include <immintrin.h>

#define WIDE __attribute__((target("avx512f,avx512bw,avx512vl,avx512bf16")))
#define PART static inline __attribute__((always_inline)) WIDE

typedef float __attribute__((may_alias)) word; /* one float or two bfloat16 */
PART __m512 load_reals(rx_real real, const void *plane, size_t at)
{
    if (real == RX_REAL_F32)
        return _mm512_loadu_ps((const float *)plane + at);
    const __m256i half = _mm256_loadu_si256((const __m256i *)(const void *)((const uint16_t *)plane + at));
    return _mm512_castsi512_ps(_mm512_slli_epi32(_mm512_cvtepu16_epi32(half), 16));
}

PART void store_reals(rx_real real, __m512 value, void *plane, size_t at)
{
    if (real == RX_REAL_F32)
        _mm512_storeu_ps((float *)plane + at, value);
    else
        _mm256_storeu_si256((__m256i *)(void *)((uint16_t *)plane + at), (__m256i)_mm512_cvtneps_pbh(value));
}

/* Adds, cuts and stores 16 outputs of the plane y, which begin `at` numbers after its first; add NULL: none.
 */
PART void finish(const rx_direct *d, const rx_plane *add, void *y, size_t at, __m512 value)
{
    if (add != NULL)
        value = _mm512_add_ps(value, load_reals(add->real, add->data, at));
    if (d->shape.relu)
        value = _mm512_max_ps(value, _mm512_setzero_ps());
    store_reals(d->shape.y, value, y, at);
}

#endif
#endif
