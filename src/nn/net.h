/* A convolutional network as data: a list of nodes and one array of parameters.
 *
 * Nodes are in order: each takes the output of an earlier one (node 0 is the input), optionally adds that of
 * another of the same shape, optionally cuts at 0. Nothing looks at the whole image (no normalisation layer),
 * so the network is equivariant under shifts by multiples of its coarsest stride, and what happens beyond
 * rx_net_halo() pixels does not matter. Widths, kernels and depth are read from a model file, never code.
 *
 *   value(i) = relu?( op(value(src)) + value(add)? )
 *
 * Planes are NHWC: [height][width][channels] floats. A node at level l has 1/2^l of the input's height and
 * width, both of which are multiples of 2^levels. Beyond the border of a plane everything is 0.
 */
#ifndef RX_NN_NET_H
#define RX_NN_NET_H

#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"

RX_BEGIN_DECLS

/* In which numbers a network is computed. */
typedef enum rx_precision {
    RX_F32,
    RX_BF16 /* inner planes and weights bfloat16, sums float; input and output float, and so is the work of
               the first convolution, which reads the input */
} rx_precision;

typedef enum rx_op {
    RX_OP_INPUT, /* channels of the caller */
    RX_OP_CONV,  /* kernel k (odd), stride 1 or 2, bias: y = b + sum w[o][i][v][u] x[stride y + v - k/2] */
    RX_OP_TRANSPOSED, /* kernel k (even), stride 2, bias: the transpose of a convolution of stride 2 and
                         padding k/2 - 1; weights [in][out][k][k]; level - 1; runs folded, like UPCONV */
    RX_OP_UNSHUFFLE,  /* 2x2 pixels become 4 times the channels, [dy][dx][c]; level + 1 */
    RX_OP_SHUFFLE,    /* the inverse: a quarter of the channels; level - 1 */
    RX_OP_UP2,        /* bilinear, twice the size (centres aligned: weights 3/4, 1/4; the border repeats);
                         level - 1 */
    RX_OP_UPCONV /* bilinear to twice the size of a plane that continues with 0 beyond its border, then a 3x3
                    convolution with bias: for few channels; runs folded, as one 3x3 convolution to 4 times
                    the channels at the lower resolution, then shuffled; level - 1 */
} rx_op;

enum { RX_NET_NODES = 64, RX_NET_CHANNELS = 1024, RX_NET_KERNEL = 15 };

typedef struct rx_node {
    rx_op op;
    int src, add; /* earlier nodes; add -1: none */
    int relu;     /* 1: cut at 0 */
    int channels; /* of the output */
    int kernel, stride;
    /* found by rx_net_new() */
    int level;         /* output has 1/2^level of the input's pixels in each direction */
    long weight, bias; /* offsets into params; -1 where the op has none */
    long nweights;
} rx_node;

typedef struct rx_net {
    int nnodes;
    rx_node node[RX_NET_NODES];
    long nparams;
    float *params; /* [nparams], owned: weights [out][in][k][k] (TRANSPOSED: [in][out][k][k]) then biases,
                      node by node */
} rx_net;

/* Checks the list (only op .. stride are read), lays the parameters out, zeroed; nparams: how many the caller has for them,
 * -1: none yet. *dst is freed by rx_net_free(). Errors: RX_INPUT (says which node and why), RX_SYSTEM. */
rx_status rx_net_new(const rx_node *nodes, int nnodes, long nparams, rx_net **dst, rx_error *err);
void rx_net_free(rx_net *net); /* NULL is fine */

/* He (2015, arXiv 1502.01852) normal initialisation from (seed, stream), biases 0. Convolutions whose output
 * is added to another node (the end of a residual block) start `damped` times smaller, and the last node with
 * parameters `last` times. */
void rx_net_initialise(rx_net *net, uint64_t seed, uint64_t stream, double damped, double last);

int rx_net_levels(const rx_net *net); /* inputs must be multiples of 2^levels */
/* How many pixels beyond a block of the output its values depend on, on each side, where the block begins and
 * ends on multiples of 2^levels; in input pixels, rounded up to a multiple of 2^levels. What lies farther
 * away cannot matter. */
int rx_net_halo(const rx_net *net);
/* needed[nnodes]: the same of each node, in its own pixels, not rounded. */
void rx_net_margins(const rx_net *net, int *needed);
double rx_net_macs(const rx_net *net); /* multiplications per input pixel, as it runs (folded) */

const char *rx_op_name(rx_op op); /* "CONV" ...; */
int rx_op_find(const char *name); /* -1 when unknown */

RX_END_DECLS

#endif
