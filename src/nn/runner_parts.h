/* Inside of the runner: its plan and memory (runner_plan.c), its work (runner.c). */
#ifndef RX_NN_RUNNER_PARTS_H
#define RX_NN_RUNNER_PARTS_H

#include "nn/dnn.h"
#include "nn/layers.h"
#include "nn/runner.h"

/* What one node does. Slots number the runner's buffers; -1: none. */
typedef struct rx_runner_node {
    rx_plane value, gradient;
    rx_plane raw;   /* what a convolution leaves where that is not yet the value: other reals or pixels */
    rx_conv *conv;  /* NULL: no convolution */
    int fused_add;  /* the convolution itself adds */
    int fused_relu; /* and cuts */
    int learns;     /* there are parameters in it or before it */
    int slot, gradient_slot, raw_slot;
} rx_runner_node;

typedef struct rx_slot {
    size_t bytes;
    int busy;
    void *data; /* owned */
} rx_slot;

/* Operations to twice the size that run as one convolution, folded, and a shuffle. */
static inline int rx_runner_folds(rx_op op)
{
    return op == RX_OP_UPCONV || op == RX_OP_TRANSPOSED;
}

enum { RX_RUNNER_SLOTS = 4 * RX_NET_NODES };

struct rx_runner {
    const rx_net *net;
    int backward;
    rx_precision precision;
    rx_dnn *dnn; /* owned, like all below */
    rx_runner_node node[RX_NET_NODES];
    rx_slot slot[RX_RUNNER_SLOTS];
    int nslots;
    float *row;    /* scratch of the layers */
    float *folded; /* weights, then biases, of a folded node */
    float *spare;  /* training: a gradient that is to be added to another */
};

/* Parts that a stream (stream.h) shares. Nodes of one network on planes of height x width: reals, shapes of
 * value and raw, what their convolutions take over, and the shape of such a convolution. */
void rx_runner_shapes(const rx_net *net, rx_precision precision, int height, int width, rx_runner_node *node);
rx_conv_shape rx_runner_conv_shape(const rx_net *net, int i, const rx_runner_node *node);
size_t rx_runner_row(const rx_net *net, const rx_runner_node *node); /* floats of the layers' scratch */
size_t rx_runner_folded(const rx_net *net);                          /* floats of rx_runner_load_node()'s */

/* Parameters of node i as its convolution has them: into params, or, of a folded one, into `folded`. */
void rx_runner_node_params(const rx_net *net, int i, const float *params, float *folded,
                           const float **weights, const float **bias);
/* The same into the convolution. Errors: RX_SYSTEM. */
rx_status rx_runner_load_node(const rx_net *net, int i, const float *params, float *folded, rx_conv *conv,
                              rx_error *err);

/* value = relu?( op(src) + add? ) of one node, on these planes; me gives raw, the convolution and what it
 * takes over. add NULL: none. */
rx_status rx_runner_apply(const rx_runner_node *me, const rx_node *n, const rx_plane *src,
                          const rx_plane *add, rx_plane *value, float *row, rx_error *err);

/* Planes, slots, convolutions and memory, for planes of height x width. Errors: RX_SYSTEM. */
rx_status rx_runner_plan(rx_runner *runner, int height, int width, rx_error *err);

#endif
