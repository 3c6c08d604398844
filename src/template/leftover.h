/* What the models leave of the image, seen through a filter, and how much of it is noise. */
#ifndef RX_TEMPLATE_LEFTOVER_H
#define RX_TEMPLATE_LEFTOVER_H

#include <stdint.h>

#include "base/error.h"
#include "template/template.h"

/* r = data - model at visible pixels (weight > 0), 0 elsewhere
 * sigma^2 = 1 / weight + (model_error L)^2, L the largest light of the models, pixels - level - r and at
 * least 0, in the square of 2 reach + 1 pixels around, hidden pixels left out */
typedef struct rx_leftover {
    const rx_tphot_state *state;
    const float *pixels; /* [height][width] ADU, of the tile */
    rx_map level;        /* ADU */
    int reach;           /* pixels */
    double model_error;  /* relative */
    const float *filter; /* [side][side], sum of the absolute values 1 */
    int side;            /* odd */
    int nthreads;
} rx_leftover;

/* At visible pixels filtered = sum k r, row by row of the filter, and noise = sqrt(sum |k| sigma^2 / sum
 * |k|), the sums over visible pixels; beyond the border all is 0. mask = 1 at the others, with filtered and
 * noise 0. All [height][width]. Errors: RX_SYSTEM. */
rx_status rx_leftover_filter(const rx_leftover *of, float *filtered, float *noise, uint8_t *mask,
                             rx_error *err);

/* L and sigma of a visible pixel. */
double rx_leftover_light(const rx_leftover *of, int x, int y);
double rx_leftover_sigma(const rx_leftover *of, int x, int y);

#endif
