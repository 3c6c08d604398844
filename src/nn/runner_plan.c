/* The plan of a runner: which reals its planes hold, which share memory, which convolutions it needs.
 *
 * Without gradients a plane's memory is free again after its last use, and a sum is written over the plane
 * that is added where no layer needs that any more. With gradients all values stay, and only gradients share.
 */
#include <string.h>

#include "base/memory.h"
#include "nn/runner_parts.h"

/* ---- planes ---- */

static int moves_only(rx_op op)
{
    return op == RX_OP_UNSHUFFLE || op == RX_OP_SHUFFLE;
}

/* bfloat16 for inner planes; float for the input, the output, and what is only moved from or to them. */
static void choose_reals(const rx_net *net, rx_precision precision, rx_runner_node *node)
{
    for (int i = 0; i < net->nnodes; i++)
        node[i].value.real =
            precision == RX_F32 || i == 0 || i == net->nnodes - 1 ? RX_REAL_F32 : RX_REAL_BF16;
    for (int changed = 1; changed;) {
        changed = 0;
        for (int i = 1; i < net->nnodes; i++) {
            const rx_node *n = &net->node[i];
            rx_real *mine = &node[i].value.real, *source = &node[n->src].value.real;
            int keeps = moves_only(n->op) || rx_runner_folds(n->op);
            if (keeps && *source == RX_REAL_F32 && *mine != RX_REAL_F32) {
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

/* Shapes of value and raw; what the convolution takes over. */
static void plan_node(const rx_net *net, int i, int height, int width, rx_runner_node *node)
{
    const rx_node *n = &net->node[i];
    rx_runner_node *me = &node[i];
    me->value.height = height >> n->level;
    me->value.width = width >> n->level;
    me->value.channels = n->channels;
    me->gradient = me->value;
    me->gradient.real = RX_REAL_F32;
    me->slot = me->gradient_slot = me->raw_slot = -1;
    me->learns = n->weight >= 0;
    if (i == 0)
        return;
    const rx_plane *src = &node[n->src].value;
    me->learns |= node[n->src].learns || (n->add >= 0 && node[n->add].learns);
    /* Float planes are multiplied as floats, and give floats. */
    rx_real result = src->real == RX_REAL_F32 ? RX_REAL_F32 : me->value.real;
    if (rx_runner_folds(n->op)) {
        me->raw = *src;
        me->raw.channels = 4 * n->channels;
        me->raw.real = result;
    } else if (n->weight >= 0 && result != me->value.real) {
        me->raw = me->value;
        me->raw.real = result;
    }
    int direct = n->op == RX_OP_CONV && me->raw.channels == 0;
    me->fused_add = direct && n->add >= 0 && node[n->add].value.real == me->value.real;
    me->fused_relu = direct && n->relu && (n->add < 0 || me->fused_add);
}

void rx_runner_shapes(const rx_net *net, rx_precision precision, int height, int width, rx_runner_node *node)
{
    choose_reals(net, precision, node);
    for (int i = 0; i < net->nnodes; i++)
        plan_node(net, i, height, width, node);
}

/* ---- slots ---- */

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

static void give(rx_runner *r, int slot)
{
    if (slot >= 0)
        r->slot[slot].busy = 0;
}

static int takes_over(const rx_runner *r, int i, int last_use_of_add)
{
    const rx_node *n = &r->net->node[i];
    if (r->backward || n->add <= 0 || n->add == n->src || last_use_of_add != i)
        return 0;
    if (r->node[n->add].value.real != r->node[i].value.real)
        return 0;
    return r->node[i].fused_add || n->op == RX_OP_UP2;
}

static void share_values(rx_runner *r)
{
    const rx_net *net = r->net;
    int last[RX_NET_NODES] = {0}, end = net->nnodes - 1;
    for (int i = 1; i <= end; i++) {
        last[net->node[i].src] = i;
        if (net->node[i].add >= 0)
            last[net->node[i].add] = i;
    }
    r->node[0].slot = take(r, rx_plane_bytes(&r->node[0].value));
    for (int i = 1; i <= end; i++) {
        const rx_node *n = &net->node[i];
        rx_runner_node *me = &r->node[i];
        int over = takes_over(r, i, n->add >= 0 ? last[n->add] : 0);
        me->slot = over ? r->node[n->add].slot : take(r, rx_plane_bytes(&me->value));
        if (me->raw.channels > 0)
            me->raw_slot = take(r, rx_plane_bytes(&me->raw));
        if (r->backward)
            continue;
        give(r, me->raw_slot);
        if (n->src > 0 && last[n->src] == i)
            give(r, r->node[n->src].slot);
        if (n->add > 0 && n->add != n->src && last[n->add] == i && !over)
            give(r, r->node[n->add].slot);
    }
}

/* A gradient lives from the last node that uses the value back to the node itself. */
static void share_gradients(rx_runner *r)
{
    const rx_net *net = r->net;
    int end = net->nnodes - 1;
    r->node[end].gradient_slot = take(r, rx_plane_bytes(&r->node[end].gradient));
    for (int i = end; i > 0; i--) {
        int users[2] = {net->node[i].add, net->node[i].src};
        for (int k = 0; k < 2; k++) {
            rx_runner_node *other = users[k] >= 0 ? &r->node[users[k]] : NULL;
            if (other != NULL && other->gradient_slot < 0)
                other->gradient_slot = take(r, rx_plane_bytes(&other->gradient));
        }
        if (i < end)
            give(r, r->node[i].gradient_slot);
    }
}

/* ---- memory ---- */

static void *slot_data(const rx_runner *r, int slot)
{
    return slot >= 0 ? r->slot[slot].data : NULL;
}

size_t rx_runner_row(const rx_net *net, const rx_runner_node *node)
{
    size_t row = 1;
    for (int i = 0; i < net->nnodes; i++) {
        size_t line = (size_t)node[i].value.width * (size_t)node[i].value.channels;
        row = 4 * line > row ? 4 * line : row;
    }
    return row;
}

size_t rx_runner_folded(const rx_net *net)
{
    size_t folded = 1;
    for (int i = 1; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        if (!rx_runner_folds(n->op))
            continue;
        size_t k = (size_t)rx_layer_folded_kernel(n), in = (size_t)net->node[n->src].channels;
        size_t weights = 4 * (size_t)n->channels * (in * k * k + 1);
        folded = weights > folded ? weights : folded;
    }
    return folded;
}

static rx_status allocate(rx_runner *r, rx_error *err)
{
    size_t spare = 1;
    for (int i = 0; i < r->net->nnodes; i++)
        spare = rx_plane_size(&r->node[i].value) > spare ? rx_plane_size(&r->node[i].value) : spare;
    for (int k = 0; k < r->nslots; k++)
        if ((r->slot[k].data = rx_alloc(r->slot[k].bytes, 1)) == NULL)
            return rx_error_memory(err, r->slot[k].bytes);
    r->row = RX_NEW(float, rx_runner_row(r->net, r->node));
    r->folded = RX_NEW(float, rx_runner_folded(r->net));
    r->spare = RX_NEW(float, r->backward ? spare : 1);
    if (r->row == NULL || r->folded == NULL || r->spare == NULL)
        return rx_error_memory(err, spare * sizeof(float));
    for (int i = 0; i < r->net->nnodes; i++) {
        rx_runner_node *me = &r->node[i];
        me->value.data = slot_data(r, me->slot);
        me->gradient.data = slot_data(r, me->gradient_slot);
        me->raw.data = slot_data(r, me->raw_slot);
    }
    return RX_OK;
}

/* ---- convolutions ---- */

rx_conv_shape rx_runner_conv_shape(const rx_net *net, int i, const rx_runner_node *node)
{
    const rx_node *n = &net->node[i];
    const rx_runner_node *me = &node[i];
    const rx_plane *src = &node[n->src].value, *dst = me->raw.channels > 0 ? &me->raw : &me->value;
    int folds = rx_runner_folds(n->op), half;
    rx_conv_shape s = {.height = src->height,
                       .width = src->width,
                       .in = src->channels,
                       .out = dst->channels,
                       .kernel = folds ? rx_layer_folded_kernel(n) : n->kernel,
                       .stride = folds ? 1 : n->stride,
                       .x = src->real,
                       .y = dst->real,
                       .sum = me->fused_add,
                       .relu = me->fused_relu};
    half = s.kernel / 2;
    s.before = half;
    s.after = s.stride == 2 && half > 0 ? half - 1 : half;
    return s;
}

rx_status rx_runner_plan(rx_runner *runner, int height, int width, rx_error *err)
{
    rx_runner_shapes(runner->net, runner->precision, height, width, runner->node);
    share_values(runner);
    if (runner->backward)
        share_gradients(runner);
    rx_status status = allocate(runner, err);
    for (int i = 1; !status && i < runner->net->nnodes; i++) {
        if (runner->net->node[i].weight < 0)
            continue;
        rx_conv_shape shape = rx_runner_conv_shape(runner->net, i, runner->node);
        shape.backward = runner->backward;
        status = rx_conv_new(runner->dnn, &shape, &runner->node[i].conv, err);
    }
    return status;
}
