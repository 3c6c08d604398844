/* Sky level and noise maps through sep, weights turned into noise as SExtractor does. */
#ifndef RX_DETECT_BACKGROUND_H
#define RX_DETECT_BACKGROUND_H

#include "base/error.h"
#include "base/log.h"
#include "data/tile.h"

typedef struct rx_background_params {
    int mesh_width, mesh_height;     /* BACK_SIZE */
    int filter_width, filter_height; /* BACK_FILTERSIZE */
    double filter_threshold;         /* BACK_FILTTHRESH */
    int manual;                      /* BACK_TYPE MANUAL */
    double manual_value;             /* BACK_VALUE */
    int weight_gain;                 /* WEIGHT_GAIN */
} rx_background_params;

/* Background of `pixels` ([h][w]; masked ones, mask & mask_bits != 0, are ignored to the bit).
 * `weight` may be NULL. level and sigma are filled everywhere; sigma of masked pixels is 0. */
rx_status rx_background_measure(const rx_background_params *par, int width, int height, const float *pixels,
                                const uint8_t *mask, int mask_bits, const float *weight,
                                rx_weight_type weight_type, rx_background **dst, rx_error *err);

#endif
