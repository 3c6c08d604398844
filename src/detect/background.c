/* Sky level and noise maps: the meshes' splines, weights and odd tiles. */
#include "detect/background.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "detect/libsep.h"
#include "detect/mesh.h"
#include "num/stats.h"

/* What is measured. */
typedef struct source {
    const float *pixels;
    const uint8_t *mask;
    int mask_bits;
    const float *weight;
    rx_weight_type weight_type;
} source;

static bool is_hidden(const source *src, size_t i)
{
    return (src->mask != NULL && (src->mask[i] & src->mask_bits) != 0) || !isfinite(src->pixels[i]);
}

/* Median over the meshes of (rms of the image) / sqrt(variance of the map); 1 when there is none. */
static rx_status weight_scale(const rx_background_params *par, const float *variance, const sep_bkg *back,
                              double *factor, rx_error *err)
{
    sep_bkg *meshes = NULL;
    double *ratio = NULL;
    size_t n = 0, good;
    rx_status status = rx_mesh_measure(par, back->w, back->h, variance, NULL, 0, &meshes, &good, err);
    if (status != RX_OK)
        goto exit;
    ratio = RX_NEW(double, (size_t)meshes->n);
    if (ratio == NULL) {
        status = rx_error_memory(err, (size_t)meshes->n * sizeof(double));
        goto exit;
    }
    for (int i = 0; i < meshes->n; i++)
        if (meshes->back[i] > 0.0f && back->sigma[i] > 0.0f)
            ratio[n++] = back->sigma[i] / sqrt(meshes->back[i]);
    *factor = n > 0 ? rx_median(ratio, n) : 1.0;
exit:
    free(ratio);
    rx_mesh_free(meshes);
    return status;
}

/* sigma from a map of the user, whose variances are in dst->sigma meanwhile, not a number where it says
 * nothing or the pixel is hidden. */
static rx_status sigma_from_map(const rx_background_params *par, const source *src, const sep_bkg *back,
                                rx_background *dst, rx_error *err)
{
    size_t n = (size_t)dst->width * (size_t)dst->height;
    if (src->weight_type == RX_WEIGHT_MAP_RMS) {
        memcpy(dst->sigma, src->weight, n * sizeof(float));
        return RX_OK;
    }
    for (size_t i = 0; i < n; i++) {
        float w = is_hidden(src, i) ? 0.0f : src->weight[i];
        bool usable = isfinite(w) && w > 0.0f;
        dst->sigma[i] = !usable ? NAN : src->weight_type == RX_WEIGHT_MAP_VAR ? w : 1.0f / w;
    }
    double factor = 1.0;
    rx_status status = weight_scale(par, dst->sigma, back, &factor, err);
    if (status != RX_OK)
        return status;
    if (par->no_rescale) {
        dst->global_sigma /= factor;
        factor = 1.0;
    }
    for (size_t i = 0; i < n; i++)
        dst->sigma[i] = isnan(dst->sigma[i]) ? 0.0f : (float)(factor * sqrt(dst->sigma[i]));
    return RX_OK;
}

static void fill_constant(float *values, size_t n, double value)
{
    for (size_t i = 0; i < n; i++)
        values[i] = (float)value;
}

/* No noise where there is no pixel, some noise where there is one. */
static void finish_sigma(const source *src, size_t from, size_t to, rx_background *dst)
{
    for (size_t i = from; i < to; i++) {
        if (src->mask != NULL && (src->mask[i] & src->mask_bits) != 0)
            dst->sigma[i] = 0.0f;
        else if (!(dst->sigma[i] > 0.0f) || !isfinite(dst->sigma[i]))
            dst->sigma[i] = (float)dst->global_sigma;
    }
}

/* The splines' values row by row; sigma only where no map says it. */
static rx_status fill_rows(const rx_background_params *par, const source *src, const sep_bkg *back,
                           int own_sigma, rx_background *dst, rx_error *err)
{
    const size_t width = (size_t)dst->width;
    int failed = 0;
#pragma omp parallel for schedule(static) num_threads(par->nthreads > 0 ? par->nthreads : 1)                 \
    reduction(|                                                                                              \
              : failed)
    for (int y = 0; y < dst->height; y++) {
        const size_t row = (size_t)y * width;
        if (par->manual)
            fill_constant(dst->level + row, width, par->manual_value);
        else
            failed |= sep_bkg_line(back, y, dst->level + row, SEP_TFLOAT);
        if (own_sigma)
            failed |= sep_bkg_rmsline(back, y, dst->sigma + row, SEP_TFLOAT);
        finish_sigma(src, row, row + width, dst);
    }
    return failed ? rx_error_memory(err, width * sizeof(float)) : RX_OK;
}

static rx_status fill_maps(const rx_background_params *par, const source *src, rx_background *dst,
                           rx_error *err)
{
    sep_bkg *back = NULL;
    size_t good = 0;
    const int map = src->weight != NULL && src->weight_type >= RX_WEIGHT_MAP_RMS;
    rx_status status = rx_mesh_measure(par, dst->width, dst->height, src->pixels, src->mask, src->mask_bits,
                                       &back, &good, err);
    if (status != RX_OK)
        goto exit;
    if (good == 0) {
        fill_constant(dst->level, (size_t)dst->width * (size_t)dst->height, dst->global_level);
        finish_sigma(src, 0, (size_t)dst->width * (size_t)dst->height, dst);
        goto exit;
    }
    dst->global_level = par->manual ? par->manual_value : back->global;
    dst->global_sigma = back->globalrms > 0.0f ? back->globalrms : 1.0;
    if (map)
        status = sigma_from_map(par, src, back, dst, err);
    if (status == RX_OK)
        status = fill_rows(par, src, back, !map, dst, err);
exit:
    rx_mesh_free(back);
    return status;
}

rx_status rx_background_measure(const rx_background_params *par, int width, int height, const float *pixels,
                                const uint8_t *mask, int mask_bits, const float *weight,
                                rx_weight_type weight_type, rx_background **dst, rx_error *err)
{
    size_t n = (size_t)width * (size_t)height;
    const source src = {
        .pixels = pixels, .mask = mask, .mask_bits = mask_bits, .weight = weight, .weight_type = weight_type};
    rx_background *back = NULL;
    rx_status status = RX_OK;
    *dst = NULL;
    if (par->mesh_width < 1 || par->mesh_height < 1 || par->filter_width < 1 || par->filter_height < 1)
        return rx_error_set(err, RX_USAGE, "BACK_SIZE and BACK_FILTERSIZE must be at least 1");

    back = RX_NEW(rx_background, 1);
    if (back == NULL)
        return rx_error_memory(err, sizeof *back);
    back->width = width;
    back->height = height;
    back->global_sigma = 1.0;
    back->global_level = par->manual ? par->manual_value : 0.0;
    back->level = rx_alloc_filled(n, sizeof *back->level, par->nthreads);
    back->sigma = rx_alloc_filled(n, sizeof *back->sigma, par->nthreads);
    if (back->level == NULL || back->sigma == NULL) {
        status = rx_error_memory(err, n * sizeof(float));
        goto exit;
    }
    status = fill_maps(par, &src, back, err);
    if (status != RX_OK)
        goto exit;
    *dst = back;
    back = NULL;
exit:
    rx_background_free(back);
    return status;
}
