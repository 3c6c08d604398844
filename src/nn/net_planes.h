/* What a network's nodes work on: planes of one size of input, and their convolutions. */
#ifndef RX_NN_NET_PLANES_H
#define RX_NN_NET_PLANES_H

#include "nn/net.h"
#include "nn/plane.h"

typedef struct rx_node_planes {
    rx_plane value; /* without memory, like raw */
    rx_plane raw;   /* what a folded convolution leaves, before the shuffle; no channels: there is none */
} rx_node_planes;

/* Operations to twice the size that run as one convolution, folded (nn/layers.h), and a shuffle. */
static inline int rx_node_folds(const rx_node *node)
{
    return node->op == RX_OP_UPCONV || node->op == RX_OP_TRANSPOSED;
}

/* dst[net->nnodes], for an input of height x width. RX_BF16: inner planes are bfloat16; float are the input,
 * the output, and what is only moved from or to them. */
void rx_net_planes(const rx_net *net, rx_precision precision, int height, int width, rx_node_planes *dst);

/* The convolution of node i, from its source's value to its raw plane or value. */
rx_conv_shape rx_net_conv(const rx_net *net, int i, const rx_node_planes *planes);

/* Its parameters: into params, or, of a folded one, into `folded`, which holds rx_net_folded() floats. */
void rx_net_conv_params(const rx_net *net, int i, const float *params, float *folded, const float **weights,
                        const float **bias);
size_t rx_net_folded(const rx_net *net);

/* Floats of scratch that nn/layers.h needs. */
size_t rx_net_row(const rx_net *net, const rx_node_planes *planes);

#endif
