/* What the pixels as they were observed say of proposed point sources: the flux of each over its error, all fluxes
 * fitted together at fixed places.
 *
 *   d(p) = sum_j F_j P(p - p_j) + noise,   A_jk = sum_p w P_j P_k,   b_j = sum_p w P_j d,   A F = b
 *   w = 1 / sigma^2 of the sky, 0 of hidden pixels;   I_j = 1 / (A^-1)_jj
 *   lambda_j = F_j I_j / sqrt(I_j + sum_p w^2 P_j^2 M_j / gain + (e sum_p w P_j M_j)^2)
 *
 * M_j: the light of all others, whose photons and whose PSF, known to e, add to the error; a source's own do not, for
 * the question is whether it is there.
 *
 * Where the sky has structure (structure.h), measured in what the first fit leaves, its level is taken off the data, and I_j below the root is
 * multiplied by 1 + S^2.
 *
 * What is not significant as a point is tried as Gaussians of twice the FWHM, four times, ..., to 12 pixels.
 * Alone on the sky lambda is the matched filter's signal to noise; beside others it is what their light leaves
 * significant. Two proposals for one source share its flux, and neither is significant then: so the weakest of
 * each neighbourhood goes first, and what stays is fitted again. Where `image->noise` is that of correlated pixels,
 * it should be the effective one (rx_field_effective()). */
#ifndef RX_FIT_SIGNIFICANCE_H
#define RX_FIT_SIGNIFICANCE_H

#include "base/error.h"
#include "data/image.h"

typedef struct rx_proposal {
    double x, y;   /* pixels from 0 */
    int sure;      /* it stays, whatever its lambda */
    double flux;   /* ADU, in the last fit that it was part of */
    double lambda; /* sigmas, there; NAN where no pixel of it is used */
    int kept;      /* lambda is `least` or above, or NAN */
} rx_proposal;

/* Of n proposals x, y and `sure` are given; the rest is filled in. image->psf is the PSF. The same bytes for any nthreads.
 * Errors: RX_SYSTEM. */
rx_status rx_significance(const rx_image *image, double least, int nthreads, int n, rx_proposal *list,
                          rx_error *err);

#endif
