/* What the sky level still lacks once sources are modelled: a background that was measured around sources
 * holds some of their wings. */
#ifndef RX_TEMPLATE_UNDERSKY_H
#define RX_TEMPLATE_UNDERSKY_H

#include "base/error.h"
#include "template/canvas.h"

/* canvas->data less the smooth part of data - model: in cells of about `cell` pixels the mean over pixels in
 * no segment, clipped at 3 of their sigmas until nothing more goes; cells with too few of them take the mean
 * of their neighbours; bilinear between the cells' centres. *mean: what was taken off on average. The same
 * for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_undersky_subtract(rx_canvas *canvas, const int32_t *segments, int cell, double *mean,
                               rx_error *err);

#endif
