/* PSF-NET's shape as a list of nodes. */
#include "nn/psfnet.h"

typedef struct builder {
    rx_node node[RX_NET_NODES];
    int n;
} builder;

/* Appends a node, returns its number. Of convolutions to twice the size: as all networks have them. */
static int put(builder *b, rx_op op, int src, int channels, int add, int relu)
{
    const int transposed = op == RX_OP_TRANSPOSED;
    b->node[b->n] = (rx_node){.op = op,
                              .src = src,
                              .add = add,
                              .relu = relu,
                              .channels = channels,
                              .kernel = transposed           ? 4
                                        : op == RX_OP_UPCONV ? 3
                                                             : 0,
                              .stride = transposed ? 2 : op == RX_OP_UPCONV};
    return b->n++;
}

static int conv(builder *b, int src, int channels, int kernel, int stride, int add, int relu)
{
    const int i = put(b, RX_OP_CONV, src, channels, add, relu);
    b->node[i].kernel = kernel;
    b->node[i].stride = stride;
    return i;
}

/* conv ReLU conv + input */
static int residual(builder *b, int src, int channels, int kernel)
{
    int inner = conv(b, src, channels, kernel, 1, -1, 1);
    return conv(b, inner, channels, kernel, 1, src, 0);
}

/* To half resolution with 2w channels; returns the node that the decoder adds again. */
static int stem(builder *b, const rx_psfnet_shape *s, int inputs)
{
    int w = s->width, input = put(b, RX_OP_INPUT, -1, inputs, -1, 0);
    if (s->stem == RX_STEM_UNSHUFFLE) {
        int cells = put(b, RX_OP_UNSHUFFLE, input, 4 * inputs, -1, 0);
        return conv(b, cells, 2 * w, s->stem_kernel, 1, -1, 1);
    }
    int full = conv(b, input, w, s->stem_kernel, 1, -1, 1);
    return conv(b, full, 2 * w, s->kernel, 2, -1, 1);
}

/* From quarter resolution with 4w channels to one plane at full resolution. */
static void decoder(builder *b, const rx_psfnet_shape *s, int src, int skip)
{
    int w = s->width, k = s->kernel, half;
    switch (s->decoder) {
    case RX_DECODER_TRANSPOSED:
        half = put(b, RX_OP_TRANSPOSED, src, 2 * w, skip, 1);
        half = residual(b, half, 2 * w, k);
        put(b, RX_OP_TRANSPOSED, half, 1, -1, 0);
        return;
    case RX_DECODER_SUBPIXEL:
        half = conv(b, src, 8 * w, k, 1, -1, 0);
        half = put(b, RX_OP_SHUFFLE, half, 2 * w, skip, 1);
        half = residual(b, half, 2 * w, k);
        half = conv(b, half, 4, k, 1, -1, 0);
        put(b, RX_OP_SHUFFLE, half, 1, -1, 0);
        return;
    case RX_DECODER_BILINEAR:
        half = conv(b, src, 2 * w, 1, 1, -1, 0);
        half = put(b, RX_OP_UP2, half, 2 * w, skip, 1);
        half = residual(b, half, 2 * w, k);
        put(b, RX_OP_UPCONV, half, 1, -1, 0);
        return;
    }
}

static int odd_kernel(int kernel)
{
    return kernel >= 1 && kernel <= RX_NET_KERNEL && kernel % 2 == 1;
}

rx_status rx_psfnet_new(const rx_psfnet_shape *shape, int inputs, rx_net **dst, rx_error *err)
{
    enum { OTHERS = 10, WIDEST = RX_NET_CHANNELS / 8, MOST = (RX_NET_NODES - OTHERS) / 2 };
    *dst = NULL;
    if (inputs < 1 || inputs > RX_NET_CHANNELS / 4)
        return rx_error_set(err, RX_USAGE, "a network with %d input planes; it takes 1 to %d", inputs,
                            RX_NET_CHANNELS / 4);
    if (shape->width < 1 || shape->width > WIDEST)
        return rx_error_set(err, RX_USAGE, "a network of width %d; it must be 1 to %d", shape->width, WIDEST);
    if (shape->blocks < 0 || shape->blocks > MOST)
        return rx_error_set(err, RX_USAGE, "a network of %d residual blocks; it must have 0 to %d",
                            shape->blocks, MOST);
    if (!odd_kernel(shape->kernel) || !odd_kernel(shape->stem_kernel))
        return rx_error_set(err, RX_USAGE, "kernels of %d and %d pixels; they must be odd, 1 to %d",
                            shape->stem_kernel, shape->kernel, RX_NET_KERNEL);
    builder b = {.n = 0};
    int skip = stem(&b, shape, inputs);
    int trunk = conv(&b, skip, 4 * shape->width, shape->kernel, 2, -1, 1);
    for (int i = 0; i < shape->blocks; i++)
        trunk = residual(&b, trunk, 4 * shape->width, shape->kernel);
    decoder(&b, shape, trunk, skip);
    return rx_net_new(b.node, b.n, -1, dst, err);
}
