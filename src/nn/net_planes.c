/* Planes and convolutions of a network's nodes. */
#include "nn/net_planes.h"

#include <string.h>

#include "nn/layers.h"

static int moves_only(rx_op op)
{
    return op == RX_OP_UNSHUFFLE || op == RX_OP_SHUFFLE;
}

static void choose_reals(const rx_net *net, rx_precision precision, rx_node_planes *planes)
{
    for (int i = 0; i < net->nnodes; i++)
        planes[i].value.real =
            precision == RX_F32 || i == 0 || i == net->nnodes - 1 ? RX_REAL_F32 : RX_REAL_BF16;
    for (int changed = 1; changed;) {
        changed = 0;
        for (int i = 1; i < net->nnodes; i++) {
            const rx_node *n = &net->node[i];
            rx_real *mine = &planes[i].value.real, *source = &planes[n->src].value.real;
            if ((moves_only(n->op) || rx_node_folds(n)) && *source == RX_REAL_F32 && *mine != RX_REAL_F32) {
                *mine = RX_REAL_F32;
                changed = 1;
            }
            if (moves_only(n->op) && *mine == RX_REAL_F32 && *source != RX_REAL_F32) {
                *source = RX_REAL_F32;
                changed = 1;
            }
        }
    }
}

void rx_net_planes(const rx_net *net, rx_precision precision, int height, int width, rx_node_planes *dst)
{
    memset(dst, 0, (size_t)net->nnodes * sizeof *dst);
    choose_reals(net, precision, dst);
    for (int i = 0; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        rx_plane *value = &dst[i].value;
        value->height = height >> n->level;
        value->width = width >> n->level;
        value->channels = n->channels;
        if (!rx_node_folds(n))
            continue;
        dst[i].raw = dst[n->src].value;
        dst[i].raw.channels = 4 * n->channels;
        dst[i].raw.real = value->real;
    }
}

rx_conv_shape rx_net_conv(const rx_net *net, int i, const rx_node_planes *planes)
{
    const rx_node *n = &net->node[i];
    const rx_plane *src = &planes[n->src].value;
    const int folds = rx_node_folds(n), kernel = folds ? rx_layer_folded_kernel(n) : n->kernel,
              stride = folds ? 1 : n->stride, half = kernel / 2;
    return (rx_conv_shape){.height = src->height,
                           .width = src->width,
                           .in = src->channels,
                           .out = folds ? 4 * n->channels : n->channels,
                           .kernel = kernel,
                           .stride = stride,
                           .before = half,
                           .after = stride == 2 && half > 0 ? half - 1 : half,
                           .x = src->real,
                           .y = planes[i].value.real,
                           .sum = !folds && n->add >= 0,
                           .relu = !folds && n->relu};
}

void rx_net_conv_params(const rx_net *net, int i, const float *params, float *folded, const float **weights,
                        const float **bias)
{
    const rx_node *n = &net->node[i];
    const size_t out = (size_t)n->channels;
    *weights = params + n->weight;
    *bias = params + n->bias;
    if (!rx_node_folds(n))
        return;
    const int in = net->node[n->src].channels, k = rx_layer_folded_kernel(n);
    float *biases = folded + 4 * out * (size_t)(in * k * k);
    rx_layer_fold(n, in, *weights, folded);
    for (size_t phase = 0; phase < 4; phase++)
        memcpy(biases + phase * out, *bias, out * sizeof(float));
    *weights = folded;
    *bias = biases;
}

size_t rx_net_folded(const rx_net *net)
{
    size_t folded = 1;
    for (int i = 1; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        if (!rx_node_folds(n))
            continue;
        const size_t k = (size_t)rx_layer_folded_kernel(n), in = (size_t)net->node[n->src].channels;
        const size_t floats = 4 * (size_t)n->channels * (in * k * k + 1);
        folded = floats > folded ? floats : folded;
    }
    return folded;
}

size_t rx_net_row(const rx_net *net, const rx_node_planes *planes)
{
    size_t row = 1;
    for (int i = 0; i < net->nnodes; i++) {
        const size_t line = (size_t)planes[i].value.width * (size_t)planes[i].value.channels;
        row = 4 * line > row ? 4 * line : row;
    }
    return row;
}
