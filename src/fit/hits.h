/* Which sources are hits of cosmic rays and hot pixels: light that did not come through the PSF. Three hypotheses for the pixels
 * z = (d - sky) / sigma of 5 half FWHM, and of 33 pixels at most, around the brightest pixel of each source:
 *
 *   light   a point, or an exponential galaxy of any size, elongation and direction, behind the PSF; further points; hits elsewhere
 *   hit     pixels of any value, that one and others, each beside one of them or elsewhere; points farther away than a FWHM
 *   both    a hit and a point within a FWHM, of 5 sigma or more as those that were detected
 *
 *   -2 ln L = chi2 + costs, least squares with a level, no source negative
 *
 * Each is found by what gains most, for as long as it gains more than it costs, by the logarithms of priors; what of the light does
 * not fit then is placed again, one source after the other:
 *
 *   a further source    -2 ln(n N) + 2 ln(z_max / sqrt(2 pi))      n sources a pixel of the tile, N pixels within half a FWHM
 *   a pixel beside      2 ln 8 + 2 ln(z ln(z_max) / sqrt(2 pi))    one of 8 neighbours, as probable in any octave of heights up to z_max
 *   a pixel elsewhere   the same with -2 ln n for the 8
 *   the first pixel     2 ln N
 *
 * So a galaxy is as wide as the PSF across, a blend costs as much more as sources are rare, and a track as it is long. A hit has at most as many
 * pixels as a track of 3 through the patch, or any light would be one. The variance of a pixel holds the photons of the light and what
 * the PSF may be wrong by; where a hit leaves more than that, all are divided by its reduced chi2. Nothing is said of saturated pixels.
 *
 * The share of hits is that at which the mean of what is found with it is the share (EM: Dempster et al. 1977, J. R. Stat. Soc. B 39, 1), with
 * one hit at least. */
#ifndef RX_FIT_HITS_H
#define RX_FIT_HITS_H

#include "base/error.h"
#include "data/image.h"
#include "data/sources.h"

/* Gives sources from the one called `first` on their probability of being hits (rx_source_doubt()). Of image->pixels with its sky, noise, mask and PSF;
 * without a PSF nothing is found, nor where stars may be sharper than the PSF is said to be (rx_psf_quality.sharper). The same
 * bytes for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_hits_mark(const rx_image *image, int nthreads, int first, rx_sources *sources, rx_error *err);

#endif
