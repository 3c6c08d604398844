/* Tile and background to data, weights and noise in units of the pedestal. */
#include "restore/scene.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"

enum { SAMPLE = 65536 };
static const float LARGEST =
    1e7f; /* far above any signal-to-noise; single precision holds the sky beside it */
static const double SIGMA_HIGH = 3;   /* pedestal from at most that many median sigmas */
static const double SIGMA_LOW = 1e-3; /* smallest sigma believed, medians */
static const double NOISELESS = 1e-3; /* sigma of a tile without noise, share of its peak */

size_t rx_scene_mask(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                     uint8_t *mask)
{
    const int honoured = RX_MASK_BAD | RX_MASK_WEIGHT | (par->mask_saturated ? RX_MASK_SATURATED : 0);
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    size_t good = 0;
    for (size_t k = 0; k < n; k++) {
        int bits = tile->mask[k] & honoured;
        if (bits == 0 && !isfinite(tile->pixels[k] - background->level[k]))
            bits = RX_MASK_BAD;
        mask[k] = (uint8_t)bits;
        good += bits == 0;
    }
    return good;
}

static int usable(float sigma)
{
    return isfinite(sigma) && sigma > 0;
}

/* Median and 98 % quantile of sigma over good pixels (an even sample of them), ADU; the
 * largest |value| stands in where nothing has a sigma. */
static rx_status measure_sigma(const rx_scene *scene, const rx_tile *tile, const rx_background *background,
                               double *median, double *high, rx_error *err)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height, step = scene->good / SAMPLE + 1;
    double *values = RX_NEW(double, SAMPLE + 1), peak = 0;
    if (values == NULL)
        return rx_error_memory(err, SAMPLE * sizeof *values);
    size_t count = 0, seen = 0;
    for (size_t k = 0; k < n; k++) {
        if (scene->mask[k] != 0)
            continue;
        peak = fmax(peak, fabs((double)tile->pixels[k] - background->level[k]));
        if (seen++ % step == 0 && usable(background->sigma[k]))
            values[count++] = background->sigma[k];
    }
    *median = rx_median(values, count);
    *high = rx_quantile(values, count, 0.98);
    free(values);
    if (count == 0)
        *median = *high = peak > 0 ? NOISELESS * peak : 1;
    return RX_OK;
}

static double choose_pedestal(const rx_restore_params *par, double median, double high)
{
    return fmax(par->rl_pedestal, 1) * fmin(high, SIGMA_HIGH * median);
}

static void set_pixels(rx_scene *scene, const rx_tile *tile, const rx_background *background, double median)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    for (size_t k = 0; k < n; k++) {
        scene->variance[k] = 1;
        if (scene->mask[k] != 0)
            continue;
        const double value = ((double)tile->pixels[k] - background->level[k]) / scene->pedestal + 1;
        scene->data[k] = value < 0 ? 0 : value > LARGEST ? LARGEST : (float)value;
        scene->peak = fmaxf(scene->peak, scene->data[k]);
        const double sigma =
            usable(background->sigma[k]) ? fmax(background->sigma[k] / median, SIGMA_LOW) : 1;
        scene->weight[k] = sigma > 1 ? (float)(1 / (sigma * sigma)) : 1;
        scene->variance[k] = (float)(sigma * sigma * scene->sigma * scene->sigma);
    }
}

rx_status rx_scene_new(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                       rx_scene **dst, rx_error *err)
{
    *dst = NULL;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_scene *scene = RX_NEW(rx_scene, 1);
    if (scene == NULL)
        return rx_error_memory(err, sizeof *scene);
    scene->width = tile->width;
    scene->height = tile->height;
    scene->nthreads = par->nthreads < 1 ? 1 : par->nthreads;
    scene->data = RX_NEW(float, n);
    scene->weight = RX_NEW(float, n);
    scene->variance = RX_NEW(float, n);
    scene->mask = RX_NEW(uint8_t, n);
    rx_status status = RX_OK;
    if (scene->data == NULL || scene->weight == NULL || scene->variance == NULL || scene->mask == NULL) {
        status = rx_error_memory(err, 3 * n * sizeof(float));
        goto exit;
    }
    scene->good = rx_scene_mask(par, tile, background, scene->mask);
    double median = 1, high = 1;
    if ((status = measure_sigma(scene, tile, background, &median, &high, err)) != RX_OK)
        goto exit;
    scene->pedestal = choose_pedestal(par, median, high);
    scene->sigma = median / scene->pedestal;
    scene->photon = tile->gain > 0 && isfinite(tile->gain) ? 1 / (tile->gain * scene->pedestal) : 0;
    set_pixels(scene, tile, background, median);
exit:
    if (status != RX_OK) {
        rx_scene_free(scene);
        return status;
    }
    *dst = scene;
    return RX_OK;
}

void rx_scene_free(rx_scene *scene)
{
    if (scene == NULL)
        return;
    free(scene->data);
    free(scene->weight);
    free(scene->variance);
    free(scene->mask);
    free(scene);
}
