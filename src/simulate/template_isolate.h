/* Cutting the object out of a cut-out. */
#ifndef RX_SIMULATE_TEMPLATE_ISOLATE_H
#define RX_SIMULATE_TEMPLATE_ISOLATE_H

#include "simulate/templates.h"

/* The object of pixels [height][width] (mask: not 0 = bad, may be NULL): what is connected to the brightest
 * pixel of the image's middle half.
 *
 * Sky: median of the border, an eighth of the shorter side and at least 3 pixels wide (or `sky`, where it is
 * not NAN); noise: 1.4826 times the median absolute deviation there. The image smoothed by a Gaussian of FWHM
 * 6 pixels, with the noise that it has itself in the border (so that correlated noise counts as what it is),
 * is cut at 2.5 sigma; 8-connected pixels are the object, with a seam of a pixel around them for its wings.
 * Inside, pixels stay as they are where the image smoothed by 3 pixels is above 5 of its sigma; above 2.5
 * they are those of that image, else those of the one smoothed by 6. Nothing is negative.
 *
 * Fills pixels (cropped to the object, sum 1), width, height, x, y, radius, ratio, angle, snr of dst;
 * dst->pixels stays NULL when there is no object of more than 9 pixels. Errors: RX_SYSTEM memory. */
rx_status rx_template_isolate(const float *pixels, const unsigned char *mask, int width, int height,
                              double sky, rx_template *dst, rx_error *err);

#endif
