/* A convolutional network as data: checking, laying out, first values, what it reaches and costs. */
#include "nn/net.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"

static const struct {
    const char *name;
    int params; /* it has some */
    int level;  /* above that of its source, but for the stride of CONV */
} ops[] = {{"INPUT", 0, 0},    {"CONV", 1, 0}, {"TRANSPOSED", 1, -1}, {"UNSHUFFLE", 0, 1},
           {"SHUFFLE", 0, -1}, {"UP2", 0, -1}, {"UPCONV", 1, -1}};
enum { OPS = sizeof ops / sizeof ops[0], LEVELS = 8 };

const char *rx_op_name(rx_op op)
{
    return ops[op].name;
}

int rx_op_find(const char *name)
{
    for (int i = 0; i < OPS; i++)
        if (strcmp(ops[i].name, name) == 0)
            return i;
    return -1;
}

/* ---- checking ---- */

static rx_status wrong(rx_error *err, int i, const rx_node *n, const char *why)
{
    const char *name = (int)n->op >= 0 && (int)n->op < OPS ? ops[n->op].name : "?";
    return rx_error_set(err, RX_INPUT, "node %d (%s) of the network: %s", i, name, why);
}

static const char *check_kernel(const rx_node *n)
{
    int odd = n->kernel % 2;
    switch (n->op) {
    case RX_OP_CONV:
        if (n->kernel < 1 || n->kernel > RX_NET_KERNEL || !odd)
            return "its kernel must be odd, 1 to 15";
        return n->stride == 1 || n->stride == 2 ? NULL : "its stride must be 1 or 2";
    case RX_OP_TRANSPOSED:
        if (n->kernel < 2 || n->kernel > RX_NET_KERNEL || odd)
            return "its kernel must be even, 2 to 14";
        return n->stride == 2 ? NULL : "its stride must be 2";
    case RX_OP_UPCONV:
        return n->kernel == 3 ? NULL : "its kernel must be 3";
    default:
        return NULL;
    }
}

static const char *check_channels(const rx_node *n, const rx_node *src)
{
    if (n->channels < 1 || n->channels > RX_NET_CHANNELS)
        return "its channels must be 1 to 1024";
    if (n->op == RX_OP_UPCONV && 4 * n->channels > RX_NET_CHANNELS)
        return "its channels must be 1 to 256";
    if (n->op == RX_OP_UNSHUFFLE && n->channels != 4 * src->channels)
        return "its channels must be four times those of its source";
    if (n->op == RX_OP_SHUFFLE && 4 * n->channels != src->channels)
        return "its channels must be a quarter of those of its source";
    if (n->op == RX_OP_UP2 && n->channels != src->channels)
        return "its channels must be those of its source";
    return NULL;
}

/* NULL: node i is fine, and its level is set. */
static const char *check_node(rx_node *nodes, int i)
{
    rx_node *n = &nodes[i];
    if ((int)n->op < 0 || (int)n->op >= OPS)
        return "there is no such operation";
    if ((i == 0) != (n->op == RX_OP_INPUT))
        return i == 0 ? "the first node must be INPUT" : "only the first node can be INPUT";
    if (n->relu != 0 && n->relu != 1)
        return "relu must be 0 or 1";
    if (i == 0)
        return n->channels < 1 || n->channels > RX_NET_CHANNELS ? "its channels must be 1 to 1024"
               : n->relu                                        ? "the input cannot be cut"
                                                                : NULL;
    if (n->src < 0 || n->src >= i || n->add < -1 || n->add >= i)
        return "it must take its values from earlier nodes";
    const rx_node *src = &nodes[n->src];
    const char *why = check_kernel(n);
    why = why != NULL ? why : check_channels(n, src);
    if (why != NULL)
        return why;
    n->level = src->level + ops[n->op].level + (n->op == RX_OP_CONV ? n->stride - 1 : 0);
    if (n->level < 0 || n->level > LEVELS)
        return "its resolution must be 1 to 1/256 of the input's";
    if (n->add >= 0 && (nodes[n->add].level != n->level || nodes[n->add].channels != n->channels))
        return "the node to add must have its resolution and channels";
    return NULL;
}

static rx_status check(rx_node *nodes, int nnodes, rx_error *err)
{
    if (nnodes < 2 || nnodes > RX_NET_NODES)
        return rx_error_set(err, RX_INPUT, "a network of %d nodes; it must have 2 to %d", nnodes,
                            RX_NET_NODES);
    int used[RX_NET_NODES] = {0};
    for (int i = 0; i < nnodes; i++) {
        const char *why = check_node(nodes, i);
        if (why != NULL)
            return wrong(err, i, &nodes[i], why);
        if (i > 0)
            used[nodes[i].src] = 1;
        if (i > 0 && nodes[i].add >= 0)
            used[nodes[i].add] = 1;
    }
    for (int i = 0; i < nnodes - 1; i++)
        if (!used[i])
            return wrong(err, i, &nodes[i], "no other node uses it");
    return RX_OK;
}

/* ---- making ---- */

static void lay_out(rx_net *net)
{
    long next = 0;
    for (int i = 0; i < net->nnodes; i++) {
        rx_node *n = &net->node[i];
        n->weight = n->bias = -1;
        n->nweights = 0;
        if (!ops[n->op].params)
            continue;
        n->nweights = (long)net->node[n->src].channels * n->channels * n->kernel * n->kernel;
        n->weight = next;
        n->bias = next + n->nweights;
        next = n->bias + n->channels;
    }
    net->nparams = next;
}

rx_status rx_net_new(const rx_node *nodes, int nnodes, long nparams, rx_net **dst, rx_error *err)
{
    rx_status status;
    rx_net *net;
    *dst = NULL;
    RX_TRY(RX_MAKE(net, 1, err));
    net->nnodes = nnodes;
    if (nnodes > 0 && nnodes <= RX_NET_NODES)
        memcpy(net->node, nodes, (size_t)nnodes * sizeof *nodes);
    net->node[0].src = net->node[0].add = -1;
    net->node[0].level = 0;
    RX_TRY_EXIT(check(net->node, nnodes, err));
    lay_out(net);
    if (nparams >= 0 && net->nparams != nparams)
        RX_TRY_EXIT(
            rx_error_set(err, RX_INPUT, "it needs %ld parameters, the table has %ld", net->nparams, nparams));
    RX_TRY_EXIT(RX_MAKE(net->params, (size_t)net->nparams, err));
    *dst = net;
    return RX_OK;
exit:
    rx_net_free(net);
    return status;
}

void rx_net_free(rx_net *net)
{
    if (net == NULL)
        return;
    free(net->params);
    free(net);
}

void rx_net_initialise(rx_net *net, uint64_t seed, uint64_t stream, double damped, double last)
{
    int final = net->nnodes - 1;
    while (final > 0 && !ops[net->node[final].op].params)
        final--;
    for (int i = 1; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        if (!ops[n->op].params)
            continue;
        /* Each output of a transposed convolution sees a quarter of the kernel. */
        double inputs = (double)net->node[n->src].channels * n->kernel * n->kernel;
        double sd = sqrt(2 / (n->op == RX_OP_TRANSPOSED ? inputs / 4 : inputs));
        if (n->op == RX_OP_CONV && n->add >= 0)
            sd *= damped;
        if (i == final)
            sd *= last;
        for (long k = n->weight; k < n->bias; k++)
            net->params[k] = (float)(sd * rx_random_normal(seed, stream, (uint64_t)k));
        memset(net->params + n->bias, 0, (size_t)n->channels * sizeof(float));
    }
}

/* ---- what it reaches and costs ---- */

int rx_net_levels(const rx_net *net)
{
    int levels = 0;
    for (int i = 0; i < net->nnodes; i++)
        levels = net->node[i].level > levels ? net->node[i].level : levels;
    return levels;
}

/* Pixels of the source needed beyond a block when `e` pixels beyond it are wanted of the node; the block
 * begins and ends on pixels of the source. */
static int reach(const rx_node *n, int e)
{
    switch (n->op) {
    case RX_OP_CONV:
        return n->stride * e + n->kernel / 2;
    case RX_OP_TRANSPOSED:
        return (e + n->kernel / 2) / 2;
    case RX_OP_UNSHUFFLE:
        return 2 * e;
    case RX_OP_SHUFFLE:
        return (e + 1) / 2;
    case RX_OP_UP2:
        return e / 2 + 1;
    case RX_OP_UPCONV:
        return (e + 1) / 2 + 1;
    default:
        return e;
    }
}

void rx_net_margins(const rx_net *net, int *needed)
{
    for (int i = 0; i < net->nnodes; i++)
        needed[i] = 0;
    for (int i = net->nnodes - 1; i > 0; i--) {
        const rx_node *n = &net->node[i];
        int e = reach(n, needed[i]);
        if (e > needed[n->src])
            needed[n->src] = e;
        if (n->add >= 0 && needed[i] > needed[n->add])
            needed[n->add] = needed[i];
    }
}

int rx_net_halo(const rx_net *net)
{
    int needed[RX_NET_NODES];
    rx_net_margins(net, needed);
    int step = 1 << rx_net_levels(net);
    return (needed[0] + step - 1) / step * step;
}

double rx_net_macs(const rx_net *net)
{
    double macs = 0;
    for (int i = 1; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        const rx_node *src = &net->node[n->src];
        /* TRANSPOSED and UPCONV are folded: four times the channels at the resolution of their source. */
        int k = n->op == RX_OP_TRANSPOSED ? 2 * (n->kernel / 4) + 1 : n->kernel;
        double weights = n->weight >= 0 ? (double)src->channels * n->channels * k * k : 0;
        macs += n->op == RX_OP_CONV ? ldexp(weights, -2 * n->level) : ldexp(4 * weights, -2 * src->level);
    }
    return macs;
}
