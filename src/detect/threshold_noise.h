/* The noise that thresholds refer to where it varies, made a strip of rows at a time. */
#ifndef RX_DETECT_THRESHOLD_NOISE_H
#define RX_DETECT_THRESHOLD_NOISE_H

#include <stdint.h>

#include "data/map.h"
#include "detect/filter.h"

typedef struct rx_threshold_noise {
    int width, height;
    const rx_map *noise; /* of a pixel */
    const float *pixels; /* hidden where they are not finite */
    const uint8_t *mask; /* NULL: nothing is hidden */
    int mask_bits;       /* which bits hide a pixel */
    const rx_filter *kernel;
} rx_threshold_noise;

/* Planes of a strip; zero to begin with. */
typedef struct rx_noise_strip {
    rx_noise_rows rows; /* noise of pixels, hidden ones too */
    float *sigma;       /* [width] the same after the filter, of the row asked for */
    float *own;
    uint8_t *hidden;
    double *sums;
} rx_noise_strip;

/* Room for strips of so many rows; 0 without memory. Free with rx_noise_strip_free(), also then. */
int rx_noise_strip_new(const rx_threshold_noise *noise, int rows, rx_noise_strip *dst);
void rx_noise_strip_free(rx_noise_strip *strip);

/* The noise of the rows y0 <= y < y1. */
void rx_noise_strip_make(const rx_threshold_noise *noise, int y0, int y1, rx_noise_strip *strip);

/* strip->sigma of row y, which is one of these (rx_filter_sigma()). */
void rx_noise_strip_filter(const rx_threshold_noise *noise, int y, rx_noise_strip *strip);

/* Noise of pixels of row y. */
const float *rx_noise_strip_row(const rx_noise_strip *strip, int y);

#endif
