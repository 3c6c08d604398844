/* The point spread function of a tile, whatever it came from.
 *
 *   PSF(x, y) = sum_i coeff_i(x, y) * basis_i          (x, y: pixels from 0 of the tile)
 *   coeff_i(x, y) = ((x - x0)/xs)^px_i * ((y - y0)/ys)^py_i
 *
 * One basis image with px = py = 0 is a constant PSF. Basis images are sampled on the
 * tile's pixels and already integrated over the pixel, odd in size, the centre in the
 * middle of pixel (size/2, size/2). Normalised: the sum of PSF(x, y) is 1 everywhere on
 * the tile (basis 0 sums to 1, the others to 0), negative wings included.
 *
 * Of a narrow PSF, which its pixels do not sample, the same is known between the pixels as well: `samples`, `fine`
 * of them a pixel and every fine-th of them the basis, each the light of a pixel centred there.
 */
#ifndef RX_DATA_PSF_H
#define RX_DATA_PSF_H

#include <stddef.h>

#include "base/extern.h"

RX_BEGIN_DECLS

/* Where it comes from. */
typedef enum rx_psf_type {
    RX_PSF_MOFFAT, /* a stated profile */
    RX_PSF_FILE,   /* an image of it */
    RX_PSF_PSFEX,  /* a model of PSFEx or of ours */
    RX_PSF_AUTO,   /* stars of the tile, by pixels where they allow it */
    RX_PSF_PIXEL,  /* a single pixel: of restored images that are not smoothed */
    RX_PSF_GAUSS   /* of restored images */
} rx_psf_type;

enum { RX_PSF_CELLS = 5 };

/* How PSF_TYPE AUTO came to a PSF; the names are those of RXPSFHOW. */
typedef enum rx_psf_how {
    RX_PSF_BY_NOTHING, /* nothing was measured */
    RX_PSF_BY_PIXELS,
    RX_PSF_BY_MOFFAT,
    RX_PSF_BY_MOFFAT_BETA,
    RX_PSF_BY_WIDTH,
    RX_PSF_BY_BESIDE,
    RX_PSF_BY_STATED
} rx_psf_how;
const char *rx_psf_how_name(rx_psf_how how); /* "" for nothing */

/* How PSF_TYPE AUTO came to a PSF, and how well that describes reserved stars, which were never fitted. Where
 * nothing was measured the numbers are 0. */
typedef struct rx_psf_quality {
    rx_psf_how how;
    int reserved;      /* stars behind what follows `beyond` */
    int degree;        /* of the polynomial over the tile */
    double radius;     /* pixels, the sum of the PSF within is 1 */
    double beyond;     /* share of a star's light estimated outside */
    double hidden;     /* part of flux_error: wings that may hide in the noise */
    double flux_error; /* relative, 1 sigma: of the flux of a point source, everywhere alike */
    double flux_errors[RX_PSF_CELLS][RX_PSF_CELLS]; /* besides, at X, Y = -1, -0.5, .. 1 */
    double trace[2];    /* mean (T_data - T_model) / T_model and its error, T = xx + yy */
    double shape[2][2]; /* the same of e1 = (xx - yy) / T, e2 = 2 xy / T: data - model */
    /* curve of growth to 20 FWHM, data against model: largest difference, share of the total */
    double growth;
    double growth_radius; /* pixels, where */
    double growth_error;  /* of it, 1 sigma */
    double residual;      /* stacked stars - PSF, largest within a FWHM, share of the peak */
    int neighbours;       /* sources that the joint fit of a crowd took off around its stars; 0: not done */
    int sharper;          /* sources that crowd at a smaller size than the stars; 0: none */
    double sharpness;     /* their half-light radius over that of the stars */
    double limit;         /* ADU: stars with such pixels are flattened, and left out; 0: none */
} rx_psf_quality;

/* Of a star, data - model: (T - T_model) / T_model, e1, e2 of rx_psf_quality, and 1 sigma of each. */
typedef struct rx_psf_star {
    double x, y, flux; /* pixels from 0, ADU */
    double off[3], error;
} rx_psf_star;

/* Light within a radius (pixels), shares of a star's: of stars, of the PSF, 1 sigma of their difference. */
typedef struct rx_psf_growth {
    double radius, stars, psf, error;
} rx_psf_growth;

/* What reserved stars, or all where fewer than three are reserved, say of a PSF that was measured. */
typedef struct rx_psf_tested {
    int nstars, nradii, side;
    rx_psf_star *star;     /* [nstars] reserved ones alone */
    rx_psf_growth *growth; /* [nradii] */
    float *residual;       /* [side][side] stacked stars - PSF, in units of the PSF's peak */
} rx_psf_tested;

enum { RX_PSF_MAX_BASIS = 45 }; /* a polynomial of degree 8 */

typedef struct rx_psf {
    rx_psf_type type;
    int size;       /* odd, each basis image is [size][size] */
    int nbasis;     /* 1 .. RX_PSF_MAX_BASIS */
    float *basis;   /* [nbasis][size][size] */
    int fine;       /* of samples */
    float *samples; /* [nbasis][side][side], side = rx_psf_fine_side(); NULL: none */
    int px[RX_PSF_MAX_BASIS], py[RX_PSF_MAX_BASIS];
    double x0, y0, xs, ys;
    double fwhm;        /* pixels, at the tile's centre */
    double ellipticity; /* 1 - b/a at the tile's centre */
    double beta;        /* Moffat exponent, 0 when not a Moffat */
    /* AUTO: how sure we are */
    int nstars;         /* stars used, 0 when not measured */
    double fwhm_error;  /* pixels, 1 sigma of the fwhm; 0 unknown */
    double (*stars)[2]; /* [nstars] x, y from 0; NULL when not measured */
    rx_psf_quality quality;
    rx_psf_tested *tested; /* owned; NULL where nothing was measured, and in copies */
    char description[160]; /* one line for log, header and report */
} rx_psf;

/* Zeroed PSF with room for nbasis images of size x size; exponents 0, scales 1. NULL without memory. */
rx_psf *rx_psf_new(rx_psf_type type, int size, int nbasis);

/* `fine` samples a pixel, above 1: room for them in samples, zeroed. 0 without memory. */
int rx_psf_sample(rx_psf *psf, int fine);
static inline int rx_psf_fine(const rx_psf *psf)
{
    return psf->samples != NULL ? psf->fine : 1;
}
static inline int rx_psf_fine_side(const rx_psf *psf)
{
    return rx_psf_fine(psf) * (psf->size - 1) + 1;
}

/* basis = every fine-th of the samples. */
void rx_psf_pick(rx_psf *psf);

/* A copy that shares nothing; NULL without memory. */
rx_psf *rx_psf_copy(const rx_psf *psf);

/* stamp[size*size] = PSF at 0-based tile position (x, y). */
void rx_psf_at(const rx_psf *psf, double x, double y, float *stamp);

/* Noise-equivalent area 1 / sum P^2 there, pixels. */
double rx_psf_noise_area(const rx_psf *psf, double x, double y);

/* stamp[side*side], side = rx_psf_fine_side(): the same with samples; without any it is rx_psf_at(). */
void rx_psf_fine_at(const rx_psf *psf, double x, double y, float *stamp);

/* Relative error of a point source's flux from the PSF there. */
double rx_psf_flux_error(const rx_psf *psf, double x, double y);

/* The same over the tile, root mean square: RXPSFERR, and what reports, records and roll-ups say. */
double rx_psf_flux_error_mean(const rx_psf *psf);

void rx_psf_free(rx_psf *psf); /* NULL is fine */

RX_END_DECLS

#endif
