/* An image on another grid, by Lanczos interpolation. */
#ifndef RX_PSF_RESAMPLE_H
#define RX_PSF_RESAMPLE_H

#include "base/error.h"

enum { RX_LANCZOS_MAX = 12 };

/* Windowed sinc (Lanczos): weights, sum 1, of the 2 order samples from the returned index on around `position`; a position
 * that is no number or beyond +-1e6 lies outside of every image. */
int rx_lanczos_weights(double position, int order, double weights[2 * RX_LANCZOS_MAX]);

/* An image on its own grid; (centre_x, centre_y) is the point that shall come to lie on the middle
 * of a pixel. With a box above 1 the pixels of dst are means over squares of that side (source pixels), where
 * those of src count as integrals over themselves: for a whole number the mean of as many, as in binning. */
typedef struct rx_psf_raster {
    const float *pixels; /* [height][width] */
    int width, height;
    double centre_x, centre_y, box;
} rx_psf_raster;

/* dst [size][size], size odd: src by Lanczos interpolation of that order (<= RX_LANCZOS_MAX) at centre + (i -
 * size / 2, j - size / 2) * step source pixels, 0 outside. Errors: memory. */
rx_status rx_psf_resample(const rx_psf_raster *src, double step, int order, double *dst, int size,
                          rx_error *err);

#endif
