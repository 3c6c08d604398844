/* Networks of an earlier training. */
#include "train/first_model.h"

#include <string.h>

static int same_networks(const rx_net *a, const rx_net *b)
{
    if (a->nnodes != b->nnodes || a->nparams != b->nparams)
        return 0;
    for (int i = 0; i < a->nnodes; i++) {
        const rx_node *p = &a->node[i], *q = &b->node[i];
        if (p->op != q->op || p->src != q->src || p->add != q->add || p->relu != q->relu ||
            p->channels != q->channels || p->kernel != q->kernel || p->stride != q->stride)
            return 0;
    }
    return 1;
}

/* Where both have one. */
static int differ(const rx_net *a, const rx_net *b)
{
    return a != NULL && b != NULL && !same_networks(a, b);
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
    if (first->second != NULL && model->second == NULL)
        return rx_error_at(err, RX_USAGE, path, -1, 0,
                           "its network has two stages, made for each other; set STAGES 2");
    if (!same_networks(first->restore, model->restore) || differ(first->psf, model->psf) ||
        differ(first->second, model->second))
        return rx_error_at(err, RX_USAGE, path, -1, 0,
                           "its network has another shape; set WIDTH, BLOCKS, STEM, DECODER and KERNELS as "
                           "rextract-train -INFO shows them");
    return RX_OK;
}

static void copy(const rx_net *src, rx_net *dst)
{
    if (src != NULL && dst != NULL)
        memcpy(dst->params, src->params, (size_t)src->nparams * sizeof *src->params);
}

rx_status rx_first_model(const char *path, rx_model *model, rx_error *err)
{
    rx_model *first = NULL;
    RX_TRY(rx_model_read(path, &first, err));
    rx_status status = check(path, first, model, err);
    if (status == RX_OK) {
        copy(first->restore, model->restore);
        copy(first->psf, model->psf);
        copy(first->second, model->second);
    }
    rx_model_free(first);
    return status;
}
