/* A network at work: forward, backward. */
#include "nn/runner.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/direct.h"
#include "nn/layers.h"

/* A convolution there and back, on the kernels of nn/direct.h; planes are floats [height][width][channels] with 0 beyond the
 * border, which a copy with a border stands in for.
 *
 *   y  = relu?(add? + b + sum w x)
 *   dx : the convolution of dy, 0 between its pixels where the stride is 2, with the kernel turned round
 *   dw = sum over pixels of x dy,  db = sum over pixels of dy      (dy by what is before sum and cut) */
typedef struct conv {
    rx_conv_shape shape; /* of planes without a border */
    int fine;
    rx_direct *forward, *backward; /* owned, like all below; NULL: no convolution */
    float *turned;                 /* [in][out][k][k]: the weights of the way back */
    float *packed;                 /* [k][k][in][out]: a gradient as the kernel leaves it */
    float *dweights, *dbias;       /* [out][in][k][k], [out] */
} conv;

/* What one node does. */
typedef struct node {
    rx_plane gradient; /* owned data */
    conv conv;
    int learns; /* there are parameters in it or before it */
} node;

struct rx_runner {
    const rx_net *net;
    rx_node_planes at[RX_NET_NODES]; /* with memory; owned, like all below */
    node node[RX_NET_NODES];
    float *row;     /* scratch of the layers */
    float *folded;  /* weights, then biases, of a folded node */
    float *spare;   /* a gradient that is to be added to another */
    float *scratch; /* of the convolutions */
};

/* ---- a convolution ---- */

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

/* fine: y is the plane of twice the size with the 2x2 pixels that are the 4 outputs, where the kernels can do that. */
static rx_status open_conv(const rx_conv_shape *shape, int fine, conv *c, rx_error *err)
{
    const rx_conv_shape there = with_border(*shape, shape->before, shape->after), back = shape_back(shape);
    const size_t n = weights_of(shape);
    c->shape = *shape;
    c->fine = fine && rx_direct_can_fine(&there);
    RX_TRY(RX_MAKE(c->turned, n, err));
    RX_TRY(RX_MAKE(c->packed, n, err));
    RX_TRY(RX_MAKE(c->dweights, n, err));
    RX_TRY(RX_MAKE(c->dbias, (size_t)(shape->out > shape->in ? shape->out : shape->in), err));
    /* the weights come by load_conv(): here what is there, zeros */
    RX_TRY(rx_direct_new(&there, (rx_direct_options){.fine = c->fine, .winograd = 1}, c->packed, c->dbias,
                         &c->forward, err));
    return rx_direct_new(&back, (rx_direct_options){.winograd = 1}, c->turned, c->dbias, &c->backward, err);
}

static void close_conv(conv *c)
{
    rx_direct_free(c->forward);
    rx_direct_free(c->backward);
    free(c->turned);
    free(c->packed);
    free(c->dweights);
    free(c->dbias);
}

/* weights [out][in][k][k], bias [out]; both are copied. */
static void load_conv(conv *c, const float *weights, const float *bias)
{
    const rx_conv_shape *s = &c->shape;
    const size_t in = (size_t)s->in, out = (size_t)s->out, area = (size_t)(s->kernel * s->kernel);
    for (size_t o = 0; o < out; o++)
        for (size_t i = 0; i < in; i++)
            for (size_t k = 0; k < area; k++)
                c->turned[(i * out + o) * area + area - 1 - k] = weights[(o * in + i) * area + k];
    rx_direct_load(c->forward, weights, bias);
    memset(c->dbias, 0, in * sizeof(float));
    rx_direct_load(c->backward, c->turned, c->dbias);
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

static rx_plane inputs_of(const conv *c)
{
    return (rx_plane){.height = c->shape.height, .width = c->shape.width, .channels = c->shape.in};
}

static rx_plane outputs_of(const conv *c)
{
    return (rx_plane){.height = c->shape.height / c->shape.stride,
                      .width = c->shape.width / c->shape.stride,
                      .channels = c->shape.out};
}

static void run_conv(const conv *c, const float *x, const float *add, float *y, float *scratch)
{
    const rx_plane from = bordered(x, inputs_of(c), 1, c->shape.before, c->shape.after, scratch);
    rx_plane to = outputs_of(c), more = to;
    const rx_direct_area all = {0, to.width, 0, to.height};
    more.data = (float *)(size_t)add;
    to.data = y;
    if (c->fine) {
        to.height *= 2;
        to.width *= 2;
        to.channels = 1;
    }
    rx_direct_run(c->forward, &from, add != NULL ? &more : NULL, &to, all, scratch);
}

static void conv_data(const conv *c, const float *dy, float *dx, float *scratch)
{
    const rx_conv_shape *s = &c->shape;
    const rx_plane from =
        bordered(dy, outputs_of(c), s->stride, s->kernel - 1 - s->before, s->before, scratch);
    rx_plane to = inputs_of(c);
    to.data = dx;
    rx_direct_run(c->backward, &from, NULL, &to, (rx_direct_area){0, to.width, 0, to.height}, scratch);
}

/* Afterwards c->dweights [out][in][k][k] and c->dbias [out] hold the gradient. */
static void conv_weights(conv *c, const float *x, const float *dy, float *scratch)
{
    const rx_conv_shape *s = &c->shape;
    const rx_plane from = bordered(x, inputs_of(c), 1, s->before, s->after, scratch);
    rx_plane to = outputs_of(c);
    const size_t in = (size_t)s->in, out = (size_t)s->out, area = (size_t)(s->kernel * s->kernel);
    to.data = (float *)(size_t)dy;
    memset(c->packed, 0, weights_of(s) * sizeof(float));
    rx_direct_weights(s, 0, &from, &to, c->packed);
    for (size_t o = 0; o < out; o++)
        for (size_t i = 0; i < in; i++)
            for (size_t k = 0; k < area; k++)
                c->dweights[(o * in + i) * area + k] = c->packed[(k * in + i) * out + o];
    memset(c->dbias, 0, out * sizeof(float));
    for (size_t p = 0; p < (size_t)to.height * (size_t)to.width; p++)
#pragma omp simd
        for (size_t o = 0; o < out; o++)
            c->dbias[o] += dy[p * out + o];
}

/* ---- making ---- */

static rx_status plan_node(rx_runner *r, int i, size_t *scratch, rx_error *err)
{
    const rx_node *n = &r->net->node[i];
    node *me = &r->node[i];
    rx_plane *value = &r->at[i].value, *raw = &r->at[i].raw;
    me->gradient = *value;
    me->learns =
        n->weight >= 0 || (i > 0 && r->node[n->src].learns) || (n->add >= 0 && r->node[n->add].learns);
    rx_plane *const planes[] = {value, &me->gradient, raw};
    for (int k = 0; k < 3; k++)
        if (planes[k]->channels > 0 && (planes[k]->data = rx_alloc(rx_plane_bytes(planes[k]), 1)) == NULL)
            return rx_error_memory(err, rx_plane_bytes(planes[k]));
    if (n->weight < 0)
        return RX_OK;
    rx_conv_shape shape = rx_net_conv(r->net, i, r->at);
    const int fine = n->op == RX_OP_UPCONV && n->add < 0;
    if (fine)
        shape.relu = n->relu;
    RX_TRY(open_conv(&shape, fine, &me->conv, err));
    const size_t channels = (size_t)(shape.in > shape.out ? shape.in : shape.out);
    const size_t mine = rx_direct_scratch() + (size_t)(shape.height + shape.kernel) *
                                                  (size_t)(shape.width + shape.kernel) * channels;
    *scratch = mine > *scratch ? mine : *scratch;
    return RX_OK;
}

static rx_status plan(rx_runner *r, int height, int width, rx_error *err)
{
    size_t scratch = 1, spare = 1;
    rx_net_planes(r->net, RX_F32, height, width, r->at);
    for (int i = 0; i < r->net->nnodes; i++) {
        RX_TRY(plan_node(r, i, &scratch, err));
        const size_t size = rx_plane_size(&r->at[i].value);
        spare = size > spare ? size : spare;
    }
    RX_TRY(RX_MAKE(r->row, rx_net_row(r->net, r->at), err));
    RX_TRY(RX_MAKE(r->folded, rx_net_folded(r->net), err));
    RX_TRY(RX_MAKE(r->spare, spare, err));
    return RX_MAKE(r->scratch, scratch, err);
}

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
        close_conv(&runner->node[i].conv);
        free(runner->node[i].gradient.data);
        free(runner->at[i].value.data);
        free(runner->at[i].raw.data);
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
        if (runner->node[i].conv.forward == NULL)
            continue;
        rx_net_conv_params(runner->net, i, params, runner->folded, &weights, &bias);
        load_conv(&runner->node[i].conv, weights, bias);
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
        const conv *c = &runner->node[i].conv;
        const int convolves = c->forward != NULL;
        if (n->op == RX_OP_UP2) {
            rx_layer_up2(src, value, add, n->relu, runner->row);
        } else if (n->op == RX_OP_CONV || c->fine) {
            run_conv(c, src->data, add != NULL ? add->data : NULL, value->data, runner->scratch);
        } else {
            if (convolves)
                run_conv(c, src->data, NULL, raw->data, runner->scratch);
            if (n->op == RX_OP_UNSHUFFLE)
                rx_layer_unshuffle(src, value);
            else
                rx_layer_shuffle(convolves ? raw : src, value);
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
    conv *c = &r->node[i].conv;
    float *to = params + n->weight, *to_bias = params + n->bias;
    size_t out = (size_t)n->channels;
    conv_weights(c, src->data, gradient->data, r->scratch);
    if (rx_node_folds(n)) {
        rx_layer_unfold(n, src->channels, c->dweights, to);
        for (size_t phase = 0; phase < 4; phase++)
            rx_layer_add(c->dbias + phase * out, to_bias, out);
        return;
    }
    rx_layer_add(c->dweights, to, (size_t)n->nweights);
    rx_layer_add(c->dbias, to_bias, out);
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
        conv_data(&r->node[i].conv, gradient->data, to->data, r->scratch);
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
    if (me->conv.forward != NULL && params != NULL)
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
