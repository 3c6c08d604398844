/* Kernels for vectors of 16 floats: AVX-512, and its instructions for bfloat16 where planes hold that. */
#include "nn/direct_kernels.h"

#if defined(__x86_64__) && defined(__GNUC__) && defined(__has_include)
#if __has_include(<avx512bf16intrin.h>)
#define HAS_KERNELS 1
#endif
#endif

#ifdef HAS_KERNELS
#include <immintrin.h>

enum { LANES = 16, ACCUMULATORS = 24 /* sums that stay in registers */, FINE_PIXELS = 4 /* at a time */ };

#define WITH_BF16 1
#define WIDE __attribute__((target("avx512f,avx512bw,avx512vl,avx512bf16")))
#define PART static inline __attribute__((always_inline)) WIDE

typedef __m512 vector;
typedef float __attribute__((may_alias)) word; /* one float or two bfloat16 */

#define v_zero _mm512_setzero_ps
#define v_same _mm512_set1_ps
#define v_load _mm512_loadu_ps
#define v_store _mm512_storeu_ps
#define v_add _mm512_add_ps
#define v_sub _mm512_sub_ps
#define v_mul _mm512_mul_ps
#define v_max _mm512_max_ps
#define v_multiply_add _mm512_fmadd_ps

/* The first n numbers, then zeros; all where n is that many. */
PART vector v_load_first(int n, const float *from)
{
    return _mm512_maskz_loadu_ps((__mmask16)(n < LANES ? (1 << n) - 1 : 0xffff), from);
}

PART void v_store_first(int n, float *to, vector value)
{
    _mm512_mask_storeu_ps(to, (__mmask16)(n < LANES ? (1 << n) - 1 : 0xffff), value);
}

PART vector load_reals(rx_real real, const void *plane, size_t at)
{
    if (real == RX_REAL_F32)
        return v_load((const float *)plane + at);
    const __m256i half = _mm256_loadu_si256((const __m256i *)(const void *)((const uint16_t *)plane + at));
    return _mm512_castsi512_ps(_mm512_slli_epi32(_mm512_cvtepu16_epi32(half), 16));
}

PART void store_reals(rx_real real, vector value, void *plane, size_t at)
{
    if (real == RX_REAL_F32)
        v_store((float *)plane + at, value);
    else
        _mm256_storeu_si256((__m256i *)(void *)((uint16_t *)plane + at), (__m256i)_mm512_cvtneps_pbh(value));
}

PART vector multiply_add(int bf16, vector x, vector w, vector sum)
{
    if (bf16)
        return _mm512_dpbf16_ps(sum, (__m512bh)x, (__m512bh)w);
    return v_multiply_add(x, w, sum);
}

/* ---- fine ---- */

/* sum[4 p + o]: lanes to be added up. Lane 4 p + o of the result. Pairs of vectors are interleaved and added
 * until each lane holds one sum. */
PART __m512 gather_sums(const __m512 *sum)
{
    __m512 pair[8], four[4];
#pragma GCC unroll 8
    for (int k = 0; k < 8; k++)
        pair[k] = _mm512_add_ps(_mm512_unpacklo_ps(sum[2 * k], sum[2 * k + 1]),
                                _mm512_unpackhi_ps(sum[2 * k], sum[2 * k + 1]));
        /* lanes of 128 bits: even, odd, even, odd sums */
#pragma GCC unroll 4
    for (int k = 0; k < 4; k++)
        four[k] = _mm512_add_ps(_mm512_shuffle_ps(pair[2 * k], pair[2 * k + 1], 0x44),
                                _mm512_shuffle_ps(pair[2 * k], pair[2 * k + 1], 0xee));
    const __m512 a = _mm512_add_ps(_mm512_shuffle_f32x4(four[0], four[1], 0x88),
                                   _mm512_shuffle_f32x4(four[0], four[1], 0xdd));
    const __m512 b = _mm512_add_ps(_mm512_shuffle_f32x4(four[2], four[3], 0x88),
                                   _mm512_shuffle_f32x4(four[2], four[3], 0xdd));
    return _mm512_add_ps(_mm512_shuffle_f32x4(a, b, 0x88), _mm512_shuffle_f32x4(a, b, 0xdd));
}

/* n <= 4 pixels side by side, from x on; `out`: where their finer pixels begin, in a row and in the next. */
PART void fine_pixels(const rx_direct *d, const word *x, size_t row, int n, float *const out[2], int bf16)
{
    const int span = d->shape.kernel * d->words, vectors = (span + LANES - 1) / LANES;
    const __mmask16 rest = (__mmask16)(0xffff >> (LANES * vectors - span));
    const __m512i order = _mm512_setr_epi32(0, 1, 4, 5, 8, 9, 12, 13, 2, 3, 6, 7, 10, 11, 14, 15);
    const float *w = d->weights;
    __m512 sum[4 * FINE];
#pragma GCC unroll 16
    for (int k = 0; k < 4 * FINE; k++)
        sum[k] = _mm512_setzero_ps();
    for (int v = 0; v < d->shape.kernel; v++, x += row)
        for (int i = 0; i < vectors; i++, w += FINE * LANES) {
            const __mmask16 mask = i + 1 == vectors ? rest : 0xffff;
#pragma GCC unroll 4
            for (int p = 0; p < 4; p++) {
                const word *from = x + (p < n ? p : 0) * d->words + i * LANES;
                const __m512 some = _mm512_maskz_loadu_ps(mask, from);
#pragma GCC unroll 4
                for (int o = 0; o < FINE; o++)
                    sum[FINE * p + o] =
                        multiply_add(bf16, some, _mm512_loadu_ps(w + o * LANES), sum[FINE * p + o]);
            }
        }
    __m512 value = _mm512_add_ps(gather_sums(sum), _mm512_broadcast_f32x4(_mm_loadu_ps(d->bias)));
    if (d->shape.relu)
        value = _mm512_max_ps(value, _mm512_setzero_ps());
    value = _mm512_permutexvar_ps(order, value);
    const __m256 upper = _mm512_castps512_ps256(value);
    const __m256 lower = _mm256_castpd_ps(_mm512_extractf64x4_pd(_mm512_castps_pd(value), 1));
    const __mmask8 here = (__mmask8)((1 << 2 * n) - 1);
    _mm256_mask_storeu_ps(out[0], here, upper);
    _mm256_mask_storeu_ps(out[1], here, lower);
}

#include "nn/direct_rows.h"
#include "nn/direct_winograd.h"

const rx_direct_kernels *rx_direct_avx512(void)
{
    static const rx_direct_kernels kernels = KERNELS("AVX-512", 0),
                                   with_bf16 = KERNELS("AVX-512 with bfloat16", 1);
    if (!__builtin_cpu_supports("avx512f") || !__builtin_cpu_supports("avx512bw") ||
        !__builtin_cpu_supports("avx512vl") || !__builtin_cpu_supports("avx512dq"))
        return NULL;
    return __builtin_cpu_supports("avx512bf16") ? &with_bf16 : &kernels;
}

#else

const rx_direct_kernels *rx_direct_avx512(void)
{
    return NULL;
}

#endif
