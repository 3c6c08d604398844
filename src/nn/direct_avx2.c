/* Kernels for vectors of 8 floats: AVX2 with its fused multiply-add. */
#include "nn/direct_kernels.h"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>

enum { LANES = 8, ACCUMULATORS = 12 /* sums that stay in registers */, FINE_PIXELS = 2 /* at a time */ };

#define WITH_BF16 0
#define WIDE __attribute__((target("avx2,fma")))
#define PART static inline __attribute__((always_inline)) WIDE

typedef __m256 vector;
typedef float word;

#define v_zero _mm256_setzero_ps
#define v_same _mm256_set1_ps
#define v_load _mm256_loadu_ps
#define v_store _mm256_storeu_ps
#define v_add _mm256_add_ps
#define v_sub _mm256_sub_ps
#define v_mul _mm256_mul_ps
#define v_max _mm256_max_ps
#define v_multiply_add _mm256_fmadd_ps

/* The first n numbers, then zeros; all where n is that many. */
PART __m256i mask_of(int n)
{
    static const int32_t masks[2 * LANES] = {-1, -1, -1, -1, -1, -1, -1, -1};
    return _mm256_loadu_si256((const __m256i *)(const void *)(masks + LANES - n));
}

PART vector v_load_first(int n, const float *from)
{
    return n >= LANES ? v_load(from) : _mm256_maskload_ps(from, mask_of(n));
}

PART void v_store_first(int n, float *to, vector value)
{
    if (n >= LANES)
        v_store(to, value);
    else
        _mm256_maskstore_ps(to, mask_of(n), value);
}

#include "nn/direct_floats.h"

/* ---- fine ---- */

/* The sums of the lanes of four vectors. */
PART __m128 sums_of(const vector *sum)
{
    const vector halves = _mm256_hadd_ps(_mm256_hadd_ps(sum[0], sum[1]), _mm256_hadd_ps(sum[2], sum[3]));
    return _mm_add_ps(_mm256_castps256_ps128(halves), _mm256_extractf128_ps(halves, 1));
}

/* n <= 2 pixels side by side, from x on; `out`: where their finer pixels begin, in a row and in the next. */
PART void fine_pixels(const rx_direct *d, const word *x, size_t row, int n, float *const out[2], int bf16)
{
    (void)bf16;
    const int vectors = d->shape.kernel * d->words / LANES, second = n > 1 ? d->words : 0;
    const float *w = d->weights;
    const __m128 bias = _mm_loadu_ps(d->bias);
    vector sum[2 * FINE];
    __m128 value[2];
#pragma GCC unroll 8
    for (int k = 0; k < 2 * FINE; k++)
        sum[k] = v_zero();
    for (int v = 0; v < d->shape.kernel; v++, x += row)
        for (int i = 0; i < vectors; i++, w += FINE * LANES) {
            const vector a = v_load(x + i * LANES), b = v_load(x + second + i * LANES);
#pragma GCC unroll 4
            for (int o = 0; o < FINE; o++) {
                const vector weight = v_load(w + o * LANES);
                sum[o] = v_multiply_add(a, weight, sum[o]);
                sum[FINE + o] = v_multiply_add(b, weight, sum[FINE + o]);
            }
        }
#pragma GCC unroll 2
    for (int p = 0; p < 2; p++) {
        value[p] = _mm_add_ps(sums_of(sum + FINE * p), bias);
        if (d->shape.relu)
            value[p] = _mm_max_ps(value[p], _mm_setzero_ps());
    }
    const __m128 upper = _mm_movelh_ps(value[0], value[1]), lower = _mm_movehl_ps(value[1], value[0]);
    if (n > 1) {
        _mm_storeu_ps(out[0], upper);
        _mm_storeu_ps(out[1], lower);
    } else {
        _mm_storel_pi((__m64 *)(void *)out[0], upper);
        _mm_storel_pi((__m64 *)(void *)out[1], lower);
    }
}

#include "nn/direct_rows.h"
#include "nn/direct_winograd.h"

const rx_direct_kernels *rx_direct_avx2(void)
{
    static const rx_direct_kernels kernels = KERNELS("AVX2", 0);
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? &kernels : NULL;
}

#else

const rx_direct_kernels *rx_direct_avx2(void)
{
    return NULL;
}

#endif
