/* The detection filter on planes, for what sep does not hand out: the pixels above the
 * threshold that are in no source, and the noise that SExtractor thresholds against. */
#ifndef RX_DETECT_FILTER_H
#define RX_DETECT_FILTER_H

#include <stdint.h>

#include "base/error.h"

/* A kernel as sep uses it: divided by the sum of its absolute values. NULL values: no filter. */
typedef struct rx_filter {
    int width, height;
    float *values; /* [height][width] */
    double sum;    /* of the absolute values before */
} rx_filter;

rx_status rx_filter_new(const float *values, int width, int height, rx_filter *dst, rx_error *err);
void rx_filter_free(rx_filter *kernel);

/* What a filter of n values leaves of the noise of independent pixels, sqrt(sum k^2) / sum |k|; 1 without
 * one. */
double rx_filter_norm(const float *values, int n);

/* dst = src filtered, [height][width]: correlation with the kernel, zero outside the image, summed row by row
 * of the kernel. */
void rx_filter_plane(const rx_filter *kernel, const float *src, int width, int height, int nthreads,
                     float *dst);

/* Rows of the noise of pixels from `first` on, as many as are asked for, of a tile of so many. */
typedef struct rx_noise_rows {
    int width, height, first;
    const float *sigma;
    const uint8_t *hidden; /* 0 or 1 */
} rx_noise_rows;

/* Row y: line = sqrt(sum |k| sigma^2 / sum |k|). Hidden pixels stay out of both sums and get FLT_MAX; beyond the
 * border is sigma 0, as in SExtractor, where the filtered image is lower too. Rows: those of the tile that
 * the kernel reaches from y. sums[width]: scratch. */
void rx_filter_sigma(const rx_filter *kernel, const rx_noise_rows *rows, int y, double *sums, float *line);

#endif
