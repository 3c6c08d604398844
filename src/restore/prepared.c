/* Tile and background to data, weights and noise in units of the pedestal. */
#include "restore/prepared.h"

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

size_t rx_prepared_mask(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                        uint8_t *mask)
{
    const int honoured = RX_MASK_BAD | RX_MASK_WEIGHT | (par->mask_saturated ? RX_MASK_SATURATED : 0);
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    size_t hidden = 0;
#pragma omp parallel for schedule(static) num_threads(par->nthreads > 0 ? par->nthreads : 1) reduction(+ : hidden)
    for (size_t k = 0; k < n; k++) {
        int bits = tile->mask[k] & honoured;
        if (bits == 0 && !isfinite(tile->pixels[k] - background->level[k]))
            bits = RX_MASK_BAD;
        if (bits != 0) { /* most of the plane is never touched */
            mask[k] = (uint8_t)bits;
            hidden++;
        }
    }
    return n - hidden;
}

static int usable(float sigma)
{
    return isfinite(sigma) && sigma > 0;
}

/* Median and 98 % quantile of sigma over good pixels (an even sample of them), ADU; the
 * largest |value| stands in where nothing has a sigma. */
static rx_status measure_sigma(const rx_prepared *prepared, const rx_tile *tile,
                               const rx_background *background, double *median, double *high, rx_error *err)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height, step = prepared->good / SAMPLE + 1;
    double *values = RX_NEW(double, SAMPLE + 1), peak = 0;
    if (values == NULL)
        return rx_error_memory(err, SAMPLE * sizeof *values);
    size_t count = 0, seen = 0;
    for (size_t k = 0; k < n; k++) {
        if (prepared->mask[k] != 0)
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

static void set_pixels(rx_prepared *prepared, const rx_tile *tile, const rx_background *background,
                       double median)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    for (size_t k = 0; k < n; k++) {
        prepared->variance[k] = 1;
        if (prepared->mask[k] != 0)
            continue;
        const double value = ((double)tile->pixels[k] - background->level[k]) / prepared->pedestal + 1;
        prepared->data[k] = value < 0 ? 0 : value > LARGEST ? LARGEST : (float)value;
        prepared->peak = fmaxf(prepared->peak, prepared->data[k]);
        const double sigma =
            usable(background->sigma[k]) ? fmax(background->sigma[k] / median, SIGMA_LOW) : 1;
        prepared->weight[k] = sigma > 1 ? (float)(1 / (sigma * sigma)) : 1;
        prepared->variance[k] = (float)(sigma * sigma * prepared->sigma * prepared->sigma);
    }
}

rx_status rx_prepared_new(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                          rx_prepared **dst, rx_error *err)
{
    *dst = NULL;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_prepared *prepared = RX_NEW(rx_prepared, 1);
    if (prepared == NULL)
        return rx_error_memory(err, sizeof *prepared);
    prepared->width = tile->width;
    prepared->height = tile->height;
    prepared->nthreads = par->nthreads < 1 ? 1 : par->nthreads;
    prepared->data = RX_NEW(float, n);
    prepared->weight = RX_NEW(float, n);
    prepared->variance = RX_NEW(float, n);
    prepared->mask = RX_NEW(uint8_t, n);
    rx_status status = RX_OK;
    if (prepared->data == NULL || prepared->weight == NULL || prepared->variance == NULL ||
        prepared->mask == NULL) {
        status = rx_error_memory(err, 3 * n * sizeof(float));
        goto exit;
    }
    prepared->good = rx_prepared_mask(par, tile, background, prepared->mask);
    double median = 1, high = 1;
    if ((status = measure_sigma(prepared, tile, background, &median, &high, err)) != RX_OK)
        goto exit;
    prepared->pedestal = choose_pedestal(par, median, high);
    prepared->sigma = median / prepared->pedestal;
    prepared->photon = tile->gain > 0 && isfinite(tile->gain) ? 1 / (tile->gain * prepared->pedestal) : 0;
    set_pixels(prepared, tile, background, median);
exit:
    if (status != RX_OK) {
        rx_prepared_free(prepared);
        return status;
    }
    *dst = prepared;
    return RX_OK;
}

void rx_prepared_free(rx_prepared *prepared)
{
    if (prepared == NULL)
        return;
    free(prepared->data);
    free(prepared->weight);
    free(prepared->variance);
    free(prepared->mask);
    free(prepared);
}
