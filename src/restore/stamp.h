/* PSF stamps [size][size], size odd, centre in pixel (size/2, size/2): what restorers need
 * to measure and make. */
#ifndef RX_RESTORE_STAMP_H
#define RX_RESTORE_STAMP_H

#include "base/error.h"
#include "data/psf.h"

/* Weights of the samples -1, 0, 1, 2 for a point at the fraction t, 0 <= t < 1, between 0 and 1:
 * cubic convolution with a = -1/2. */
void rx_stamp_cubic(double t, double w[4]);

/* Full width at half maximum, pixels: the diameter of the circle that has the area in which the
 * stamp, interpolated by cubic convolution (Keys 1981, IEEE Trans. ASSP 29, 1153), exceeds
 * half of its maximum; only the connected pixels around the maximum count. The pixel is part of
 * the PSF: 1.0 or a bit more for a single pixel. Good to 0.01 pixels for a Gaussian of FWHM > 2. NAN when the
 * stamp has no positive maximum. *ellipticity (may be NULL): 1 - b/a of that area. Errors: RX_SYSTEM without
 * memory. */
rx_status rx_stamp_fwhm(const float *stamp, int size, double *fwhm, double *ellipticity, rx_error *err);

/* Centroid relative to the centre, pixels, with a Gaussian weight of the given FWHM. */
void rx_stamp_centroid(const float *stamp, int size, double fwhm, double *dx, double *dy);

/* Move the content by (dx, dy), |.| <= 1, by cubic convolution, which leaves second moments as they are.
 * `work` holds size*size floats. */
void rx_stamp_shift(float *stamp, int size, double dx, double dy, float *work);

/* inside[j][i], [size + 1][size + 1]: the sum of the first j rows and i columns, from which follows how much of
 * the stamp lies on the tile near a border. */
void rx_stamp_inside(const float *stamp, int size, double *inside);

/* A constant PSF from a stamp, its FWHM and ellipticity measured; or the
 * Gaussian of RL_DENOISE (FWHM in pixels before the pixel's own width, <= 0: a single pixel).
 * Both are the caller's; without memory RX_SYSTEM and NULL. */
rx_status rx_stamp_psf(rx_psf_type type, const float *stamp, int size, rx_psf **dst, rx_error *err);
rx_psf *rx_stamp_gauss(double fwhm);

#endif
