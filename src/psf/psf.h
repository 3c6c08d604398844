/* Making and evaluating the PSF of an image. */
#ifndef RX_PSF_PSF_H
#define RX_PSF_PSF_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/image.h"
#include "data/psf.h"
#include "data/record.h"
#include "data/sources.h"
#include "psf/params.h"

RX_BEGIN_DECLS

/* The PSF of an image. AUTO asks for its pixels with their sky, level, noise (none: 1), mask, gain and
 * saturation, the others for its size. `stars` (AUTO only, else NULL): sources detected on the image before it
 * is restored, with at least X/Y, peak, FLUX_AUTO/ERR, FLUX_RADIUS(0.5) as first radius, FLAGS and the rms
 * ellipse (a, b) filled; where segments are there, pixels of neighbours stay out of the fits.
 * Errors: RX_USAGE (AUTO without a list), RX_INPUT when the PSF cannot be used on this image (the text names the file and the way out),
 * RX_SYSTEM memory. *dst, of this and the functions below, is freed by rx_psf_free(). A PSF that does not fit
 * into the image is refused, unless its size is ours to choose. */
rx_status rx_psf_make(const rx_psf_params *par, const rx_image *image, const rx_sources *stars, rx_log *log,
                      rx_psf **dst, rx_error *err);

/* What the narrow edge of the sizes of sources says of the FWHM (pixels) where none is a usable star: it is no wider, for
 * nothing is narrower than a star but specks, which are left out. 0: too few sources. */
double rx_psf_bound(const rx_psf_params *par, const rx_image *image, const rx_sources *sources);

/* Pixel-integrated Moffat (Moffat 1969, A&A 3, 455); ratio b/a of the axes (1 = round), angle of the major
 * axis in radians counter-clockwise from x; fwhm (pixels) is the geometric mean of both axes. size is
 * odd, or 0: encloses 99.9 % of the flux or falls to 1e-5 of the peak, whichever is smaller. */
rx_status rx_psf_moffat(double fwhm, double beta, double ratio, double angle, int size, rx_psf **dst,
                        rx_error *err);

/* What par->file holds, by its content: a PSFEx model, a cube of images with their places, or an image; resampled to the tile's pixels, varying
 * as a polynomial and normalised everywhere on the tile of width x height, into which it must fit. The centre of an
 * image is the geometric centre of its frame: an odd axis has it in the middle pixel; an even axis between two pixels,
 * and is then shifted by half a pixel (Lanczos 12, flux and centroid kept) onto an odd one, so that what is restored
 * does not move. Oblong images are padded with zeros. */
rx_status rx_psf_file(const rx_psf_params *par, int width, int height, rx_log *log, rx_psf **dst,
                      rx_error *err);

/* An image of a PSF in memory, treated as one in a file is (par->sampling, size, integrate). */
typedef struct rx_psf_pixels {
    int width, height;
    const float *pixels; /* [height][width], of any sum above 0 */
} rx_psf_pixels;
rx_status rx_psf_of_pixels(const rx_psf_params *par, const rx_psf_pixels *image, int width, int height,
                           rx_log *log, rx_psf **dst, rx_error *err);

/* Polynomial PSFEx model (.psf, or one row of a merged table), resampled to the tile's pixels and
 * normalised everywhere on the tile of width x height. */
rx_status rx_psf_psfex(const rx_psf_params *par, int width, int height, rx_log *log, rx_psf **dst,
                       rx_error *err);

/* Cards RXPSF...: how PSF_TYPE AUTO came to it, and what stars that were not fitted say of it. */
void rx_psf_facts(const rx_psf *psf, rx_record *facts);

/* RX_INPUT unless a stamp of this size fits into the tile and is no larger than RX_PSF_LARGEST. */
rx_status rx_psf_check_size(const char *file, int psf_width, int psf_height, int width, int height,
                            rx_error *err);

/* FWHM (pixels, of the profile before pixel integration) and 1 - b/a of the elliptical Moffat that fits a
 * stamp [size][size] best; second moments would follow the noise in the wings. beta may be NULL.
 * RX_INPUT when no profile fits. */
rx_status rx_psf_shape(const float *stamp, int size, double *fwhm, double *ellipticity, double *beta,
                       rx_error *err);

RX_END_DECLS

#endif
