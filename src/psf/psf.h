/* Making and evaluating the PSF of a tile. */
#ifndef RX_PSF_PSF_H
#define RX_PSF_PSF_H

#include "base/error.h"
#include "base/log.h"
#include "data/psf.h"
#include "data/sources.h"
#include "data/tile.h"

typedef struct rx_psf_params {
    rx_psf_type type; /* MOFFAT, FILE, PSFEX, AUTO */
    double fwhm;      /* pixels, MOFFAT */
    double beta;      /* MOFFAT exponent [4.765] */
    const char *file; /* PSF_NAME, FILE and PSFEX */
    int size; /* odd stamp size in pixels, 0 = from the fwhm, or the file's; FILE and PSFEX are cut to it */
    int min_stars;  /* AUTO: fewer usable stars is an error [5] */
    double min_snr; /* AUTO [20] */
} rx_psf_params;

/* The PSF of `tile`. `stars` (AUTO only, else NULL): sources detected on the unrestored
 * tile with at least X/Y, peak, FLUX_AUTO/ERR, FLUX_RADIUS(0.5) as first radius, FLAGS and the rms
 * ellipse (a, b) filled; where segments are there, pixels of neighbours stay out of the fits.
 * Errors: RX_INPUT when the PSF cannot be used on this tile (the text names the file and the way out),
 * RX_SYSTEM memory. *dst, of this and the functions below, is freed by rx_psf_free(). A PSF that does not fit
 * into the tile is refused, unless its size is ours to choose. */
rx_status rx_psf_make(const rx_psf_params *par, const rx_tile *tile, const rx_background *background,
                      const rx_sources *stars, rx_log *log, rx_psf **dst, rx_error *err);

/* Pixel-integrated Moffat (Moffat 1969, A&A 3, 455); ratio b/a of the axes (1 = round), angle of the major
 * axis in radians counter-clockwise from x; fwhm (pixels) is the geometric mean of both axes. size is
 * odd, or 0: encloses 99.9 % of the flux or falls to 1e-5 of the peak, whichever is smaller. */
rx_status rx_psf_moffat(double fwhm, double beta, double ratio, double angle, int size, rx_psf **dst,
                        rx_error *err);

/* An image as a constant PSF. Its centre is the geometric centre of the frame: an odd axis has it in the
 * middle pixel; an even axis between two pixels, and is then shifted by half a pixel (Lanczos 12,
 * flux and centroid kept) onto an odd one, so that what is restored does not move. Oblong images are
 * padded with zeros. width, height: of the tile that it must fit into. */
rx_status rx_psf_image(const char *file, int size, int width, int height, rx_log *log, rx_psf **dst,
                       rx_error *err);

/* Polynomial PSFEx model (.psf, or one row of a merged table), resampled to the tile's pixels and
 * normalised everywhere on the tile of width x height. extension (from 1): the model of that image of a
 * multi-extension tile, where the file holds several; else its only one. */
rx_status rx_psf_psfex(const char *file, int extension, int size, int width, int height, rx_log *log,
                       rx_psf **dst, rx_error *err);

/* FWHM (pixels, of the profile before pixel integration) and 1 - b/a of the elliptical Moffat that fits a
 * stamp [size][size] best; second moments would follow the noise in the wings. beta may be NULL.
 * RX_INPUT when no profile fits. */
rx_status rx_psf_shape(const float *stamp, int size, double *fwhm, double *ellipticity, double *beta,
                       rx_error *err);

#endif
