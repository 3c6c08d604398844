/* Networks of an earlier training. */
#include "train/first_model.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/layers.h"

enum { SIDE = 3, TAPS = SIDE * SIDE, PHASES = 4 };

static int same_place(const rx_node *p, const rx_node *q)
{
    return p->src == q->src && p->add == q->add && p->relu == q->relu;
}

static int same_node(const rx_node *p, const rx_node *q)
{
    return same_place(p, q) && p->op == q->op && p->channels == q->channels && p->kernel == q->kernel &&
           p->stride == q->stride;
}

static int is_at(const rx_net *net, int i, rx_op op)
{
    return i < net->nnodes && net->node[i].op == op;
}

/* Is node i of `a` interpolated, and of `b` a convolution to sub-pixels that can do the same? */
static int is_interpolation(const rx_net *a, const rx_net *b, int i)
{
    const rx_node *p = &a->node[i], *q = &b->node[i];
    const int before = p->op == RX_OP_CONV && p->kernel == 1 && is_at(a, i + 1, RX_OP_UP2);
    return (before || p->op == RX_OP_UPCONV) && same_place(p, q) && q->op == RX_OP_CONV &&
           q->kernel == SIDE && q->stride == 1 && q->channels == PHASES * p->channels &&
           is_at(b, i + 1, RX_OP_SHUFFLE);
}

/* The interpolation itself, which has no parameters. */
static int is_interpolated(const rx_net *a, const rx_net *b, int i)
{
    const rx_node *p = &a->node[i], *q = &b->node[i];
    return p->op == RX_OP_UP2 && q->op == RX_OP_SHUFFLE && same_place(p, q) && p->channels == q->channels &&
           i > 0 && is_interpolation(a, b, i - 1);
}

/* Does `b` have the nodes of `a`, or sub-pixels in place of interpolation? */
static int can_begin(const rx_net *a, const rx_net *b)
{
    const int last = a->nnodes - 1, finer = is_at(a, last, RX_OP_UPCONV) && is_at(b, last + 1, RX_OP_SHUFFLE);
    if (b->nnodes != a->nnodes + finer)
        return 0;
    for (int i = 0; i < a->nnodes; i++)
        if (!same_node(&a->node[i], &b->node[i]) && !is_interpolation(a, b, i) && !is_interpolated(a, b, i))
            return 0;
    return 1;
}

static rx_status check(const char *path, const rx_model *first, const rx_model *model, rx_error *err)
{
    if (first->front.mode != model->front.mode)
        return rx_error_at(err, RX_USAGE, path, -1, 0,
                           "a model of MODE %s cannot begin a training of MODE %s",
                           first->front.mode == RX_MODE_BLIND ? "BLIND" : "INFORMED",
                           model->front.mode == RX_MODE_BLIND ? "BLIND" : "INFORMED");
    if (first->front.target_fwhm != model->front.target_fwhm)
        return rx_error_at(err, RX_USAGE, path, -1, 0,
                           "its output has a FWHM of %g pixels, TARGET_FWHM is %g; make them the same",
                           first->front.target_fwhm, model->front.target_fwhm);
    if (!can_begin(first->restore, model->restore) ||
        (first->psf != NULL && model->psf != NULL && !can_begin(first->psf, model->psf)))
        return rx_error_at(err, RX_USAGE, path, -1, 0,
                           "its network has another shape; set WIDTH, BLOCKS, STEM, DECODER and KERNELS as "
                           "rextract-train -INFO shows them");
    return RX_OK;
}

/* Weights and biases of node i of `a`, interpolated, for the convolution to sub-pixels of `b`. One of a single pixel
 * before the interpolation is one of 3 x 3 after it whose others are 0. */
static rx_status interpolate(const rx_net *a, const rx_net *b, int i, rx_error *err)
{
    const rx_node *p = &a->node[i], *q = &b->node[i];
    const int in = a->node[p->src].channels;
    const rx_node fine = {.op = RX_OP_UPCONV, .channels = p->channels, .kernel = SIDE};
    const size_t pairs = (size_t)in * (size_t)p->channels;
    float *kernels = RX_NEW(float, pairs *TAPS);
    if (kernels == NULL)
        return rx_error_memory(err, pairs * TAPS * sizeof *kernels);
    if (p->op == RX_OP_UPCONV)
        memcpy(kernels, a->params + p->weight, pairs * TAPS * sizeof *kernels);
    else
        for (size_t k = 0; k < pairs; k++)
            kernels[k * TAPS + TAPS / 2] = a->params[p->weight + (long)k];
    rx_layer_fold(&fine, in, kernels, b->params + q->weight);
    for (int phase = 0; phase < PHASES; phase++)
        memcpy(b->params + q->bias + phase * p->channels, a->params + p->bias,
               (size_t)p->channels * sizeof *b->params);
    free(kernels);
    return RX_OK;
}

static rx_status begin(const rx_net *a, const rx_net *b, rx_error *err)
{
    for (int i = 0; i < a->nnodes; i++) {
        const rx_node *p = &a->node[i], *q = &b->node[i];
        if (is_interpolation(a, b, i))
            RX_TRY(interpolate(a, b, i, err));
        else if (p->weight >= 0) {
            memcpy(b->params + q->weight, a->params + p->weight, (size_t)p->nweights * sizeof *b->params);
            memcpy(b->params + q->bias, a->params + p->bias, (size_t)p->channels * sizeof *b->params);
        }
    }
    return RX_OK;
}

rx_status rx_first_model(const char *path, rx_model *model, rx_error *err)
{
    rx_model *first = NULL;
    RX_TRY(rx_model_read(path, &first, err));
    rx_status status = check(path, first, model, err);
    if (status == RX_OK)
        status = begin(first->restore, model->restore, err);
    if (status == RX_OK && first->psf != NULL && model->psf != NULL)
        status = begin(first->psf, model->psf, err);
    rx_model_free(first);
    return status;
}
