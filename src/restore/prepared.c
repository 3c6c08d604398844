/* An image to data, weights and noise in units of the pedestal. */
#include "restore/prepared.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/simd.h"
#include "data/map.h"
#include "num/stats.h"

enum { SAMPLE = 65536 };
static const double SIGMA_HIGH = 3;   /* pedestal from at most that many median sigmas */
static const double SIGMA_LOW = 1e-3; /* smallest sigma believed, medians */
static const double NOISELESS = 1e-3; /* sigma of a tile without noise, share of its peak */

/* Bits of n pixels; how many are hidden. */
static size_t mask_piece(const uint8_t *from, int hide, const float *pixels, const float *level, int n,
                         uint8_t *mask)
{
    size_t hidden = 0;
    for (int i = 0; i < n; i++) {
        int bits = from != NULL ? from[i] & hide : 0;
        if (bits == 0 && !isfinite(pixels[i] - level[i]))
            bits = RX_MASK_BAD;
        if (bits != 0) { /* most of the plane is never touched */
            mask[i] = (uint8_t)bits;
            hidden++;
        }
    }
    return hidden;
}

size_t rx_prepared_mask(const rx_image *image, int nthreads, uint8_t *mask)
{
    const rx_map level = rx_image_sky(image);
    size_t hidden = 0;
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1) reduction(+ : hidden)
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x += RX_MAP_PIECE) {
            float room[RX_MAP_PIECE];
            const int n = rx_map_piece(x, image->width);
            const size_t k = (size_t)y * (size_t)image->width + (size_t)x;
            hidden += mask_piece(image->mask != NULL ? image->mask + k : NULL, image->hide, image->pixels + k,
                                 rx_map_row(&level, y, x, n, room), n, mask + k);
        }
    return (size_t)image->width * (size_t)image->height - hidden;
}

static int usable(float sigma)
{
    return isfinite(sigma) && sigma > 0;
}

/* Sigmas of every step-th good pixel, ADU. */
typedef struct sample {
    double *values; /* [SAMPLE + 1] */
    size_t count, seen, step;
} sample;

static void sample_row(const rx_prepared *prepared, int y, int x, int n, sample *dst)
{
    float room[RX_MAP_PIECE];
    const uint8_t *mask = prepared->mask + (size_t)y * (size_t)prepared->width + (size_t)x;
    const float *sigma = rx_map_row(&prepared->image.noise, y, x, n, room);
    for (int i = 0; i < n; i++)
        if (mask[i] == 0 && dst->seen++ % dst->step == 0 && usable(sigma[i]))
            dst->values[dst->count++] = sigma[i];
}

double rx_prepared_noiseless(const rx_image *image, const uint8_t *mask)
{
    const rx_map level = rx_image_sky(image);
    double peak = 0;
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x++) {
            const size_t k = (size_t)y * (size_t)image->width + (size_t)x;
            if (mask[k] == 0)
                peak = fmax(peak, fabs((double)image->pixels[k] - rx_map_at(&level, x, y)));
        }
    return peak > 0 ? NOISELESS * peak : 1;
}

/* Median and 98 % quantile of sigma over good pixels (an even sample of them), ADU; the
 * largest |value| stands in where nothing has a sigma. */
static rx_status measure_sigma(const rx_prepared *prepared, double *median, double *high, rx_error *err)
{
    const int width = prepared->width;
    sample s = {.values = RX_NEW(double, SAMPLE + 1), .step = prepared->good / SAMPLE + 1};
    if (s.values == NULL)
        return rx_error_memory(err, SAMPLE * sizeof *s.values);
    for (int y = 0; y < prepared->height; y++)
        for (int x = 0; x < width; x += RX_MAP_PIECE)
            sample_row(prepared, y, x, rx_map_piece(x, width), &s);
    *median = rx_median(s.values, s.count);
    *high = rx_quantile(s.values, s.count, 0.98);
    free(s.values);
    if (s.count == 0)
        *median = *high = rx_prepared_noiseless(&prepared->image, prepared->mask);
    return RX_OK;
}

RX_SIMD static void make_data(int n, const float *restrict pixels, const float *level, double pedestal,
                              const uint8_t *restrict mask, float *dst)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const double value = ((double)pixels[i] - level[i]) / pedestal + 1;
        const float cut = value > RX_PREPARED_LARGEST ? RX_PREPARED_LARGEST : (float)value;
        dst[i] = (mask[i] != 0) | (value < 0) ? 0 : cut;
    }
}

const float *rx_prepared_data(const rx_prepared *prepared, int y, int x, int n, float *room)
{
    const size_t k = (size_t)y * (size_t)prepared->width + (size_t)x;
    if (prepared->data != NULL)
        return prepared->data + k;
    make_data(n, prepared->image.pixels + k, rx_map_row(&prepared->level, y, x, n, room), prepared->pedestal,
              prepared->mask + k, room);
    return room;
}

/* In medians; what has none counts as one. */
static inline double relative(float sigma, double median)
{
    const double share = sigma / median, held = share > SIGMA_LOW ? share : SIGMA_LOW;
    return (sigma > 0) & (sigma <= FLT_MAX) ? held : 1;
}

RX_SIMD static void make_weight(int n, const float *sigma, double median, const uint8_t *restrict mask,
                                float *dst)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const double s = relative(sigma[i], median);
        const float weight = s > 1 ? (float)(1 / (s * s)) : 1;
        dst[i] = mask[i] != 0 ? 0 : weight;
    }
}

const float *rx_prepared_weight(const rx_prepared *prepared, int y, int x, int n, float *room)
{
    const size_t k = (size_t)y * (size_t)prepared->width + (size_t)x;
    if (prepared->weight != NULL)
        return prepared->weight + k;
    make_weight(n, rx_map_row(&prepared->image.noise, y, x, n, room), prepared->median, prepared->mask + k,
                room);
    return room;
}

RX_SIMD static void make_variance(int n, const float *sigma, double median, double unit,
                                  const uint8_t *restrict mask, float *dst)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const double s = relative(sigma[i], median);
        dst[i] = mask[i] != 0 ? 1 : (float)(s * s * unit * unit);
    }
}

void rx_prepared_variance(const rx_prepared *prepared, int y, int x, int n, float *dst)
{
    make_variance(n, rx_map_row(&prepared->image.noise, y, x, n, dst), prepared->median, prepared->sigma,
                  prepared->mask + (size_t)y * (size_t)prepared->width + (size_t)x, dst);
}

static float largest(int n, const float *data)
{
    float most = 0;
    for (int i = 0; i < n; i++)
        most = data[i] > most ? data[i] : most;
    return most;
}

/* The planes that are kept, and the peak; they are made by the functions that make them when they are not. */
static void set_planes(rx_prepared *prepared, float *data, float *weight)
{
    float peak = 0;
#pragma omp parallel for schedule(static) num_threads(prepared->nthreads) reduction(max : peak)
    for (int y = 0; y < prepared->height; y++)
        for (int x = 0; x < prepared->width; x += RX_MAP_PIECE) {
            float room[RX_MAP_PIECE];
            const int n = rx_map_piece(x, prepared->width);
            const size_t k = (size_t)y * (size_t)prepared->width + (size_t)x;
            const float *values = rx_prepared_data(prepared, y, x, n, data != NULL ? data + k : room);
            const float most = largest(n, values);
            peak = most > peak ? most : peak;
            if (weight != NULL)
                (void)rx_prepared_weight(prepared, y, x, n, weight + k);
        }
    prepared->peak = peak;
    prepared->data = data;
    prepared->weight = weight;
}

rx_status rx_prepared_new(const rx_restore_params *par, const rx_image *image, rx_prepared **dst,
                          rx_error *err)
{
    *dst = NULL;
    const size_t n = (size_t)image->width * (size_t)image->height;
    rx_prepared *prepared;
    RX_TRY(RX_MAKE(prepared, 1, err));
    prepared->width = image->width;
    prepared->height = image->height;
    prepared->nthreads = par->nthreads < 1 ? 1 : par->nthreads;
    prepared->image = *image;
    prepared->level = rx_image_sky(image);
    prepared->mask = RX_NEW(uint8_t, n);
    float *data = n <= RX_PREPARED_KEPT ? RX_NEW(float, n) : NULL,
          *weight = n <= RX_PREPARED_KEPT ? RX_NEW(float, n) : NULL;
    rx_status status = RX_OK;
    if (prepared->mask == NULL || (n <= RX_PREPARED_KEPT && (data == NULL || weight == NULL)))
        RX_TRY_EXIT(rx_error_memory(err, 2 * n * sizeof(float)));
    prepared->good = rx_prepared_mask(image, prepared->nthreads, prepared->mask);
    double median = 1, high = 1;
    if ((status = measure_sigma(prepared, &median, &high, err)) != RX_OK)
        goto exit;
    prepared->pedestal = fmax(par->rl_pedestal, 1) * fmin(high, SIGMA_HIGH * median);
    prepared->median = median;
    prepared->sigma = median / prepared->pedestal;
    prepared->photon = image->gain > 0 && isfinite(image->gain) ? 1 / (image->gain * prepared->pedestal) : 0;
    set_planes(prepared, data, weight);
    data = weight = NULL;
exit:
    free(data);
    free(weight);
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
    free(prepared->mask);
    free(prepared);
}
