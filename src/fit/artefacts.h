/* Which sources are no light that came through the PSF: hits of cosmic rays and hot pixels, lines of satellites, columns and
 * spikes. Three hypotheses for the pixels z = (d - sky) / sigma around each source, and a share of the tile for each of them.
 *
 * Hit or star, on the pixels around the brightest one within half a FWHM:
 *
 *   points  z = a + sum_k b_k P(x - x_k)   b_k >= 0; as many as the pixels call for, one by one where most is left, 8 at most
 *   hit     the same without points within half a FWHM, but that pixel and up to two of its 8 neighbours may have any value; or, from a FWHM of 3 pixels on, the same
 *           of the means of rows in one of 8 directions, for tracks that are no wider than their pixels
 *   ln L(hit) - ln L(points) = (chi2(points) - chi2(hit)) / 2 - ln N - (k - 1) (ln 8 + ln(z_max / sqrt(2 pi)))
 *
 * N: places that it may have; k - 1 further pixels with flat priors up to z_max. The variance of a pixel holds the photons of its points and
 * what the PSF may be wrong by; where a hit leaves more than that, both chi2 are divided by its reduced one. Nothing is said of
 * saturated ones.
 *
 * Line, on the tile behind a Gaussian as wide as the PSF, m in its sigmas: what rises at c(t) = m(t) - max(m beside it at 3 FWHM) in 8 places
 * on either side along a direction, 2.5 to 11.25 FWHM away.
 *
 *   ln L(line) - ln L(none) = sum_t ln(f(c_t - b) / f(c_t)) - ln(48 directions, 12 ranges of heights b)
 *
 * f: how c is distributed on the tile itself, crowds, nebulae and correlated noise among it, and in one place of ten anything. What the source has beyond the median of
 * m there, of its own m, is what the line leaves of it: a star or a galaxy on a trail stands above it, a piece of the trail does not.
 *
 * The shares of hits and lines are those at which the mean of what is found with them is the share (EM: Dempster et al. 1977, J. R. Stat.
 * Soc. B 39, 1), with one source of each at least. */
#ifndef RX_FIT_ARTEFACTS_H
#define RX_FIT_ARTEFACTS_H

#include "base/error.h"
#include "data/image.h"

typedef struct rx_artefact {
    int x, y;         /* given: the brightest pixel of the source */
    double hit, line; /* probabilities */
    double off_line;  /* share of its height beyond a line's; 1 without one */
} rx_artefact;

/* Of image->pixels with its sky, noise, mask and PSF; without a PSF nothing is found, nor hits where stars may be
 * sharper than the PSF is said to be (rx_psf_quality.sharper). The same bytes for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_artefacts_find(const rx_image *image, int nthreads, int n, rx_artefact *list, rx_error *err);

#endif
