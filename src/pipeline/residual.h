/* Where the model of a tile is wrong: what it leaves of the pixels against what the noise would, as what it does to results.
 *
 *   d = pixels - sky - light,     u = d / sqrt(v),  v = sigma^2 + light / gain,     t = (G * u) / noise of G * u
 *
 * light is that of the fitted templates, or of a network's image through its PSF; where neither is known pixels of sources do not
 * count. G is a Gaussian as wide as the PSF, and its noise that of the tile's correlation, so that t is, in errors, the flux of a point
 * fitted to an empty place. Pixels where a tenth of the light is above the noise do not count. Cells are of 64 pixels, or 16 FWHM where
 * that is more: some 110 independent places, so that a width, median |.| / 0.6745, is known to a tenth. A cell is not explained where
 * the width of t or u is beyond LOW and HIGH; LOW of t is less where many sources are fitted, as each takes three of the freedoms of the
 * places (in a crowd of 8,000 stars per Mpixel, FWHM 4, t has a width of .8).
 *
 * Of the tile three numbers say what that does to results:
 *
 *   the median over cells of both widths.   Where that of t is HIGH, sources of 5 sigma are of 3.8, and by the density of peaks of a
 *                   Gaussian field (nu exp(-nu^2 / 2) / ((2 pi)^(3/2) 2 s^2) a pixel, s the sigma of G) 38 per Mpixel are none at FWHM 3.3
 *   b, of stars     what the PSF makes their fluxes too high by. Their light in truth is that of the model, l, plus a e, e = l blurred
 *                   by half a FWHM more - l, so that a fit takes it for 1 + b times as much and leaves d at right angles to l:
 *                   a = sum w d e / (sum w e^2 - (sum w e l)^2 / sum w l^2),     b = a sum w e l / sum w l^2,     w = 1 / v,
 *                   of points of S/N above 20: the median, with its error
 *
 *   h, of stars   second differences of d along a row, over what sky and photons of the light make of them, where the photons are more:
 *                   the mean of h^2, which an error of the PSF can only raise, is below LOW^2 where GAIN is too low
 *
 * The tile is not explained, and its header says why, where one of them is beyond what results may be: LOW and HIGH, and BIAS, by two
 * errors of b and of h^2; or where two errors of fluxes by the PSF (RXPSFERR) are above BIAS.
 *
 * Dark quarters of cells are those whose own pixels lie 0.3 sigma below the sky: lanes of dust, or a mesh that bright light has
 * lifted, where a network that knows no sky below its mesh cannot be right. */
#ifndef RX_PIPELINE_RESIDUAL_H
#define RX_PIPELINE_RESIDUAL_H

#include <stdbool.h>
#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"
#include "data/image.h"
#include "data/sources.h"

RX_BEGIN_DECLS

typedef struct rx_residual_input {
    const rx_image *image;     /* with sky, noise, its correlation, and masks */
    const float *residual;     /* [height][width] ADU: d of fitted templates; NULL: pixels - sky - light */
    const float *light;        /* [height][width] ADU; NULL: none is known */
    const rx_sources *sources; /* with segments, and with fits where residual is given */
    double fwhm;               /* of the PSF, pixels; not above 0: not known */
    double psf_error;          /* of fluxes, relative; 0: not known */
    int nthreads;
} rx_residual_input;

typedef enum rx_misfit {
    RX_MISFIT_NONE,
    RX_MISFIT_NOISE,
    RX_MISFIT_PSF,
    RX_MISFIT_SKY,
    RX_MISFITS
} rx_misfit;

typedef struct rx_residual {
    int nx, ny, width, height; /* cells; pixels; 0: nothing is known */
    unsigned char
        *cell;       /* [ny][nx] bits: 1 not explained; 2, 4, 8, 16 its quarters (x fastest) are dark; from 32
                    on how many of them are known; owned */
    double *pull;    /* [ny][nx] width of t; NAN: too few pixels; owned */
    double share;    /* of the cells that are known: not explained; NAN where none is */
    double dark;     /* share of quarters; NAN where none is known */
    rx_misfit cause; /* of what makes results of the tile wrong; NONE: they are right */
    double by;       /* how much: a width, or a share of fluxes */
} rx_residual;

/* The same bytes for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_residual_measure(const rx_residual_input *input, rx_residual *dst, rx_error *err);
void rx_residual_free(rx_residual *residual); /* content only */

/* Is the pixel in a cell that is not explained; in a dark quarter? */
int rx_residual_at(const rx_residual *residual, double x, double y);
int rx_residual_dark_at(const rx_residual *residual, double x, double y);

/* The cell in the middle is not explained. */
int rx_residual_is_large(double share);

/* The cause as RXMISFIT has it; what it does, `by` to follow, and what may help. */
const char *rx_misfit_name(rx_misfit cause);
const char *rx_misfit_text(rx_misfit cause);
const char *rx_misfit_remedy(rx_misfit cause);

/* So many quarters lie below the sky that it is no chance: noise alone gives 1e-3 of them at the widest correlation. */
int rx_residual_is_dark(double dark);

RX_END_DECLS

#endif
