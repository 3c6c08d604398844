/* What a network's nodes work on, planes of one size of input and their convolutions, and what stands between these: plain
 * loops over NHWC planes, forward and backward, and the folds that turn operations to twice the size into one convolution at
 * the lower resolution, before a shuffle.
 *
 * Forward functions work on float and bfloat16 planes, in float; what is added and cut is never rounded
 * before. Backward ones on floats. Nothing fails or allocates: rows of scratch come from the caller. */
#ifndef RX_NN_LAYERS_H
#define RX_NN_LAYERS_H

#include <stddef.h>

#include "nn/net.h"
#include "nn/plane.h"

/* dst = relu?(dst + add?), in place. add: same shape, may be dst's own memory. row [width * channels]. */
void rx_layer_finish(rx_plane *dst, const rx_plane *add, int relu, float *row);

/* 2x2 pixels of src become the channels [dy][dx][c] of dst, and back. Same kind of reals. */
void rx_layer_unshuffle(const rx_plane *src, rx_plane *dst);
void rx_layer_shuffle(const rx_plane *src, rx_plane *dst);

/* dst [2 h][2 w] = relu?(bilinear(src) + add?): weights 3/4 and 1/4 in each direction, the border repeats;
 * where src has h + 2 rows, the first and the last stand in for the border above and below. add may share
 * dst's memory. row [4 * width * channels of src] floats. */
void rx_layer_up2(const rx_plane *src, rx_plane *dst, const rx_plane *add, int relu, float *row);
/* Its transpose: dsrc from ddst, floats. row [width * channels of dsrc]. */
void rx_layer_up2_back(const rx_plane *ddst, rx_plane *dsrc, float *row);

/* gradient = 0 where the cut value is 0. */
void rx_layer_relu_back(const float *value, float *gradient, size_t n);
void rx_layer_add(const float *src, float *dst, size_t n);

/* Weights of the node -> those of a convolution [4 out][in][K][K] that gives the channels [dy][dx][out].
 * `in`: channels of its source; K = rx_layer_folded_kernel().
 *
 *   UPCONV      [out][in][3][3]: W[dy dx o][i][r][s] = sum_vu A_dy[v][r] A_dx[u][s] w[o][i][v][u], A_d[v][r]
 *               the share of the lower row y + r - 1 in the upper row 2 y + d + v - 1
 *   TRANSPOSED  [in][out][k][k]: W[dy dx o][i][r][s] = w[i][o][v][u], where the lower row y + r - K/2 gets to
 *               the upper row 2 y + dy through v (likewise s, u); 0 where there is no such v */
int rx_layer_folded_kernel(const rx_node *node);
/* The transpose: weights += from the gradient by the folded ones. */
void rx_layer_unfold(const rx_node *node, int in, const float *folded, float *weights);

/* --- planes and convolutions of nodes --- */

typedef struct rx_node_planes {
    rx_plane value; /* without memory, like raw */
    rx_plane raw;   /* what a folded convolution leaves, before the shuffle; no channels: there is none */
} rx_node_planes;

/* Operations to twice the size that run as one convolution, folded, and a shuffle. */
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

/* Floats of scratch that the layers need. */
size_t rx_net_row(const rx_net *net, const rx_node_planes *planes);

#endif
