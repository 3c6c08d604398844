/* Where the model of a tile is wrong: what it leaves of the pixels, by cells, against what the noise would.
 *
 *   d = pixels - sky - light,     u = d / sqrt(sigma^2 + light / gain),     t = (G * u) / noise of G * u
 *
 * light is that of the fitted templates, or of a network's image through its PSF; where neither is known pixels within a FWHM of a
 * source do not count. G is a Gaussian as wide as the PSF, and its noise that of the tile's correlation, so that t is the pull, in errors,
 * of a point source fitted to an empty place. Cells are of 64 pixels, or 16 FWHM where that is more, about 110 independent places;
 * their width of t, median |t| / 0.6745, is 1 to a tenth where the noise is all there is. A cell is not explained where
 *
 *   the width of t is above 1.3       errors of faint sources are too small there: structure of the sky, a trace of the detector
 *   that of u is, or either is below 1 / 1.3       the noise is not what it is taken for: rounded, cut off
 *   b, with 3 errors, is above 0.03   the PSF is not right: b = fluxes of stars through it over the true ones - 1,
 *                                     a = sum w d e / (sum w e^2 - (sum w e l)^2 / sum w l^2),   b = a sum w e l / sum w l^2,
 *                                     l the light of the templates, e = l blurred more - l, which is how d looks where the PSF is
 *                                     too wide or too narrow: d is at right angles to l, as fluxes are fitted
 *
 * Where sources leave less than half of a cell, t is of all its pixels, if they are modelled, and what it leaves less of than noise is no
 * fault: the fits follow it; else only noise that is too quiet between them is found. Where rows, columns or an edge along them are
 * offset, sums along one of these scatter more than along the other.
 *
 * Dark quarters of cells are those whose own pixels lie 0.3 sigma below the sky: lanes of dust, or a mesh that bright light has
 * lifted, where a network that knows no sky below its mesh cannot be right. */
#ifndef RX_PIPELINE_RESIDUAL_H
#define RX_PIPELINE_RESIDUAL_H

#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"
#include "data/image.h"

RX_BEGIN_DECLS

typedef struct rx_residual_input {
    const rx_image *image;   /* with sky, noise, its correlation, and masks */
    const float *residual;   /* [height][width] ADU: d of fitted templates; NULL: pixels - sky - light */
    const float *light;      /* [height][width] ADU; NULL: none is known */
    const int32_t *segments; /* of the sources; NULL: all of the pixels are modelled */
    double fwhm;             /* of the PSF, pixels; not above 0: not known */
    int nthreads;
} rx_residual_input;

typedef enum rx_misfit {
    RX_MISFIT_NONE,
    RX_MISFIT_NOISE,
    RX_MISFIT_PSF,
    RX_MISFIT_DETECTOR,
    RX_MISFIT_SKY,
    RX_MISFIT_CROWD,
    RX_MISFITS
} rx_misfit;

typedef struct rx_residual {
    int nx, ny, width, height; /* cells; pixels; 0: nothing is known */
    unsigned char
        *cell;    /* [ny][nx] bits: 1 not explained; 2, 4, 8, 16 its quarters (x fastest) are dark; owned */
    double *pull; /* [ny][nx] width of t; NAN: too few pixels; owned */
    double share; /* of the cells that are known: not explained; NAN where none is */
    double dark;  /* share of quarters; NAN where none is known */
    rx_misfit cause; /* of most cells that are not explained */
    double x, y;     /* middle of the one whose pull is farthest from 1 */
} rx_residual;

/* The same bytes for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_residual_measure(const rx_residual_input *input, rx_residual *dst, rx_error *err);
void rx_residual_free(rx_residual *residual); /* content only */

/* Is the pixel in a cell that is not explained; in a dark quarter? */
int rx_residual_at(const rx_residual *residual, double x, double y);
int rx_residual_dark_at(const rx_residual *residual, double x, double y);

/* So many are not explained that the tile as a whole is in doubt. */
int rx_residual_is_large(double share);

/* The cause as RXMISFIT has it; in words, and what may help. */
const char *rx_misfit_name(rx_misfit cause);
const char *rx_misfit_text(rx_misfit cause);

/* So many quarters lie below the sky that it is no chance: noise alone gives 1e-3 of them at the widest correlation. */
int rx_residual_is_dark(double dark);

RX_END_DECLS

#endif
