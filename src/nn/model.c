/* Models in memory: life, digest, the dictionary. */
#include "nn/model.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

rx_model *rx_model_new(void)
{
    rx_model *model = RX_NEW(rx_model, 1);
    if (model == NULL)
        return NULL;
    model->front = (rx_front){
        .mode = RX_MODE_INFORMED, .target_fwhm = 2, .tikhonov = 0.02, .rl_steps = 2, .pedestal = 1};
    model->ended = 1;
    model->factor = 1.0;
    return model;
}

void rx_model_free(rx_model *model)
{
    if (model == NULL)
        return;
    rx_net_free(model->restore);
    rx_net_free(model->second);
    rx_net_free(model->psf);
    free(model->bins);
    free(model->provenance);
    free(model);
}

void rx_model_nets(const rx_model *model, rx_net *dst[RX_MODEL_NETS])
{
    dst[RX_NET_RESTORE] = model->restore;
    dst[RX_NET_PSF] = model->psf;
    dst[RX_NET_SECOND] = model->second;
}

long rx_model_params(const rx_model *model)
{
    rx_net *nets[RX_MODEL_NETS];
    long n = 0;
    rx_model_nets(model, nets);
    for (int k = 0; k < RX_MODEL_NETS; k++)
        n += nets[k] != NULL ? nets[k]->nparams : 0;
    return n;
}

/* --- digest --- */

/* Fowler, Noll, Vo 1a: the little-endian bytes of a number one after the other. */
static uint64_t add_number(uint64_t hash, uint64_t bits, int bytes)
{
    for (int i = 0; i < bytes; i++)
        hash = (hash ^ (bits >> 8 * i & 0xff)) * UINT64_C(0x100000001b3);
    return hash;
}

static uint64_t add_double(uint64_t hash, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return add_number(hash, bits, 8);
}

static uint64_t add_net(uint64_t hash, const rx_net *net)
{
    for (int i = 0; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        const int values[] = {(int)n->op, n->src, n->add, n->relu, n->channels, n->kernel, n->stride};
        for (size_t k = 0; k < sizeof values / sizeof values[0]; k++)
            hash = add_number(hash, (uint32_t)values[k], 4);
    }
    for (long i = 0; i < net->nparams; i++) {
        uint32_t bits;
        memcpy(&bits, &net->params[i], sizeof bits);
        hash = add_number(hash, bits, 4);
    }
    return hash;
}

void rx_model_digest(const rx_model *model, char dst[RX_MODEL_DIGEST])
{
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    hash = add_number(hash, (uint64_t)model->front.mode, 4);
    hash = add_double(hash, model->front.target_fwhm);
    hash = add_double(hash, model->front.tikhonov);
    hash = add_number(hash, (uint64_t)model->front.rl_steps, 4);
    hash = add_double(hash, model->front.pedestal);
    hash = add_net(hash, model->restore);
    if (model->second != NULL)
        hash = add_net(hash, model->second);
    if (model->psf != NULL)
        hash = add_net(hash, model->psf);
    snprintf(dst, RX_MODEL_DIGEST, "%016" PRIx64, hash);
}

/* --- does it hang together --- */

const char *rx_mode_name(rx_mode mode)
{
    return mode == RX_MODE_BLIND ? "BLIND" : "INFORMED";
}

/* --- the dictionary --- */

/* Cell of value on one axis of the grid: -1 below, n above. Limits belong to the cells inside. */
static int find_cell(const rx_model_bin *bins, int n, int stride, int axis, double value)
{
    const double *first = axis == 0 ? bins[0].fwhm : bins[0].sigma;
    const rx_model_bin *end = &bins[(long)(n - 1) * stride];
    if (!(value >= first[0]))
        return -1;
    for (int i = 0; i < n; i++) {
        const rx_model_bin *bin = &bins[(long)i * stride];
        if (value < (axis == 0 ? bin->fwhm : bin->sigma)[1])
            return i;
    }
    return value <= (axis == 0 ? end->fwhm : end->sigma)[1] ? n - 1 : n;
}

/* Adds to the text of `size` bytes in dst, as far as there is room; no memory is asked for. */
static void say_outside(char *dst, size_t size, const char *what, const char *unit, double value, int below,
                        double limit)
{
    const size_t length = strlen(dst);
    char *end = dst + length;
    const char *comma = length > 0 ? ", " : "";
    if (isnan(value))
        snprintf(end, size - length, "%s%s is not known", comma, what);
    else
        snprintf(end, size - length,
                 fabs(value - limit) < 0.005 ? "%s%s %.8g%s is %s %.4g" : "%s%s %.2f%s is %s %.4g", comma,
                 what, value, unit, below ? "below" : "above", limit);
}

double rx_model_peak(const rx_model *model)
{
    return model->bins == NULL ? HUGE_VAL
                               : RX_NOISE_LEVEL_PEAK * (double)RX_NOISE_LEVEL_SCALE / model->bins[0].sigma[0];
}

double rx_model_factor(const rx_model *model)
{
    return fmax(RX_MODEL_FACTOR, model->factor);
}

const rx_model_bin *rx_model_find(const rx_model *model, double fwhm, double sigma, char *outside,
                                  size_t size)
{
    char nowhere[1];
    if (outside == NULL || size == 0) {
        outside = nowhere;
        size = sizeof nowhere;
    }
    outside[0] = '\0';
    const rx_model_bin *bins = model->bins;
    if (bins == NULL) {
        snprintf(outside, size, "the model has no dictionary");
        return NULL;
    }
    const rx_model_bin *last = &bins[(long)model->nsigma * model->nfwhm - 1];
    const int i = find_cell(bins, model->nfwhm, 1, 0, fwhm),
              k = sigma > last->sigma[1] ? model->nsigma - 1
                                         : find_cell(bins, model->nsigma, model->nfwhm, 1, sigma);
    const int blur = i >= 0 && i < model->nfwhm, noise = k >= 0;
    if (!blur)
        say_outside(outside, size, "FWHM", " pixels", fwhm, i < 0, i < 0 ? bins[0].fwhm[0] : last->fwhm[1]);
    if (!noise)
        say_outside(outside, size, "noise", "", sigma, 1, bins[0].sigma[0]);
    return blur && noise ? &bins[(long)k * model->nfwhm + i] : NULL;
}
