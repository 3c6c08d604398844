/* The telescope: PSF and pixel response on a grid finer than the pixels. */
#ifndef RX_SIMULATE_OPTICS_H
#define RX_SIMULATE_OPTICS_H

#include "base/error.h"
#include "data/psf.h"

/* Like rx_psf (same polynomial in the position), but sampled on cells of 1/oversampling pixel, pixel response
 * included: the value at a cell is what a pixel centred there would collect of a point source of flux 1 at
 * the origin. */
typedef struct rx_optics {
    int oversampling; /* odd */
    int size;         /* odd, cells */
    int nbasis;
    float *basis; /* [nbasis][size][size] */
    int px[RX_PSF_MAX_BASIS], py[RX_PSF_MAX_BASIS];
    double x0, y0, xs, ys;
    double fwhm;    /* pixels, at the tile's centre, before the pixel response */
    double missing; /* share of the flux beyond the stamp (it is not put back) */
    char description[160];
} rx_optics;

/* Elliptical Moffat; `variation`: the FWHM grows by this share from the tile's centre to its corners, as the
 * square of the distance (0 = constant). ratio = b/a, angle in radians. */
rx_status rx_optics_moffat(double fwhm, double beta, double ratio, double angle, double variation, int width,
                           int height, rx_optics **dst, rx_error *err);

/* Gaussian of that FWHM (pixels): the well-sampled target of sharp references. */
rx_status rx_optics_gauss(double fwhm, rx_optics **dst, rx_error *err);

/* From a PSF sampled on the tile's pixels (FILE, PSFEX, or measured on the tile), which holds the pixel
 * response already: interpolated band-limited. */
rx_status rx_optics_psf(const rx_psf *psf, rx_optics **dst, rx_error *err);

/* The same PSF on the tile's pixels, as the stage wants it (PSF known to a restorer). */
rx_status rx_optics_on_pixels(const rx_optics *optics, rx_psf **dst, rx_error *err);

void rx_optics_free(rx_optics *optics);

#endif
