/* A network at work: forward, backward. */
#include "nn/runner.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/runner_parts.h"

int rx_runner_has_bf16(void)
{
    return rx_dnn_has_bf16();
}

/* ---- making ---- */

static rx_status check(const rx_net *net, int height, int width, int backward, rx_precision precision,
                       rx_error *err)
{
    enum { LARGEST = 1 << 20 };
    int step = 1 << rx_net_levels(net);
    if (height < step || width < step || height % step != 0 || width % step != 0 || height > LARGEST ||
        width > LARGEST)
        return rx_error_set(
            err, RX_INPUT, "the network cannot work on %d x %d pixels; both must be positive multiples of %d",
            width, height, step);
    if (precision == RX_BF16 && backward)
        return rx_error_set(err, RX_USAGE, "gradients need single precision; choose F32");
    if (precision == RX_BF16 && !rx_runner_has_bf16())
        return rx_error_set(err, RX_USAGE, "this processor does not multiply bfloat16; choose F32");
    return RX_OK;
}

rx_status rx_runner_new(const rx_net *net, int height, int width, int backward, rx_precision precision,
                        rx_runner **dst, rx_error *err)
{
    *dst = NULL;
    rx_status status = check(net, height, width, backward, precision, err);
    if (status)
        return status;
    rx_runner *r = RX_NEW(rx_runner, 1);
    if (r == NULL)
        return rx_error_memory(err, sizeof *r);
    r->net = net;
    r->backward = backward;
    r->precision = precision;
    status = rx_dnn_new(&r->dnn, err);
    if (!status)
        status = rx_runner_plan(r, height, width, err);
    if (!status)
        status = rx_runner_load(r, net->params, err);
    if (status)
        rx_runner_free(r);
    else
        *dst = r;
    return status;
}

void rx_runner_free(rx_runner *runner)
{
    if (runner == NULL)
        return;
    for (int i = 0; i < RX_NET_NODES; i++)
        rx_conv_free(runner->node[i].conv);
    for (int k = 0; k < runner->nslots; k++)
        free(runner->slot[k].data);
    free(runner->row);
    free(runner->folded);
    free(runner->spare);
    rx_dnn_free(runner->dnn);
    free(runner);
}

void rx_runner_node_params(const rx_net *net, int i, const float *params, float *folded,
                           const float **weights, const float **bias)
{
    const rx_node *n = &net->node[i];
    const size_t out = (size_t)n->channels;
    *weights = params + n->weight;
    *bias = params + n->bias;
    if (!rx_runner_folds(n->op))
        return;
    const int in = net->node[n->src].channels, k = rx_layer_folded_kernel(n);
    float *biases = folded + 4 * out * (size_t)(in * k * k);
    rx_layer_fold(n, in, *weights, folded);
    for (size_t phase = 0; phase < 4; phase++)
        memcpy(biases + phase * out, *bias, out * sizeof(float));
    *weights = folded;
    *bias = biases;
}

rx_status rx_runner_load_node(const rx_net *net, int i, const float *params, float *folded, rx_conv *conv,
                              rx_error *err)
{
    const float *weights, *bias;
    rx_runner_node_params(net, i, params, folded, &weights, &bias);
    return rx_conv_load(conv, weights, bias, err);
}

rx_status rx_runner_load(rx_runner *runner, const float *params, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 1; !status && i < runner->net->nnodes; i++)
        if (runner->node[i].conv != NULL)
            status = rx_runner_load_node(runner->net, i, params, runner->folded, runner->node[i].conv, err);
    return status;
}

float *rx_runner_input(rx_runner *runner)
{
    return runner->node[0].value.data;
}

const float *rx_runner_output(const rx_runner *runner)
{
    return runner->node[runner->net->nnodes - 1].value.data;
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

/* A convolution into raw or value, then what it could not do itself. */
static rx_status forward_conv(const rx_runner_node *me, const rx_node *n, const rx_plane *src,
                              const rx_plane *add, rx_plane *value, float *row, rx_error *err)
{
    rx_plane raw = me->raw, *to = raw.channels > 0 ? &raw : value;
    rx_status status = rx_conv_run(me->conv, src->data, me->fused_add ? add->data : NULL, to->data, err);
    if (rx_runner_folds(n->op)) {
        rx_layer_shuffle(to, value);
        to = value;
    }
    const rx_plane *more = me->fused_add ? NULL : add;
    int relu = n->relu && !me->fused_relu;
    if (more != NULL || relu)
        rx_layer_finish(to, more, relu, row);
    if (to != value)
        rx_layer_convert(to, value);
    return status;
}

rx_status rx_runner_apply(const rx_runner_node *me, const rx_node *n, const rx_plane *src,
                          const rx_plane *add, rx_plane *value, float *row, rx_error *err)
{
    if (me->conv != NULL)
        return forward_conv(me, n, src, add, value, row, err);
    if (n->op == RX_OP_UP2) {
        rx_layer_up2(src, value, add, n->relu, row);
        return RX_OK;
    }
    if (n->op == RX_OP_SHUFFLE)
        rx_layer_shuffle(src, value);
    else
        rx_layer_unshuffle(src, value);
    if (add != NULL || n->relu)
        rx_layer_finish(value, add, n->relu, row);
    return RX_OK;
}

rx_status rx_runner_forward(rx_runner *runner, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 1; !status && i < runner->net->nnodes; i++) {
        const rx_node *n = &runner->net->node[i];
        const rx_plane *add = n->add >= 0 ? &runner->node[n->add].value : NULL;
        status = rx_runner_apply(&runner->node[i], n, &runner->node[n->src].value, add,
                                 &runner->node[i].value, runner->row, err);
    }
    return status;
}

/* ---- backward ---- */

/* Parameters of a convolution: gradient += . */
static rx_status learn(rx_runner *r, int i, const rx_plane *gradient, float *params, rx_error *err)
{
    const rx_node *n = &r->net->node[i];
    rx_runner_node *me = &r->node[i];
    const rx_plane *src = &r->node[n->src].value;
    const float *weights, *bias;
    float *to = params + n->weight, *to_bias = params + n->bias;
    size_t out = (size_t)n->channels;
    rx_status status = rx_conv_weights(me->conv, src->data, gradient->data, &weights, &bias, err);
    if (status)
        return status;
    if (rx_runner_folds(n->op)) {
        rx_layer_unfold(n, src->channels, weights, to);
        for (size_t phase = 0; phase < 4; phase++)
            rx_layer_add(bias + phase * out, to_bias, out);
        return RX_OK;
    }
    rx_layer_add(weights, to, (size_t)n->nweights);
    rx_layer_add(bias, to_bias, out);
    return RX_OK;
}

/* Gradient by the source of node i, into `to`. */
static rx_status pass_back(rx_runner *r, int i, const rx_plane *gradient, rx_plane *to, rx_error *err)
{
    switch (r->net->node[i].op) {
    case RX_OP_UNSHUFFLE:
        rx_layer_shuffle(gradient, to);
        return RX_OK;
    case RX_OP_SHUFFLE:
        rx_layer_unshuffle(gradient, to);
        return RX_OK;
    case RX_OP_UP2:
        rx_layer_up2_back(gradient, to, r->row);
        return RX_OK;
    default:
        return rx_conv_data(r->node[i].conv, gradient->data, to->data, err);
    }
}

/* filled[k]: the gradient of node k holds something already. */
static rx_status backward_node(rx_runner *r, int i, float *params, const int *wanted, int *filled,
                               rx_error *err)
{
    const rx_node *n = &r->net->node[i];
    rx_runner_node *me = &r->node[i];
    rx_plane *gradient = &me->gradient;
    rx_status status = RX_OK;
    if (n->relu)
        rx_layer_relu_back(me->value.data, gradient->data, rx_plane_size(gradient));
    if (n->add >= 0 && wanted[n->add]) {
        float *to = r->node[n->add].gradient.data;
        if (filled[n->add])
            rx_layer_add(gradient->data, to, rx_plane_size(gradient));
        else
            memcpy(to, gradient->data, rx_plane_bytes(gradient));
        filled[n->add] = 1;
    }
    if (rx_runner_folds(n->op)) {
        /* The folded convolution's own output is not needed any more. */
        rx_layer_unshuffle(gradient, &me->raw);
        gradient = &me->raw;
    }
    if (me->conv != NULL && params != NULL)
        status = learn(r, i, gradient, params, err);
    if (status || !wanted[n->src])
        return status;
    rx_plane to = r->node[n->src].gradient;
    if (filled[n->src])
        to.data = r->spare;
    status = pass_back(r, i, gradient, &to, err);
    if (filled[n->src])
        rx_layer_add(r->spare, r->node[n->src].gradient.data, rx_plane_size(&to));
    filled[n->src] = 1;
    return status;
}

rx_status rx_runner_backward(rx_runner *runner, float *param_gradient, int want_input, rx_error *err)
{
    int wanted[RX_NET_NODES], filled[RX_NET_NODES] = {0};
    for (int i = 0; i < runner->net->nnodes; i++)
        wanted[i] = want_input || runner->node[i].learns;
    rx_status status = RX_OK;
    for (int i = runner->net->nnodes - 1; !status && i > 0; i--)
        if (wanted[i])
            status = backward_node(runner, i, param_gradient, wanted, filled, err);
    return status;
}
