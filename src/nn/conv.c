/* A convolution there and back, on planes with a border. */
#include "nn/conv.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/direct.h"

struct rx_conv {
    rx_conv_shape shape; /* of planes without a border */
    int fine;
    rx_direct *forward, *backward;
    float *turned;           /* [in][out][k][k]: the weights of the way back */
    float *packed;           /* [k][k][in][out]: a gradient as the kernel leaves it */
    float *dweights, *dbias; /* as the caller has them */
};

static size_t weights_of(const rx_conv_shape *s)
{
    return (size_t)s->out * (size_t)s->in * (size_t)s->kernel * (size_t)s->kernel;
}

/* The shape of what runs on a plane with `before` rows and columns more above and on the left, `after` below and on
 * the right. */
static rx_conv_shape with_border(rx_conv_shape s, int before, int after)
{
    s.height += before + after;
    s.width += before + after;
    s.before = s.after = 0;
    return s;
}

static rx_conv_shape shape_back(const rx_conv_shape *s)
{
    rx_conv_shape back = with_border(*s, s->kernel - 1 - s->before, s->before);
    back.in = s->out;
    back.out = s->in;
    back.stride = 1;
    back.sum = back.relu = 0;
    return back;
}

rx_status rx_conv_new(const rx_conv_shape *shape, int fine, rx_conv **dst, rx_error *err)
{
    const rx_conv_shape there = with_border(*shape, shape->before, shape->after), back = shape_back(shape);
    const size_t n = weights_of(shape);
    rx_status status = RX_OK;
    rx_conv *c = *dst = RX_NEW(rx_conv, 1);
    if (c == NULL)
        return rx_error_memory(err, sizeof *c);
    c->shape = *shape;
    c->fine = fine && rx_direct_can_fine(&there);
    c->turned = RX_NEW(float, n);
    c->packed = RX_NEW(float, n);
    c->dweights = RX_NEW(float, n);
    c->dbias = RX_NEW(float, (size_t)(shape->out > shape->in ? shape->out : shape->in));
    if (c->turned == NULL || c->packed == NULL || c->dweights == NULL || c->dbias == NULL)
        status = rx_error_memory(err, 3 * n * sizeof(float));
    const rx_direct_options options = {.fine = c->fine, .winograd = 1};
    /* the weights come by rx_conv_load(): here what is there, zeros */
    if (status == RX_OK)
        status = rx_direct_new(&there, options, c->packed, c->dbias, &c->forward, err);
    if (status == RX_OK)
        status =
            rx_direct_new(&back, (rx_direct_options){.winograd = 1}, c->turned, c->dbias, &c->backward, err);
    if (status != RX_OK) {
        rx_conv_free(c);
        *dst = NULL;
    }
    return status;
}

void rx_conv_free(rx_conv *conv)
{
    if (conv == NULL)
        return;
    rx_direct_free(conv->forward);
    rx_direct_free(conv->backward);
    free(conv->turned);
    free(conv->packed);
    free(conv->dweights);
    free(conv->dbias);
    free(conv);
}

int rx_conv_is_fine(const rx_conv *conv)
{
    return conv->fine;
}

size_t rx_conv_scratch(const rx_conv *conv)
{
    const rx_conv_shape *s = &conv->shape;
    const size_t channels = (size_t)(s->in > s->out ? s->in : s->out);
    return rx_direct_scratch() + (size_t)(s->height + s->kernel) * (size_t)(s->width + s->kernel) * channels;
}

void rx_conv_load(rx_conv *conv, const float *weights, const float *bias)
{
    const rx_conv_shape *s = &conv->shape;
    const size_t in = (size_t)s->in, out = (size_t)s->out, area = (size_t)(s->kernel * s->kernel);
    for (size_t o = 0; o < out; o++)
        for (size_t i = 0; i < in; i++)
            for (size_t k = 0; k < area; k++)
                conv->turned[(i * out + o) * area + area - 1 - k] = weights[(o * in + i) * area + k];
    rx_direct_load(conv->forward, weights, bias);
    memset(conv->dbias, 0, in * sizeof(float));
    rx_direct_load(conv->backward, conv->turned, conv->dbias);
}

/* A plane of height x width pixels, `apart` from each other, with zeros between, before and after them: so many
 * rows and columns more. The scratch of the kernels lies behind it. */
static rx_plane bordered(const float *src, rx_plane size, int apart, int before, int after, float *scratch)
{
    const size_t pixel = (size_t)size.channels, width = (size_t)(size.width * apart + before + after);
    rx_plane dst = {.data = scratch + rx_direct_scratch(),
                    .height = size.height * apart + before + after,
                    .width = (int)width,
                    .channels = size.channels};
    float *to = dst.data;
    for (int v = 0; v < dst.height; v++, to += width * pixel) {
        const int y = v - before;
        if (y < 0 || y >= size.height * apart || y % apart != 0) {
            memset(to, 0, width * pixel * sizeof *to);
            continue;
        }
        const float *from = src + (size_t)(y / apart) * (size_t)size.width * pixel;
        memset(to, 0, (size_t)before * pixel * sizeof *to);
        memset(to + (width - (size_t)after) * pixel, 0, (size_t)after * pixel * sizeof *to);
        float *row = to + (size_t)before * pixel;
        if (apart == 1)
            memcpy(row, from, (size_t)size.width * pixel * sizeof *to);
        else
            for (size_t u = 0; u < (size_t)size.width; u++) {
                memcpy(row + 2 * u * pixel, from + u * pixel, pixel * sizeof *to);
                memset(row + (2 * u + 1) * pixel, 0, pixel * sizeof *to);
            }
    }
    return dst;
}

static rx_plane inputs_of(const rx_conv *c)
{
    return (rx_plane){.height = c->shape.height, .width = c->shape.width, .channels = c->shape.in};
}

static rx_plane outputs_of(const rx_conv *c)
{
    return (rx_plane){.height = c->shape.height / c->shape.stride,
                      .width = c->shape.width / c->shape.stride,
                      .channels = c->shape.out};
}

void rx_conv_run(const rx_conv *conv, const float *x, const float *add, float *y, float *scratch)
{
    const rx_plane from = bordered(x, inputs_of(conv), 1, conv->shape.before, conv->shape.after, scratch);
    rx_plane to = outputs_of(conv), more = to;
    const rx_direct_area all = {0, to.width, 0, to.height};
    more.data = (float *)(size_t)add;
    to.data = y;
    if (conv->fine) {
        to.height *= 2;
        to.width *= 2;
        to.channels = 1;
    }
    rx_direct_run(conv->forward, &from, add != NULL ? &more : NULL, &to, all, scratch);
}

void rx_conv_data(const rx_conv *conv, const float *dy, float *dx, float *scratch)
{
    const rx_conv_shape *s = &conv->shape;
    const rx_plane from =
        bordered(dy, outputs_of(conv), s->stride, s->kernel - 1 - s->before, s->before, scratch);
    rx_plane to = inputs_of(conv);
    to.data = dx;
    rx_direct_run(conv->backward, &from, NULL, &to, (rx_direct_area){0, to.width, 0, to.height}, scratch);
}

void rx_conv_weights(rx_conv *conv, const float *x, const float *dy, float *scratch, const float **dweights,
                     const float **dbias)
{
    const rx_conv_shape *s = &conv->shape;
    const rx_plane from = bordered(x, inputs_of(conv), 1, s->before, s->after, scratch);
    rx_plane to = outputs_of(conv);
    const size_t in = (size_t)s->in, out = (size_t)s->out, area = (size_t)(s->kernel * s->kernel);
    to.data = (float *)(size_t)dy;
    memset(conv->packed, 0, weights_of(s) * sizeof(float));
    rx_direct_weights(s, 0, &from, &to, conv->packed);
    for (size_t o = 0; o < out; o++)
        for (size_t i = 0; i < in; i++)
            for (size_t k = 0; k < area; k++)
                conv->dweights[(o * in + i) * area + k] = conv->packed[(k * in + i) * out + o];
    memset(conv->dbias, 0, out * sizeof(float));
    for (size_t p = 0; p < (size_t)to.height * (size_t)to.width; p++)
#pragma omp simd
        for (size_t o = 0; o < out; o++)
            conv->dbias[o] += dy[p * out + o];
    *dweights = conv->dweights;
    *dbias = conv->dbias;
}
