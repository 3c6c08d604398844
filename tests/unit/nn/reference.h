/* The network's definition (nn/net.h) as plain loops in double: the oracle of the runner. Slow, simple, and
 * without anything in common with the code it judges but the list of nodes. */
#ifndef REFERENCE_H
#define REFERENCE_H

#include "nn/net.h"

typedef struct ref_plane {
    int height, width, channels;
    double *value, *gradient; /* [height][width][channels] */
} ref_plane;

typedef struct reference {
    const rx_net *net;
    ref_plane node[RX_NET_NODES];
} reference;

reference *reference_new(const rx_net *net, int height, int width);
void reference_free(reference *ref);

/* Fill ref->node[0].value first; params [nparams]. */
void reference_forward(reference *ref, const double *params);

/* After forward; fill the last node's gradient first. Afterwards every node's gradient is there (before its
 * cut for the last one: the gradients are by the value), dparams [nparams] is overwritten. */
void reference_backward(reference *ref, const double *params, double *dparams);

static inline ref_plane *reference_output(reference *ref)
{
    return &ref->node[ref->net->nnodes - 1];
}
static inline long ref_size(const ref_plane *p)
{
    return (long)p->height * p->width * p->channels;
}

#endif
