/* Convolutions of a band of rows: the plain kernel, which others there are, and their weights. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/memory.h"
#include "nn/direct.h"
#include "nn/direct_kernels.h"

/* A number of a plane, as the plain kernel reads it. */
static float real_at(const rx_plane *plane, size_t at)
{
    return plane->real == RX_REAL_F32 ? ((const float *)plane->data)[at]
                                      : rx_bf16_widen(((const uint16_t *)plane->data)[at]);
}

static void run_plain(const rx_direct *d, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                      rx_direct_area area)
{
    const rx_conv_shape *s = &d->shape;
    const size_t in = (size_t)s->in, out = (size_t)s->out, span = (size_t)s->kernel * in;
    for (int v = area.first; v < area.last; v++)
        for (int u = area.left; u < area.right; u++)
            for (size_t o = 0; o < out; o++) {
                const float *w = (const float *)d->weights + o * (size_t)s->kernel * span;
                const size_t to = ((size_t)v * (size_t)y->width + (size_t)u) * out + o;
                double sum = d->bias[o];
                for (int k = 0; k < s->kernel; k++, w += span) {
                    const size_t from = ((size_t)(v * s->stride + k) * (size_t)x->width +
                                         (size_t)(u * s->stride - s->before)) *
                                        in;
                    if (x->real == RX_REAL_F32)
                        for (size_t i = 0; i < span; i++)
                            sum += (double)w[i] * ((const float *)x->data)[from + i];
                    else
                        for (size_t i = 0; i < span; i++)
                            sum += (double)w[i] * real_at(x, from + i);
                }
                if (add != NULL)
                    sum += real_at(add, to);
                const float value = s->relu && sum < 0 ? 0 : (float)sum;
                if (y->real == RX_REAL_F32)
                    ((float *)y->data)[to] = value;
                else
                    ((uint16_t *)y->data)[to] = rx_bf16_narrow(value);
            }
}

static void plain_weights(const rx_conv_shape *s, const rx_plane *x, const rx_plane *dy, float *dweights)
{
    const size_t in = (size_t)s->in, out = (size_t)s->out, width = (size_t)x->width;
    for (int place = 0; place < s->kernel * s->kernel; place++)
        for (size_t i = 0; i < in; i++)
            for (size_t o = 0; o < out; o++, dweights++) {
                double sum = 0;
                for (int v = 0; v < dy->height; v++) {
                    const float *to = (const float *)dy->data + (size_t)v * (size_t)dy->width * out + o;
                    const size_t row = (size_t)(v * s->stride + place / s->kernel),
                                 column = (size_t)(place % s->kernel);
                    const float *from = (const float *)x->data + (row * width + column) * in + i;
                    for (int u = 0; u < dy->width; u++)
                        sum += (double)from[(size_t)(u * s->stride) * in] * to[(size_t)u * out];
                }
                *dweights += (float)sum;
            }
}

static const rx_direct_kernels plain = {
    .name = "plain C", .lanes = 1, .bf16 = 1, .wide = run_plain, .weights = plain_weights};

int rx_direct_has_bf16(void)
{
    const rx_direct_kernels *kernels = rx_direct_avx512();
    return kernels != NULL && kernels->bf16;
}

/* Those of at most `lanes` (0: any) that need the fewest vectors for `count` numbers, of two the narrower. A vector
 * is filled by bfloat16, or it is the plain kernel's. */
static const rx_direct_kernels *kernels_for(rx_real x, rx_real y, int count, int lanes)
{
    const rx_direct_kernels *all[] = {rx_direct_avx512(), rx_direct_avx2(), rx_direct_vector()},
                            *best = &plain;
    const int floats = x == RX_REAL_F32 && y == RX_REAL_F32;
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        const rx_direct_kernels *k = all[i];
        if (k == NULL || (lanes > 0 && k->lanes > lanes) || (!floats && (!k->bf16 || count % k->lanes != 0)))
            continue;
        if (best == &plain || (count + k->lanes - 1) / k->lanes == (count + best->lanes - 1) / best->lanes)
            best = k;
    }
    return best;
}

const char *rx_direct_name(void)
{
    return kernels_for(RX_REAL_F32, RX_REAL_F32, MOST_LANES, 0)->name;
}

static void measure(const rx_conv_shape *s, rx_direct_options options, rx_direct *d)
{
    /* two bfloat16 are a word, and a fine one's inputs are the lanes */
    const int odd = s->x == RX_REAL_BF16 && s->in % 2 != 0;
    d->kernels = odd ? &plain : kernels_for(s->x, s->y, options.fine ? MOST_LANES : s->out, options.lanes);
    d->shape = *s;
    d->fine = options.fine;
    d->words = d->kernels->lanes > 1 ? s->in * (int)rx_real_bytes(s->x) / (int)sizeof(float) : s->in;
    d->step = s->stride * d->words;
    d->winograd = options.winograd && d->kernels->lanes > 1 && !d->fine && s->kernel == 3 && s->stride == 1 &&
                  s->x == RX_REAL_F32 && s->in <= MOST_IN && s->height % 2 == 0;
    d->padded = (s->out + d->kernels->lanes - 1) / d->kernels->lanes * d->kernels->lanes;
    d->blocks = d->kernels->lanes > 1 && d->padded % (2 * d->kernels->lanes) == 0 ? 2 : 1;
}

int rx_direct_can_fine(const rx_conv_shape *shape)
{
    return shape->in % 8 == 0 && shape->out == FINE && shape->stride == 1 && shape->y == RX_REAL_F32 &&
           !shape->sum && kernels_for(shape->x, shape->y, MOST_LANES, 0) != &plain;
}

static void put(const rx_direct *d, size_t word, int half, float value)
{
    const uint16_t nearest = rx_bf16_narrow(value);
    if (d->shape.x == RX_REAL_F32)
        ((float *)d->weights)[word] = value;
    else if (d->kernels->lanes > 1)
        ((uint16_t *)d->weights)[2 * word + (size_t)half] = nearest;
    else
        ((float *)d->weights)[word] = rx_bf16_widen(nearest);
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

/* G g G' of a kernel (direct_kernels.c). */
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
    for (int i = 0; i < in; i++)
        for (int o = 0; o < out; o++) {
            double points[POINTS];
            transform_weights(weights + 9 * ((size_t)o * (size_t)in + (size_t)i), points);
            float *to =
                (float *)d->weights + (size_t)(o / group * POINTS * in + i) * (size_t)group + o % group;
            for (int k = 0; k < POINTS; k++)
                to[(size_t)k * (size_t)in * (size_t)group] = (float)points[k];
        }
}

void rx_direct_load(rx_direct *d, const float *weights, const float *bias)
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

rx_status rx_direct_new(const rx_conv_shape *shape, rx_direct_options options, const float *weights,
                        const float *bias, rx_direct **dst, rx_error *err)
{
    RX_TRY(RX_MAKE(*dst, 1, err));
    rx_direct *d = *dst;
    measure(shape, options, d);
    /* the lanes that a row of the kernel or the outputs do not fill are 0 */
    const size_t span = (size_t)(shape->kernel * d->words) + MOST_LANES;
    const size_t words = d->winograd ? (size_t)(POINTS * shape->in) * (size_t)d->padded
                                     : (size_t)shape->kernel * span * (size_t)d->padded;
    d->weights = RX_NEW(float, words);
    d->bias = RX_NEW(float, (size_t)d->padded);
    if (d->weights == NULL || d->bias == NULL) {
        rx_direct_free(d);
        *dst = NULL;
        return rx_error_memory(err, words * sizeof(float));
    }
    rx_direct_load(d, weights, bias);
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

int rx_direct_lanes(const rx_direct *direct)
{
    return direct->kernels->lanes;
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

void rx_direct_weights(const rx_conv_shape *shape, int lanes, const rx_plane *x, const rx_plane *dy,
                       float *dweights)
{
    kernels_for(RX_REAL_F32, RX_REAL_F32, shape->out, lanes)->weights(shape, x, dy, dweights);
}

int rx_direct_up2(const rx_plane *src, const rx_plane *add, int relu, const rx_plane *dst,
                  rx_direct_area area)
{
    const rx_direct_kernels *kernels = kernels_for(src->real, dst->real, src->channels, 0);
    const int can = kernels->lanes > 1 && src->channels % kernels->lanes == 0;
    if (can)
        kernels->up2(src, add, relu, dst, area);
    return can;
}

/* --- the peak --- */

enum { SIDE = 56, CHANNELS = 64, KERNEL = 3 };
static const double PATIENCE = 0.05; /* seconds */

rx_status rx_direct_peak(rx_real real, double *flops, rx_error *err)
{
    const rx_conv_shape shape = {.height = SIDE + KERNEL - 1,
                                 .width = SIDE + KERNEL - 1,
                                 .in = CHANNELS,
                                 .out = CHANNELS,
                                 .kernel = KERNEL,
                                 .stride = 1,
                                 .before = KERNEL / 2,
                                 .after = KERNEL / 2,
                                 .x = real,
                                 .y = real};
    const rx_direct_area all = {KERNEL / 2, SIDE + KERNEL / 2, 0, SIDE};
    rx_plane x = {.real = real, .height = shape.height, .width = shape.width, .channels = CHANNELS}, y = x;
    const size_t weights = CHANNELS * CHANNELS * KERNEL * KERNEL;
    const size_t reals = rx_plane_size(&x); /* more than there are weights, all 0 */
    rx_direct *direct = NULL;
    float *memory, *scratch = NULL;
    double best = HUGE_VAL;
    rx_status status;
    *flops = 0;
    RX_TRY(RX_MAKE(memory, 2 * reals, err));
    x.data = memory;
    y.data = memory + reals;
    RX_TRY_EXIT(RX_MAKE(scratch, rx_direct_scratch(), err));
    RX_TRY_EXIT(rx_direct_new(&shape, (rx_direct_options){0}, memory, memory, &direct, err));
    const double begun = rx_seconds();
    for (int run = 0; run < 2 || rx_seconds() - begun < PATIENCE; run++) {
        const double from = rx_seconds();
        rx_direct_run(direct, &x, NULL, &y, all, scratch);
        best = fmin(best, rx_seconds() - from);
    }
    *flops = 2.0 * (double)(weights * SIDE * SIDE) / best;
exit:
    rx_direct_free(direct);
    free(memory);
    free(scratch);
    return status;
}
