/* Sky level and noise maps: sep does the meshes, this file the masks, weights and odd tiles. */
#include "detect/background.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "detect/libsep.h"
#include "num/stats.h"

/* A plane without masked values, and its mask as sep wants it. */
typedef struct plane {
    int width, height;
    float *values;
    uint8_t *hidden;
    size_t good;
} plane;

static rx_status fill_plane(plane *dst, const float *src, const uint8_t *mask, int mask_bits, rx_error *err)
{
    size_t n = (size_t)dst->width * (size_t)dst->height;
    if (dst->values == NULL)
        dst->values = RX_NEW(float, n);
    if (dst->hidden == NULL)
        dst->hidden = RX_NEW(uint8_t, n);
    if (dst->values == NULL || dst->hidden == NULL)
        return rx_error_memory(err, n * sizeof(float));
    dst->good = 0;
    for (size_t i = 0; i < n; i++) {
        bool hidden = (mask != NULL && (mask[i] & mask_bits) != 0) || !isfinite(src[i]);
        dst->hidden[i] = hidden;
        dst->values[i] = hidden ? 0.0f : src[i];
        dst->good += !hidden;
    }
    return RX_OK;
}

static rx_status measure_meshes(const rx_background_params *par, const plane *src, sep_bkg **dst,
                                rx_error *err)
{
    sep_image image = {.data = src->values,
                       .mask = src->hidden,
                       .dtype = SEP_TFLOAT,
                       .mdtype = SEP_TBYTE,
                       .w = src->width,
                       .h = src->height,
                       .noise_type = SEP_NOISE_NONE};
    int mesh_width = par->mesh_width < src->width ? par->mesh_width : src->width;
    int mesh_height = par->mesh_height < src->height ? par->mesh_height : src->height;
    int status = sep_background(&image, mesh_width, mesh_height, par->filter_width, par->filter_height,
                                par->filter_threshold, dst);
    if (status != 0)
        return rx_error_set(err, RX_SYSTEM,
                            "background: not enough memory for the meshes; use a larger BACK_SIZE");
    return RX_OK;
}

/* Median over the meshes of (rms of the image) / sqrt(variance of the map); 1 when there is none. */
static rx_status weight_scale(const rx_background_params *par, const plane *variance, const sep_bkg *back,
                              double *factor, rx_error *err)
{
    sep_bkg *meshes = NULL;
    double *ratio = NULL;
    rx_status status = measure_meshes(par, variance, &meshes, err);
    if (status != RX_OK)
        goto exit;
    ratio = RX_NEW(double, (size_t)meshes->n);
    if (ratio == NULL) {
        status = rx_error_memory(err, (size_t)meshes->n * sizeof(double));
        goto exit;
    }
    size_t n = 0;
    for (int i = 0; i < meshes->n; i++)
        if (meshes->back[i] > 0.0f && back->sigma[i] > 0.0f)
            ratio[n++] = back->sigma[i] / sqrt(meshes->back[i]);
    *factor = n > 0 ? rx_median(ratio, n) : 1.0;
exit:
    free(ratio);
    sep_bkg_free(meshes);
    return status;
}

/* sigma from a map of the user; `scratch` is overwritten with the map's variances. */
static rx_status sigma_from_map(const rx_background_params *par, const float *weight, rx_weight_type type,
                                const sep_bkg *back, plane *scratch, rx_background *dst, rx_error *err)
{
    size_t n = (size_t)dst->width * (size_t)dst->height;
    if (type == RX_WEIGHT_MAP_RMS) {
        memcpy(dst->sigma, weight, n * sizeof(float));
        return RX_OK;
    }
    for (size_t i = 0; i < n; i++) {
        float w = scratch->hidden[i] ? 0.0f : weight[i];
        bool usable = isfinite(w) && w > 0.0f;
        scratch->hidden[i] = !usable;
        scratch->values[i] = !usable ? 0.0f : type == RX_WEIGHT_MAP_VAR ? w : 1.0f / w;
    }
    double factor = 1.0;
    rx_status status = weight_scale(par, scratch, back, &factor, err);
    if (status != RX_OK)
        return status;
    if (par->no_rescale) {
        dst->global_sigma /= factor;
        factor = 1.0;
    }
    for (size_t i = 0; i < n; i++)
        dst->sigma[i] = (float)(factor * sqrt(scratch->values[i]));
    return RX_OK;
}

static void fill_constant(float *values, size_t n, double value)
{
    for (size_t i = 0; i < n; i++)
        values[i] = (float)value;
}

static rx_status fill_maps(const rx_background_params *par, plane *src, const float *weight,
                           rx_weight_type weight_type, rx_background *dst, rx_error *err)
{
    sep_bkg *back = NULL;
    size_t n = (size_t)dst->width * (size_t)dst->height;
    rx_status status = measure_meshes(par, src, &back, err);
    if (status != RX_OK)
        goto exit;
    dst->global_level = par->manual ? par->manual_value : sep_bkg_global(back);
    dst->global_sigma = sep_bkg_globalrms(back) > 0.0f ? sep_bkg_globalrms(back) : 1.0;
    int failed = sep_bkg_rmsarray(back, dst->sigma, SEP_TFLOAT);
    if (par->manual)
        fill_constant(dst->level, n, par->manual_value);
    else
        failed |= sep_bkg_array(back, dst->level, SEP_TFLOAT);
    if (failed) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    if (weight != NULL && weight_type >= RX_WEIGHT_MAP_RMS)
        status = sigma_from_map(par, weight, weight_type, back, src, dst, err);
exit:
    sep_bkg_free(back);
    return status;
}

/* No noise where there is no pixel, some noise where there is one. */
static void finish_sigma(rx_background *dst, const uint8_t *mask, int mask_bits)
{
    size_t n = (size_t)dst->width * (size_t)dst->height;
    for (size_t i = 0; i < n; i++) {
        if (mask != NULL && (mask[i] & mask_bits) != 0)
            dst->sigma[i] = 0.0f;
        else if (!isfinite(dst->sigma[i]) || dst->sigma[i] <= 0.0f)
            dst->sigma[i] = (float)dst->global_sigma;
    }
}

rx_status rx_background_measure(const rx_background_params *par, int width, int height, const float *pixels,
                                const uint8_t *mask, int mask_bits, const float *weight,
                                rx_weight_type weight_type, rx_background **dst, rx_error *err)
{
    size_t n = (size_t)width * (size_t)height;
    plane src = {.width = width, .height = height};
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
    back->level = RX_NEW(float, n);
    back->sigma = RX_NEW(float, n);
    if (back->level == NULL || back->sigma == NULL) {
        status = rx_error_memory(err, n * sizeof(float));
        goto exit;
    }
    status = fill_plane(&src, pixels, mask, mask_bits, err);
    if (status != RX_OK)
        goto exit;
    if (src.good > 0)
        status = fill_maps(par, &src, weight, weight_type, back, err);
    else
        fill_constant(back->level, n, back->global_level);
    if (status != RX_OK)
        goto exit;
    finish_sigma(back, mask, mask_bits);
    *dst = back;
    back = NULL;
exit:
    rx_background_free(back);
    free(src.values);
    free(src.hidden);
    return status;
}
