/* Sky level and noise: the meshes' splines, weights and odd tiles. */
#include "detect/background.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "data/map.h"
#include "detect/libsep.h"
#include "detect/mesh.h"
#include "num/convolve.h"
#include "num/stats.h"

/* Median over the meshes of (rms of the image) / sqrt(variance of the map); 1 when there is none. */
static rx_status weight_scale(const rx_background_params *par, const float *variance, const sep_bkg *back,
                              double *factor, rx_error *err)
{
    sep_bkg *meshes = NULL;
    double *ratio = NULL;
    size_t n = 0, good;
    int measured;
    const rx_image image = {.width = (int)back->w, .height = (int)back->h, .pixels = variance};
    rx_status status;
    RX_TRY_EXIT(rx_mesh_measure(par, &image, RX_MESH_MODE, &meshes, &good, &measured, err));
    ratio = RX_NEW(double, (size_t)meshes->n);
    if (ratio == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)meshes->n * sizeof(double)));
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
static rx_status sigma_from_map(const rx_background_params *par, const rx_image *src, const sep_bkg *back,
                                rx_background *dst, rx_error *err)
{
    size_t n = (size_t)dst->width * (size_t)dst->height;
    if (src->weight_type == RX_WEIGHT_MAP_RMS) {
        memcpy(dst->sigma, src->weight, n * sizeof(float));
        return RX_OK;
    }
    for (size_t i = 0; i < n; i++) {
        const bool hidden = rx_image_hides(src, i) || !isfinite(src->pixels[i]);
        float w = hidden ? 0.0f : src->weight[i];
        bool usable = isfinite(w) && w > 0.0f;
        dst->sigma[i] = !usable ? NAN : src->weight_type == RX_WEIGHT_MAP_VAR ? w : 1.0f / w;
    }
    double factor = 1.0;
    RX_TRY(weight_scale(par, dst->sigma, back, &factor, err));
    if (par->no_rescale) {
        dst->global_sigma /= factor;
        factor = 1.0;
    }
    for (size_t i = 0; i < n; i++)
        dst->sigma[i] = isnan(dst->sigma[i]) ? 0.0f : (float)(factor * sqrt(dst->sigma[i]));
    return RX_OK;
}

/* A surface of splines over one of the two grids of `mesh`. */
static rx_status join(const rx_background_params *par, const sep_bkg *mesh, const float *values,
                      const float *derivatives, rx_splines *dst, rx_error *err)
{
    const rx_spline_grid grid = {.mesh_width = (int)mesh->bw,
                                 .mesh_height = (int)mesh->bh,
                                 .nx = (int)mesh->nx,
                                 .ny = (int)mesh->ny,
                                 .values = values,
                                 .derivatives = derivatives};
    return rx_splines_new(&grid, (int)mesh->w, (int)mesh->h, par->nthreads, dst, err);
}

/* The noise as a plane, where every pixel has its own: `own`, in dst->sigma already, what a map says. No
 * noise where there is no pixel, some noise where there is one. */
static void finish_sigma(const rx_background_params *par, const rx_image *src, int own, rx_background *dst)
{
    const size_t width = (size_t)dst->width;
#pragma omp parallel for schedule(static) num_threads(par->nthreads > 0 ? par->nthreads : 1)
    for (int y = 0; y < dst->height; y++) {
        const size_t row = (size_t)y * width;
        float *sigma = dst->sigma + row;
        if (!own)
            rx_splines_row(&dst->sigmas, y, 0, dst->width, sigma);
        for (size_t x = 0; x < width; x++) {
            if (rx_image_hides(src, row + x))
                sigma[x] = 0.0f;
            else if (!(sigma[x] > 0.0f) || !isfinite(sigma[x]))
                sigma[x] = dst->fallback_sigma;
        }
    }
}

/* A weight map makes thresholds and errors ask every pixel for its own noise. */
static rx_status fill_sigma(const rx_background_params *par, const rx_image *src, const sep_bkg *mesh,
                            size_t good, rx_background *dst, rx_error *err)
{
    const int own = good > 0 && src->weight != NULL && src->weight_type >= RX_WEIGHT_MAP_RMS;
    const size_t n = (size_t)dst->width * (size_t)dst->height;
    rx_status status = RX_OK;
    if (good > 0 && !own)
        status = join(par, mesh, mesh->sigma, mesh->dsigma, &dst->sigmas, err);
    if (status != RX_OK || src->weight_type == RX_WEIGHT_NONE)
        return status;
    dst->sigma = rx_alloc_filled(n, sizeof *dst->sigma, par->nthreads);
    if (dst->sigma == NULL)
        return rx_error_memory(err, n * sizeof *dst->sigma);
    if (own)
        status = sigma_from_map(par, src, mesh, dst, err);
    dst->fallback_sigma = (float)dst->global_sigma;
    if (status == RX_OK)
        finish_sigma(par, src, own, dst);
    return status;
}

enum { REACH = 2 };                                    /* beside what stands out, pixels */
static const double FILTER_FWHM = 2.0 * RX_FWHM_SIGMA; /* of the Gaussian that shows sources, pixels */
static const float STANDS_OUT = 3.0f;                  /* sigmas of the filtered image */

/* What stands out within REACH of row y, in x and in y, is set in dst. */
RX_SIMD static void spread_row(const uint8_t *out, int width, int height, int y, uint8_t *dst)
{
    for (int v = rx_max_int(y - REACH, 0); v <= rx_min_int(y + REACH, height - 1); v++)
        for (int d = -REACH; d <= REACH; d++) {
            const uint8_t *src = out + (size_t)v * (size_t)width;
#pragma omp simd
            for (int x = rx_max_int(-d, 0); x < rx_min_int(width, width - d); x++)
                dst[x] |= src[x + d];
        }
}

/* dst[height][width]: 0 where a pixel is good and far from sources. */
static rx_status hide_sources(const rx_background_params *par, const rx_image *src, double level,
                              uint8_t *dst, rx_error *err)
{
    const int width = src->width, height = src->height, nthreads = par->nthreads > 0 ? par->nthreads : 1;
    const size_t n = (size_t)width * (size_t)height;
    const rx_background_params once = {.mesh_width = par->mesh_width,
                                       .mesh_height = par->mesh_height,
                                       .filter_width = par->filter_width,
                                       .filter_height = par->filter_height,
                                       .nthreads = nthreads};
    rx_background *sky = NULL;
    rx_status status = RX_OK;
    float *filtered = RX_NEW(float, n);
    uint8_t *out = RX_NEW(uint8_t, n);
    if (filtered == NULL || out == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * (sizeof *filtered + sizeof *out)));
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (size_t k = 0; k < n; k++) {
        const int full =
            src->mask != NULL && (src->mask[k] & RX_MASK_SATURATED) != 0; /* its value decides nothing */
        dst[k] = full || rx_image_hides(src, k) || !isfinite(src->pixels[k]);
        filtered[k] = dst[k] ? 0.0f : (float)((double)src->pixels[k] - level);
    }
    RX_TRY_EXIT(rx_gauss_masked(width, height, FILTER_FWHM, dst, nthreads, filtered, err));
    const rx_image image = {.width = width, .height = height, .pixels = filtered, .mask = dst, .hide = 1};
    RX_TRY_EXIT(rx_background_measure(&once, &image, &sky, err));
    const rx_map levels = rx_background_level(sky), sigmas = rx_background_noise(sky);
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x += RX_MAP_PIECE) {
            float level_room[RX_MAP_PIECE], sigma_room[RX_MAP_PIECE];
            const int count = rx_map_piece(x, width);
            const size_t k = (size_t)y * (size_t)width + (size_t)x;
            const float *low = rx_map_row(&levels, y, x, count, level_room),
                        *sigma = rx_map_row(&sigmas, y, x, count, sigma_room);
            for (int i = 0; i < count; i++)
                out[k + (size_t)i] = (fabsf(filtered[k + (size_t)i] - low[i]) > STANDS_OUT * sigma[i]) &
                                     (dst[k + (size_t)i] == 0);
        }
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < height; y++)
        spread_row(out, width, height, y, dst + (size_t)y * (size_t)width);
exit:
    rx_background_free(sky);
    free(filtered);
    free(out);
    return status;
}

/* The meshes, in the second pass of what sources leave, where that is enough. *good: pixels that are not hidden. */
static rx_status measure_meshes(const rx_background_params *par, const rx_image *src, sep_bkg **dst,
                                size_t *good, int *passes, rx_error *err)
{
    const size_t n = (size_t)src->width * (size_t)src->height;
    int measured;
    RX_TRY(rx_mesh_measure(par, src, RX_MESH_MODE, dst, good, &measured, err));
    *passes = 1;
    if (par->passes < 2 || *good == 0)
        return RX_OK;
    rx_image free_sky = *src;
    sep_bkg *second = NULL;
    size_t left;
    uint8_t *mask = RX_NEW(uint8_t, n);
    rx_status status = mask == NULL ? rx_error_memory(err, n) : RX_OK;
    free_sky.mask = mask;
    free_sky.hide = 1;
    if (status == RX_OK)
        status = hide_sources(par, src, (double)(*dst)->global, mask, err);
    if (status == RX_OK)
        status = rx_mesh_measure(par, &free_sky, RX_MESH_MEAN, &second, &left, &measured, err);
    if (status == RX_OK && measured > 0) {
        sep_bkg *first = *dst;
        *dst = second;
        second = first;
        *passes = 2;
    }
    rx_mesh_free(second);
    free(mask);
    return status;
}

/* Is nothing known of the noise: neither from the meshes nor from the user? */
static int has_no_noise(const rx_background_params *par, const rx_image *src, const sep_bkg *mesh)
{
    const int given =
        src->weight_type == RX_WEIGHT_MAP_RMS || (src->weight_type > RX_WEIGHT_MAP_RMS && par->no_rescale);
    for (int64_t i = 0; i < mesh->n && !given; i++)
        if (mesh->sigma[i] > 0.0f)
            return 0;
    return !given;
}

static rx_status fill_maps(const rx_background_params *par, const rx_image *src, rx_background *dst,
                           rx_error *err)
{
    sep_bkg *mesh = NULL;
    size_t good = 0;
    rx_status status;
    RX_TRY_EXIT(measure_meshes(par, src, &mesh, &good, &dst->passes, err));
    if (good > 0) {
        dst->global_level = par->manual ? dst->global_level : mesh->global;
        dst->global_sigma = mesh->globalrms;
    }
    dst->constant = good == 0 || has_no_noise(par, src, mesh);
    dst->levels.value = (float)dst->global_level;
    dst->fallback_sigma = (float)dst->global_sigma;
    if (good > 0 && !par->manual)
        status = join(par, mesh, mesh->back, mesh->dback, &dst->levels, err);
    if (status == RX_OK)
        status = fill_sigma(par, src, mesh, good, dst, err);
exit:
    rx_mesh_free(mesh);
    return status;
}

rx_status rx_background_measure(const rx_background_params *par, const rx_image *image, rx_background **dst,
                                rx_error *err)
{
    rx_background *back = NULL;
    rx_status status = RX_OK;
    *dst = NULL;
    if (par->mesh_width < 1 || par->mesh_height < 1 || par->filter_width < 1 || par->filter_height < 1)
        return rx_error_set(err, RX_USAGE, "BACK_SIZE and BACK_FILTERSIZE must be at least 1");

    RX_TRY(RX_MAKE(back, 1, err));
    back->width = image->width;
    back->height = image->height;
    back->global_sigma = 1.0;
    back->global_level = par->manual ? par->manual_value : 0.0;
    back->mask = image->mask;
    back->mask_bits = image->hide;
    RX_TRY_EXIT(fill_maps(par, image, back, err));
    *dst = back;
    back = NULL;
exit:
    rx_background_free(back);
    return status;
}
