/* A network at work: forward, backward. */
#include "nn/runner.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/conv.h"
#include "nn/layers.h"
#include "nn/net_planes.h"

/* What one node does. */
typedef struct node {
    rx_plane gradient; /* in the memory of a slot */
    rx_conv *conv;     /* NULL: no convolution */
    int learns;        /* there are parameters in it or before it */
    int slot;          /* -1: none yet */
} node;

typedef struct slot {
    size_t bytes;
    int busy;
    void *data; /* owned */
} slot;

struct rx_runner {
    const rx_net *net;
    rx_node_planes at[RX_NET_NODES]; /* with memory; owned, like all below */
    node node[RX_NET_NODES];
    slot slot[RX_NET_NODES]; /* memory of gradients */
    int nslots;
    float *row;     /* scratch of the layers */
    float *folded;  /* weights, then biases, of a folded node */
    float *spare;   /* a gradient that is to be added to another */
    float *scratch; /* of the convolutions */
};

/* ---- plan ---- */

/* The smallest free slot that is large enough, else the largest free one, grown, else a new one. */
static int take(rx_runner *r, size_t bytes)
{
    int best = -1;
    for (int k = 0; k < r->nslots; k++) {
        if (r->slot[k].busy)
            continue;
        size_t have = r->slot[k].bytes, had = best < 0 ? 0 : r->slot[best].bytes;
        if (best < 0 || (had < bytes ? have > had : have >= bytes && have < had))
            best = k;
    }
    if (best < 0)
        best = r->nslots++;
    if (r->slot[best].bytes < bytes)
        r->slot[best].bytes = bytes;
    r->slot[best].busy = 1;
    return best;
}

/* A gradient lives from the last node that uses the value back to the node itself. */
static void share_gradients(rx_runner *r)
{
    const rx_net *net = r->net;
    const int end = net->nnodes - 1;
    r->node[end].slot = take(r, rx_plane_bytes(&r->node[end].gradient));
    for (int i = end; i > 0; i--) {
        const int users[2] = {net->node[i].add, net->node[i].src};
        for (int k = 0; k < 2; k++) {
            node *other = users[k] >= 0 ? &r->node[users[k]] : NULL;
            if (other != NULL && other->slot < 0)
                other->slot = take(r, rx_plane_bytes(&other->gradient));
        }
        if (i < end)
            r->slot[r->node[i].slot].busy = 0;
    }
}

static rx_status allocate(rx_runner *r, rx_error *err)
{
    size_t spare = 1;
    for (int i = 0; i < r->net->nnodes; i++) {
        rx_plane *planes[] = {&r->at[i].value, &r->at[i].raw};
        for (int k = 0; k < 2; k++)
            if (planes[k]->channels > 0 && (planes[k]->data = rx_alloc(rx_plane_bytes(planes[k]), 1)) == NULL)
                return rx_error_memory(err, rx_plane_bytes(planes[k]));
        spare = rx_plane_size(planes[0]) > spare ? rx_plane_size(planes[0]) : spare;
    }
    for (int k = 0; k < r->nslots; k++)
        if ((r->slot[k].data = rx_alloc(r->slot[k].bytes, 1)) == NULL)
            return rx_error_memory(err, r->slot[k].bytes);
    for (int i = 0; i < r->net->nnodes; i++)
        r->node[i].gradient.data = r->slot[r->node[i].slot].data;
    r->row = RX_NEW(float, rx_net_row(r->net, r->at));
    r->folded = RX_NEW(float, rx_net_folded(r->net));
    r->spare = RX_NEW(float, spare);
    return r->row != NULL && r->folded != NULL && r->spare != NULL
               ? RX_OK
               : rx_error_memory(err, spare * sizeof(float));
}

static rx_status plan(rx_runner *r, int height, int width, rx_error *err)
{
    const rx_net *net = r->net;
    rx_net_planes(net, RX_F32, height, width, r->at);
    for (int i = 0; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        node *me = &r->node[i];
        me->gradient = r->at[i].value;
        me->slot = -1;
        me->learns =
            n->weight >= 0 || (i > 0 && r->node[n->src].learns) || (n->add >= 0 && r->node[n->add].learns);
    }
    share_gradients(r);
    RX_TRY(allocate(r, err));
    size_t scratch = 1;
    for (int i = 1; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        if (n->weight < 0)
            continue;
        rx_conv_shape shape = rx_net_conv(net, i, r->at);
        const int fine = n->op == RX_OP_UPCONV && n->add < 0;
        if (fine)
            shape.relu = n->relu;
        RX_TRY(rx_conv_new(&shape, fine, &r->node[i].conv, err));
        const size_t mine = rx_conv_scratch(r->node[i].conv);
        scratch = mine > scratch ? mine : scratch;
    }
    r->scratch = RX_NEW(float, scratch);
    return r->scratch != NULL ? RX_OK : rx_error_memory(err, scratch * sizeof(float));
}

/* ---- making ---- */

rx_status rx_runner_new(const rx_net *net, int height, int width, rx_runner **dst, rx_error *err)
{
    enum { LARGEST = 1 << 20 };
    const int step = 1 << rx_net_levels(net);
    *dst = NULL;
    if (height < step || width < step || height % step != 0 || width % step != 0 || height > LARGEST ||
        width > LARGEST)
        return rx_error_set(
            err, RX_INPUT, "the network cannot work on %d x %d pixels; both must be positive multiples of %d",
            width, height, step);
    rx_runner *r;
    RX_TRY(RX_MAKE(r, 1, err));
    r->net = net;
    rx_status status = plan(r, height, width, err);
    if (status != RX_OK) {
        rx_runner_free(r);
        return status;
    }
    rx_runner_load(r, net->params);
    *dst = r;
    return RX_OK;
}

void rx_runner_free(rx_runner *runner)
{
    if (runner == NULL)
        return;
    for (int i = 0; i < RX_NET_NODES; i++) {
        rx_conv_free(runner->node[i].conv);
        free(runner->at[i].value.data);
        free(runner->at[i].raw.data);
        free(runner->slot[i].data);
    }
    free(runner->row);
    free(runner->folded);
    free(runner->spare);
    free(runner->scratch);
    free(runner);
}

void rx_runner_load(rx_runner *runner, const float *params)
{
    const float *weights, *bias;
    for (int i = 1; i < runner->net->nnodes; i++) {
        if (runner->node[i].conv == NULL)
            continue;
        rx_net_conv_params(runner->net, i, params, runner->folded, &weights, &bias);
        rx_conv_load(runner->node[i].conv, weights, bias);
    }
}

float *rx_runner_input(rx_runner *runner)
{
    return runner->at[0].value.data;
}

const float *rx_runner_output(const rx_runner *runner)
{
    return runner->at[runner->net->nnodes - 1].value.data;
}

float *rx_runner_output_gradient(rx_runner *runner)
{
    return runner->node[runner->net->nnodes - 1].gradient.data;
}

const float *rx_runner_input_gradient(const rx_runner *runner)
{
    return runner->node[0].gradient.data;
}

/* ---- forward ---- */

void rx_runner_forward(rx_runner *runner)
{
    for (int i = 1; i < runner->net->nnodes; i++) {
        const rx_node *n = &runner->net->node[i];
        const rx_plane *src = &runner->at[n->src].value,
                       *add = n->add >= 0 ? &runner->at[n->add].value : NULL;
        rx_plane *value = &runner->at[i].value, *raw = &runner->at[i].raw;
        const rx_conv *conv = runner->node[i].conv;
        if (n->op == RX_OP_UP2) {
            rx_layer_up2(src, value, add, n->relu, runner->row);
        } else if (conv != NULL && (n->op == RX_OP_CONV || rx_conv_is_fine(conv))) {
            rx_conv_run(conv, src->data, add != NULL ? add->data : NULL, value->data, runner->scratch);
        } else {
            if (conv != NULL)
                rx_conv_run(conv, src->data, NULL, raw->data, runner->scratch);
            if (n->op == RX_OP_UNSHUFFLE)
                rx_layer_unshuffle(src, value);
            else
                rx_layer_shuffle(conv != NULL ? raw : src, value);
            if (add != NULL || n->relu)
                rx_layer_finish(value, add, n->relu, runner->row);
        }
    }
}

/* ---- backward ---- */

/* Parameters of a convolution: gradient += . */
static void learn(rx_runner *r, int i, const rx_plane *gradient, float *params)
{
    const rx_node *n = &r->net->node[i];
    const rx_plane *src = &r->at[n->src].value;
    const float *weights, *bias;
    float *to = params + n->weight, *to_bias = params + n->bias;
    size_t out = (size_t)n->channels;
    rx_conv_weights(r->node[i].conv, src->data, gradient->data, r->scratch, &weights, &bias);
    if (rx_node_folds(n)) {
        rx_layer_unfold(n, src->channels, weights, to);
        for (size_t phase = 0; phase < 4; phase++)
            rx_layer_add(bias + phase * out, to_bias, out);
        return;
    }
    rx_layer_add(weights, to, (size_t)n->nweights);
    rx_layer_add(bias, to_bias, out);
}

/* Gradient by the source of node i, into `to`. */
static void pass_back(rx_runner *r, int i, const rx_plane *gradient, rx_plane *to)
{
    const rx_op op = r->net->node[i].op;
    if (op == RX_OP_UNSHUFFLE)
        rx_layer_shuffle(gradient, to);
    else if (op == RX_OP_SHUFFLE)
        rx_layer_unshuffle(gradient, to);
    else if (op == RX_OP_UP2)
        rx_layer_up2_back(gradient, to, r->row);
    else
        rx_conv_data(r->node[i].conv, gradient->data, to->data, r->scratch);
}

/* filled[k]: the gradient of node k holds something already. */
static void backward_node(rx_runner *r, int i, float *params, const int *wanted, int *filled)
{
    const rx_node *n = &r->net->node[i];
    node *me = &r->node[i];
    rx_plane *gradient = &me->gradient;
    if (n->relu)
        rx_layer_relu_back(r->at[i].value.data, gradient->data, rx_plane_size(gradient));
    if (n->add >= 0 && wanted[n->add]) {
        float *to = r->node[n->add].gradient.data;
        if (filled[n->add])
            rx_layer_add(gradient->data, to, rx_plane_size(gradient));
        else
            memcpy(to, gradient->data, rx_plane_bytes(gradient));
        filled[n->add] = 1;
    }
    if (rx_node_folds(n)) {
        /* The folded convolution's own output is not needed any more. */
        rx_layer_unshuffle(gradient, &r->at[i].raw);
        gradient = &r->at[i].raw;
    }
    if (me->conv != NULL && params != NULL)
        learn(r, i, gradient, params);
    if (!wanted[n->src])
        return;
    rx_plane to = r->node[n->src].gradient;
    if (filled[n->src])
        to.data = r->spare;
    pass_back(r, i, gradient, &to);
    if (filled[n->src])
        rx_layer_add(r->spare, r->node[n->src].gradient.data, rx_plane_size(&to));
    filled[n->src] = 1;
}

void rx_runner_backward(rx_runner *runner, float *param_gradient, int want_input)
{
    int wanted[RX_NET_NODES], filled[RX_NET_NODES] = {0};
    for (int i = 0; i < runner->net->nnodes; i++)
        wanted[i] = want_input || runner->node[i].learns;
    for (int i = runner->net->nnodes - 1; i > 0; i--)
        if (wanted[i])
            backward_node(runner, i, param_gradient, wanted, filled);
}
