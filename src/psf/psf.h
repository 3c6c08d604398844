/* Making and evaluating the PSF of a tile. */
#ifndef RX_PSF_PSF_H
#define RX_PSF_PSF_H

#include "base/error.h"
#include "base/log.h"
#include "data/psf.h"
#include "data/sources.h"
#include "data/tile.h"

typedef struct rx_psf_params {
    rx_psf_type type;    /* MOFFAT, FILE, PSFEX, AUTO */
    double fwhm;         /* pixels, MOFFAT */
    double beta;         /* MOFFAT exponent [4.765] */
    const char *file;    /* PSF_NAME, FILE and PSFEX */
    int size;            /* odd stamp size in pixels, 0 = from the fwhm */
    int min_stars;       /* AUTO: fewer usable stars is an error [5] */
    double min_snr;      /* AUTO [20] */
} rx_psf_params;

/* The PSF of `tile`. `stars` (AUTO only, else NULL): sources detected on the unrestored
 * tile with at least X/Y, FLUX_AUTO/ERR, FLUX_RADIUS(0.5), FLAGS, ELLIPTICITY filled. */
rx_status rx_psf_make(const rx_psf_params *par, const rx_tile *tile, const rx_background *background,
                      const rx_sources *stars, rx_log *log, rx_psf **dst, rx_error *err);

/* stamp[size*size] = PSF at 0-based tile position (x, y), sum 1. */
void rx_psf_at(const rx_psf *psf, double x, double y, float *stamp);

/* A Gaussian of that FWHM (pixels; 0 = a single pixel), the PSF of what RL + RL_DENOISE gives. */
rx_status rx_psf_gauss(double fwhm, rx_psf **dst, rx_error *err);

/* Pixel-integrated Moffat (Moffat 1969, A&A 3, 455), elliptical when ratio < 1. */
rx_status rx_psf_moffat(double fwhm, double beta, double ratio, double angle, int size, rx_psf **dst, rx_error *err);

/* Polynomial PSFEx model (.psf), resampled to the tile's pixels. */
rx_status rx_psf_psfex(const char *file, int width, int height, rx_psf **dst, rx_error *err);

rx_psf *rx_psf_copy(const rx_psf *psf); /* NULL without memory */

#endif
