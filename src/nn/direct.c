/* Convolutions of a band of rows: which there are, and their weights. */
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/direct_parts.h"

/* The widest vectors that this processor has for planes of those reals; NULL: none. */
static const rx_direct_kernels *kernels_of(rx_real x, rx_real y)
{
    const int floats = x == RX_REAL_F32 && y == RX_REAL_F32;
    const int wide = floats ? rx_dnn_has_avx512() : rx_dnn_has_bf16();
    if (wide && rx_direct_avx512() != NULL)
        return rx_direct_avx512();
    return floats && rx_dnn_has_avx2() ? rx_direct_avx2() : NULL;
}

static void measure(const rx_conv_shape *s, int fine, rx_direct *d)
{
    d->kernels = kernels_of(s->x, s->y);
    d->shape = *s;
    d->fine = fine;
    d->words = s->in * (int)rx_real_bytes(s->x) / (int)sizeof(float);
    d->step = s->stride * d->words;
    d->winograd = s->fast && !fine && s->kernel == 3 && s->stride == 1 && s->x == RX_REAL_F32 &&
                  s->in <= MOST_IN && s->height % 2 == 0;
    d->blocks = d->kernels != NULL && s->out % (2 * d->kernels->lanes) == 0 ? 2 : 1;
}

int rx_direct_can(const rx_conv_shape *shape, int fine)
{
    rx_direct d;
    if (!shape->band || shape->backward || shape->in % 2 != 0)
        return 0;
    measure(shape, fine, &d);
    if (d.kernels == NULL)
        return 0;
    if (fine)
        return shape->in % 8 == 0 && shape->out == FINE && shape->stride == 1 && shape->y == RX_REAL_F32 &&
               !shape->sum;
    return shape->out % d.kernels->lanes == 0 && (d.winograd || d.kernels->has_rows(&d));
}

/* The nearest bfloat16 (even). */
static uint16_t narrow(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (uint16_t)((bits + 0x7fffU + (bits >> 16 & 1U)) >> 16);
}

static void put(const rx_direct *d, size_t word, int half, float value)
{
    if (d->shape.x == RX_REAL_F32)
        ((float *)d->weights)[word] = value;
    else
        ((uint16_t *)d->weights)[2 * word + (size_t)half] = narrow(value);
}

/* Where the weight from channel i to o at place (v, u) of the kernel goes, in words. */
static size_t place(const rx_direct *d, int o, int v, int u, int word)
{
    const int lanes = d->kernels->lanes, group = lanes * d->blocks;
    const int k = d->shape.kernel, span = k * d->words, vectors = (span + lanes - 1) / lanes;
    const int along = u * d->words + word;
    if (d->fine)
        return (size_t)(((v * vectors + along / lanes) * FINE + o) * lanes + along % lanes);
    return ((size_t)(o / group) * (size_t)(k * span) + (size_t)(v * span + along)) * (size_t)group +
           (size_t)(o % group);
}

/* G g G' of a kernel (direct_winograd.h). */
static void transform_weights(const float *kernel, double *points)
{
    double half[4][3];
    for (int u = 0; u < 3; u++) {
        const double a = kernel[u], b = kernel[3 + u], c = kernel[6 + u];
        half[0][u] = a;
        half[1][u] = (a + b + c) / 2;
        half[2][u] = (a - b + c) / 2;
        half[3][u] = c;
    }
    for (int v = 0; v < 4; v++) {
        const double a = half[v][0], b = half[v][1], c = half[v][2];
        points[4 * v] = a;
        points[4 * v + 1] = (a + b + c) / 2;
        points[4 * v + 2] = (a - b + c) / 2;
        points[4 * v + 3] = c;
    }
}

static void load_winograd(rx_direct *d, const float *weights)
{
    const int in = d->shape.in, out = d->shape.out, group = d->kernels->lanes * d->blocks;
    for (int o = 0; o < out; o++)
        for (int i = 0; i < in; i++) {
            double points[POINTS];
            transform_weights(weights + 9 * ((size_t)o * (size_t)in + (size_t)i), points);
            float *to =
                (float *)d->weights + (size_t)(o / group * POINTS * in + i) * (size_t)group + o % group;
            for (int k = 0; k < POINTS; k++)
                to[(size_t)k * (size_t)in * (size_t)group] = (float)points[k];
        }
}

static void load(rx_direct *d, const float *weights, const float *bias)
{
    const rx_conv_shape *s = &d->shape;
    const int per_word = s->in / d->words;
    memcpy(d->bias, bias, (size_t)s->out * sizeof(float));
    if (d->winograd) {
        load_winograd(d, weights);
        return;
    }
    for (int o = 0; o < s->out; o++)
        for (int i = 0; i < s->in; i++)
            for (int v = 0; v < s->kernel; v++)
                for (int u = 0; u < s->kernel; u++)
                    put(d, place(d, o, v, u, i / per_word), i % per_word, *weights++);
}

rx_status rx_direct_new(const rx_conv_shape *shape, int fine, const float *weights, const float *bias,
                        rx_direct **dst, rx_error *err)
{
    rx_direct *d = *dst = RX_NEW(rx_direct, 1);
    if (d == NULL)
        return rx_error_memory(err, sizeof *d);
    measure(shape, fine, d);
    /* the lanes that a row of the kernel does not fill are 0 */
    const size_t span = (size_t)(shape->kernel * d->words) + MOST_LANES;
    const size_t words = d->winograd ? (size_t)(POINTS * shape->in) * (size_t)shape->out
                                     : (size_t)shape->kernel * span * (size_t)shape->out;
    d->weights = RX_NEW(float, words);
    d->bias = RX_NEW(float, (size_t)shape->out);
    if (d->weights == NULL || d->bias == NULL) {
        rx_direct_free(d);
        *dst = NULL;
        return rx_error_memory(err, words * sizeof(float));
    }
    load(d, weights, bias);
    return RX_OK;
}

void rx_direct_free(rx_direct *direct)
{
    if (direct == NULL)
        return;
    free(direct->weights);
    free(direct->bias);
    free(direct);
}

size_t rx_direct_scratch(void)
{
    return (size_t)(POINTS * SUMS) * (MOST_IN + MOST_LANES);
}

void rx_direct_run(const rx_direct *direct, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                   rx_direct_area area, float *scratch)
{
    if (direct->fine)
        direct->kernels->fine(direct, x, y, area);
    else if (direct->winograd)
        direct->kernels->winograd(direct, x, add, y, area, scratch);
    else
        direct->kernels->wide(direct, x, add, y, area);
}

int rx_direct_can_up2(const rx_plane *src, const rx_plane *dst)
{
    const rx_direct_kernels *kernels = kernels_of(src->real, dst->real);
    return kernels != NULL && src->channels % kernels->lanes == 0;
}

void rx_direct_up2(const rx_plane *src, const rx_plane *add, int relu, const rx_plane *dst,
                   rx_direct_area area)
{
    kernels_of(src->real, dst->real)->up2(src, add, relu, dst, area);
}
