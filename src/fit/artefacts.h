/* Which sources are no light that came through the PSF: hits of cosmic rays and hot pixels, lines of satellites, columns and
 * spikes. Three hypotheses for the pixels z = (d - sky) / sigma around each source, and a share of the tile for each of them.
 *
 * Hit against star, on the pixels around the brightest one within half a FWHM, each with a level of its own:
 *
 *   star  z = a + b P      P the PSF wherever within half a FWHM it fits best, b > 0
 *   hit   z = a, but for that pixel and up to two of its 8 neighbours, which may have any value
 *   ln L(hit) - ln L(star) = (chi2(star) - chi2(hit)) / 2 - ln N - (k - 1) (ln 8 + ln(z_max / sqrt(2 pi)))
 *
 * N: pixels that it may be in; k - 1 further pixels with flat priors up to z_max. Both have the variance that photons of a star with that
 * brightest pixel add. Light of whatever sources is smoother than a star's, so that none needs to be taken out. Nothing is said of
 * saturated ones.
 *
 * Line, on the tile behind a Gaussian as wide as the PSF, m in its sigmas: what rises at c(t) = m(t) - max(m beside it at 3 FWHM) in 8 places
 * on either side along a direction, 2.5 to 11.25 FWHM away.
 *
 *   ln L(line) - ln L(none) = sum_t ln(f(c_t - b) / f(c_t)) - ln(48 directions, 6 heights b)
 *
 * f: how c is distributed on the tile itself, crowds, nebulae and correlated noise among it. What the source has beyond the median of
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

/* Of image->pixels with its sky, noise, mask and PSF; without a PSF nothing is found. The same bytes for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_artefacts_find(const rx_image *image, int nthreads, int n, rx_artefact *list, rx_error *err);

#endif
