/* Fitting one elliptical Moffat to pixels: a star on its sky, or a PSF stamp. */
#ifndef RX_PSF_MOFFAT_FIT_H
#define RX_PSF_MOFFAT_FIT_H

#include "base/error.h"
#include "psf/moffat.h"

typedef struct rx_moffat_pixels {
    int n;
    double *x, *y, *value, *sigma; /* [n]; x, y: pixel centres in any frame */
} rx_moffat_pixels;

rx_status rx_moffat_pixels_new(int capacity, rx_moffat_pixels *dst, rx_error *err);
void rx_moffat_pixels_free(rx_moffat_pixels *pixels);

/* model = sky + peak * (pixel integral of the profile around x, y) */
typedef struct rx_moffat_fit {
    double peak, x, y, sky, shape[RX_MOFFAT_SHAPE];
    int rough; /* as of rx_moffat */
    double chi2;
    int converged;
} rx_moffat_fit;

/* From the start values in *fit; sky stays as it is unless free_sky. Few values or a model that
 * cannot start leave converged = 0, status RX_OK. Errors: RX_SYSTEM memory. */
rx_status rx_moffat_fit_run(const rx_moffat_pixels *pixels, int free_sky, rx_moffat_fit *fit, rx_error *err);

double rx_moffat_fit_value(const rx_moffat_fit *fit, const rx_moffat *profile, double x, double y);
double rx_moffat_fit_fwhm(const rx_moffat_fit *fit);
double rx_moffat_fit_ellipticity(const rx_moffat_fit *fit); /* 1 - b/a */

#endif
