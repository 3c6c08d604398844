/* The image as one source sees it: neighbours and masked pixels hidden, or replaced by the pixel
 * mirrored at the centre (MASK_TYPE CORRECT). */
#ifndef RX_MEASURE_VIEW_H
#define RX_MEASURE_VIEW_H

#include <stdbool.h>

#include "measure/measure.h"

typedef struct rx_view {
    const rx_measure_image *image;
    const rx_sources *sources;
    rx_mask_type neighbours;
    int32_t segment; /* the source's own */
    double sky;      /* local background above the subtracted one, ADU (BACKPHOTO LOCAL) */
} rx_view;

typedef enum rx_seen { RX_SEEN_GOOD, RX_SEEN_NEIGHBOUR, RX_SEEN_MASKED } rx_seen;

/* What the pixel is; inside the image only. */
rx_seen rx_view_state(const rx_view *view, int x, int y);

/* Value (ADU) and noise variance of a pixel for sums about (cx, cy); returns what the pixel itself is.
 * Hidden: the mirrored pixel where that is good, else value 0 (and variance 0 with a weight map,
 * where SExtractor knows the pixel says nothing). */
rx_seen rx_view_pixel(const rx_view *view, int x, int y, double cx, double cy, double *value,
                      double *variance);

/* Factor on the sigma of a sum over `area` pixels, against independent pixels (noise law). */
double rx_view_noise_factor(const rx_view *view, double area);

/* Inclusive-exclusive pixel box clipped to the image; true when something was cut off. */
typedef struct rx_box {
    int x0, x1, y0, y1;
} rx_box;
bool rx_view_clip(const rx_view *view, rx_box *box);

/* The same for the box around a circle, SExtractor's rounding; any radius. */
bool rx_view_circle_box(const rx_view *view, double x, double y, double radius, rx_box *box);

#endif
