/* Which sources are no more than a place on a line: a trail of a satellite, a column or row that glows, the edge of a chip, a step
 * between amplifiers. What lies on a straight line is the same all along it, to either side of the source:
 *
 *   lambda(p) = sum_q P(q - p) z(q) / sqrt(sum_q P^2(q - p)) / f,     z = (d - sky) / sigma, P a Gaussian of the PSF's FWHM
 *
 * is the significance of a point at p, f its noise where pixels are correlated. m(a) is its level along the direction a to one side of the
 * source, from 3 to 27 FWHM, at places 1.5 FWHM apart, whose noise is all but independent: their lower quartile and 0.674, which stars
 * on the way leave alone. The lower one of both sides counts, so that a star or a galaxy to one side is no line; beside an edge that of
 * both halves of one side. In the direction of the largest m a source is taken for a line's where
 *
 *   m > median over a of m + 5.4 s                   it stands out among directions, s the scatter of m over these
 *   their lowest tenth + 1.28 > 0.7 m                it is even: a line has one level; a crowd has gaps. 78 of 70,573 stars of crowds
 *                                                    are marked (validation/artefacts.py)
 *   (t^2 - 1) t exp(-t^2 / 2) > (2 pi)^1.5 2 w^2 n   the noise of lambda has more peaks of t = (lambda - m) / sqrt(1 + v) than there are
 *                                                    sources
 *
 * v: photons of the line, in variances of the sky; w = FWHM / 2.3548; n: sources a pixel, as probable in any octave of t. 5.4 s are passed
 * with a probability of 0.004 by one of 120 directions of 1,000 sources. Where a template was fitted, lambda is the flux over its error
 * if that is less: the light of neighbours is no peak. The probability of a line is the peaks over peaks and sources. */
#ifndef RX_FIT_LINES_H
#define RX_FIT_LINES_H

#include "base/error.h"
#include "data/image.h"
#include "data/sources.h"

/* The noise of rx_gauss_masked() of that FWHM where pixels have a noise of 1 and that correlation. Errors: RX_SYSTEM. */
rx_status rx_lines_noise(const rx_noise_correlation *correlation, double fwhm, double *dst, rx_error *err);

/* Gives each source its probability of being on a line (rx_source_doubt()). Of image->pixels with its sky, noise, mask and
 * PSF, without which nothing is found. The same bytes for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_lines_mark(const rx_image *image, int nthreads, rx_sources *sources, rx_error *err);

#endif
