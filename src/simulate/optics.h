/* The telescope: PSF and pixel response as stamps that are known between the pixels too. */
#ifndef RX_SIMULATE_OPTICS_H
#define RX_SIMULATE_OPTICS_H

#include "base/error.h"
#include "data/psf.h"

/* What a pixel centred at r from a point source of flux 1 collects, pixel response included, sampled on cells
 * of 1/oversampling pixel: oversampling is chosen such that the spectrum beyond its Nyquist frequency is
 * below 5e-5 of the centre, so that band-limited interpolation gives the value anywhere. The middle cell
 * (size / 2, size / 2) is r = 0; the sum over the cells is oversampling^2 (1 - missing). It varies as a
 * polynomial:
 *
 *   optics(x, y) = sum_t terms[t].factor X^px Y^py basis[terms[t].image]
 *   X = (x - x0) / xs,   Y = (y - y0) / ys
 *
 * (x, y: pixels of the tile from 0; positions beyond its borders count as on them). */
typedef struct rx_optics {
    int oversampling; /* odd */
    int grid;         /* odd: cells per pixel on which point sources have to be put (see render.h) */
    int size;         /* odd, cells */
    int nbasis;
    float *basis; /* [nbasis][size][size] */
    int nterms;
    struct {
        int image, px, py;
        double factor;
    } terms[RX_PSF_MAX_BASIS];
    double x0, y0, xs, ys;
    rx_psf_type type;
    double fwhm;              /* pixels, at the tile's centre, before the pixel response */
    double beta, ellipticity; /* as in rx_psf */
    double missing;           /* share of the flux beyond the stamp (it is not put back), at the centre */
    int pixels;               /* odd: side of rx_optics_on_pixels() */
    char description[160];
} rx_optics;

/* Cycles per cell up to which points on a grid of cells are exact (simulate/render.c). */
#define RX_STAR_BAND 0.34

/* An elliptical Moffat of a tile. */
typedef struct rx_moffat_profile {
    double fwhm; /* pixels, geometric mean of both axes */
    double beta;
    double ratio, angle; /* b/a; of the major axis, radians counter-clockwise from x */
    double variation; /* share by which the FWHM grows from the tile's centre to its corners, as the square of
                            the distance; 0 = constant: then nothing depends on width and height */
} rx_moffat_profile;

/* Integrated over a pixel to 1e-6 of its peak. The stamp loses less than 1e-4 of the flux unless that needs more than
 * 30 FWHM or 1000 pixels on each side (beta below 2.3); `missing` says what. The varying profile is
 * interpolated between Moffats by a polynomial of the lowest degree that is good to 1e-4 of the peak. *dst,
 * of this and the functions below, is freed by rx_optics_free(). Errors: RX_USAGE values out of range, or a
 * variation that a polynomial cannot follow; RX_SYSTEM memory. */
rx_status rx_optics_moffat(const rx_moffat_profile *profile, int width, int height, rx_optics **dst,
                           rx_error *err);

/* Gaussian of that FWHM (pixels, before the pixel response): the well-sampled target of sharp references. */
rx_status rx_optics_gauss(double fwhm, rx_optics **dst, rx_error *err);

/* From a PSF sampled on the tile's pixels (FILE, PSFEX, or measured on the tile), which holds the pixel
 * response already; between the pixels it is interpolated band-limited (the trigonometric polynomial
 * through the pixels), so that a star in the middle of a pixel looks as rx_psf_at() says, exactly. */
rx_status rx_optics_psf(const rx_psf *psf, rx_optics **dst, rx_error *err);

/* The same PSF on the tile's pixels, normalised as data/psf.h says, as the stage wants it (PSF known to a
 * restorer). A Moffat is cut as rx_psf_moffat() would. Freed by rx_psf_free(). Errors: RX_SYSTEM memory. */
rx_status rx_optics_on_pixels(const rx_optics *optics, rx_psf **dst, rx_error *err);

void rx_optics_free(rx_optics *optics); /* NULL is fine */

#endif
