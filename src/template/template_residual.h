/* What the models leave of the image, seen through a filter, and how much of it is noise. */
#ifndef RX_TEMPLATE_TEMPLATE_RESIDUAL_H
#define RX_TEMPLATE_TEMPLATE_RESIDUAL_H

#include <stdint.h>

#include "base/error.h"
#include "template/crowd.h"
#include "template/fit_image.h"

/* r = data - model at visible pixels (weight > 0), 0 elsewhere
 * sigma^2 = grain^2 / weight + (model_error L)^2, L the largest light of the models, pixels - level - r and at
 * least 0, in the square of 2 reach + 1 pixels around, hidden pixels left out */
typedef struct rx_template_residual {
    rx_fit_image *image;
    const float *pixels;      /* [height][width] ADU, of the tile */
    rx_map level;             /* ADU */
    int reach;                /* pixels */
    double model_error;       /* relative */
    double crowd_error;       /* the same in a crowd */
    const rx_crowding *crowd; /* NULL: none */
    double grain;             /* noise of filtered pixels over that of independent ones; 1 for those */
    const float *filter;      /* [side][side], sum of the absolute values 1 */
    int side;                 /* odd */
    double threshold;         /* in units of the noise; 0: none */
    int nthreads;
} rx_template_residual;

/* At visible pixels filtered = sum k r, row by row of the filter, and noise = sqrt(sum |k| sigma^2 / sum
 * |k|), the sums over visible pixels; beyond the border all is 0. Where filtered is below the threshold for the least sigma
 * around, noise may be that least. mask = 1 at the others, with filtered and
 * noise 0. All [to - from][width], of the rows from <= y < to. Errors: RX_SYSTEM. */
rx_status rx_template_residual_filter(const rx_template_residual *of, int from, int to, float *filtered,
                                      float *noise, uint8_t *mask, rx_error *err);

/* A visible pixel before the filter. */
typedef struct rx_template_residual_pixel {
    int x, y;            /* given */
    double light, sigma; /* found: L and sigma */
    float weight;        /* of the image */
} rx_template_residual_pixel;

/* Errors: RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_template_residual_at(const rx_template_residual *of, rx_template_residual_pixel *spots, int n,
                                  rx_error *err);

#endif
