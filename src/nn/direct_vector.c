/* Kernels for vectors of 4 floats, which every processor of today has (NEON, SSE2), by GCC's vector extensions.
 */
#include "nn/direct_kernels.h"

#ifdef __GNUC__
#include <string.h>
#ifdef __aarch64__
#include <arm_neon.h>
enum { ACCUMULATORS = 24 /* sums that stay in registers */ };
#else
enum { ACCUMULATORS = 12 };
#endif

enum { LANES = 4, FINE_PIXELS = 2 /* at a time */ };

#define WITH_BF16 0
#define WIDE
#define PART static inline __attribute__((always_inline))

typedef float vector __attribute__((vector_size(16)));
typedef int32_t lanes __attribute__((vector_size(16)));
typedef float word;

PART vector v_same(float value)
{
    return (vector){value, value, value, value};
}

PART vector v_zero(void)
{
    return v_same(0);
}

PART vector v_load(const float *from)
{
    vector v;
    memcpy(&v, from, sizeof v);
    return v;
}

PART void v_store(float *to, vector v)
{
    memcpy(to, &v, sizeof v);
}

#define v_add(a, b) ((a) + (b))
#define v_sub(a, b) ((a) - (b))
#define v_mul(a, b) ((a) * (b))

PART vector v_max(vector a, vector b)
{
    const lanes more = a > b;
    return (vector)((more & (lanes)a) | (~more & (lanes)b));
}

PART vector v_multiply_add(vector x, vector w, vector sum)
{
#ifdef __aarch64__
    return vfmaq_f32(sum, x, w); /* the compiler fuses nothing by itself: -ffp-contract=off */
#else
    return x * w + sum;
#endif
}

/* The first n numbers, then zeros; all where n is that many. */
PART vector v_load_first(int n, const float *from)
{
    vector v = {0};
    memcpy(&v, from, (n < LANES ? (size_t)n : LANES) * sizeof *from);
    return v;
}

PART void v_store_first(int n, float *to, vector value)
{
    memcpy(to, &value, (n < LANES ? (size_t)n : LANES) * sizeof *to);
}

#include "nn/direct_floats.h"

/* ---- fine ---- */

/* n <= 2 pixels side by side, from x on; `out`: where their finer pixels begin, in a row and in the next. */
PART void fine_pixels(const rx_direct *d, const word *x, size_t row, int n, float *const out[2], int bf16)
{
    (void)bf16;
    const int vectors = d->shape.kernel * d->words / LANES, second = n > 1 ? d->words : 0;
    const float *w = d->weights;
    vector sum[2 * FINE];
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
    for (int p = 0; p < n; p++)
        for (int o = 0; o < FINE; o++) {
            const vector s = sum[FINE * p + o];
            const float value = (s[0] + s[1]) + (s[2] + s[3]) + d->bias[o];
            out[o / 2][2 * p + o % 2] = d->shape.relu && !(value > 0) ? 0 : value;
        }
}

#include "nn/direct_rows.h"
#include "nn/direct_winograd.h"

const rx_direct_kernels *rx_direct_vector(void)
{
    static const rx_direct_kernels kernels = KERNELS("vectors of 4 floats", 0);
    return &kernels;
}

#else

const rx_direct_kernels *rx_direct_vector(void)
{
    return NULL;
}

#endif
