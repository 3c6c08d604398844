/* Low frequencies that the network does not explain come back to the restored image:
 *
 *   r = x - m                     m: what the PSF makes of the network's image
 *   g = G * (w r) / G * w         w = 1 / (variance of the pixel + (0.3 m)^2), 0 under the mask
 *   l = g + G * (w (r - g)) / G * w   (twicing: Tukey 1977)
 *   L = l4 + S (l - l4)           l4: as g, with a Gaussian four times as wide
 *
 * G: a Gaussian of sigma max(5 pixels, 1.7 FWHM), on cells of 8 pixels and bilinear between their centres (both
 * are counted in its sigma). A cell has Huber's mean of its pixels, which follows dark and bright sky of any
 * depth, and where a pixel more than 5 of its sigmas away counts as one at 5.
 *
 * Twice: g spreads what it gives back over more than the source. Of discs of effective radius 10 pixels and 26 mag/arcsec^2 the light within
 * 20 pixels is 0.95 with g, 0.98 with l, on the SDSS frame 0.94 and 0.96; of 27 0.90 and 0.95, 0.87 and 0.92 (validation/discs.py, seed 71).
 *
 * S, from 0 to 1: where the data show light or dark structure. g of an empty sky is noise: 0.056 sigmas with sigma 5, and l 1.3 times that,
 * more than what the network itself leaves there. S is therefore 0 where the data, under a Gaussian of sigma and of
 * 2 sigma, are nowhere within one such sigma more than 2 of its standard errors from the sky, and 1 where they are
 * by 3; smoothed by G. The data, not the residual: around a source that the network explains, what it does not
 * explain of its outskirts comes back whole. A cell counts for 1 sigma a pixel at most, or a bright star
 * would be light as far as the Gaussian goes. l4 everywhere, so that the mean of the sky is that of the data. A garrote
 * on l in place of S takes 0.05 to 0.2 of the light of galaxies of 24 and 25 mag/arcsec^2.
 *
 * 0.3 m: so that bright stars, whose models are never exact, say little of the sky around them. 40 stars of up to
 * 13,000 sigmas, FWHM 4, restored with a PSF of FWHM 4.3: |L| is up to 13.8 sigmas without it, 3.0 with 0.02 m, 0.6
 * with 0.3 m. Without stars it costs nothing but a mean that is lower by 0.001 sigmas (0.007 with 1 m). Boxes of 32
 * pixels below the sky come back by 90 to 95 % (dark clouds, M67), those of a tenth of the noise
 * by 71 to 72 % (SDSS frame, HST; validation/results/low_frequencies). */
#ifndef RX_RESTORE_NETWORK_SKY_H
#define RX_RESTORE_NETWORK_SKY_H

#include "restore/network_data.h"

/* L of m[height][width], noise units; fwhm: of the PSF, pixels. The same bytes for any nthreads. Errors:
 * RX_SYSTEM. */
rx_status rx_network_sky(const rx_network_input *input, const float *m, double fwhm, int nthreads,
                         rx_coarse *dst, rx_error *err);

/* Noise units become ADU: pixels = scale (pixels + L), 0 under the mask but in gaps; reblurred (NULL: not requested) =
 * scale (m + L), m itself or another plane. chi2 = mean over good pixels of (x - m - L)^2 / variance, that of the sky and of the model's
 * photons (image->gain); NAN without good pixels. Errors: RX_SYSTEM. */
typedef struct rx_network_adu {
    float *pixels, *reblurred;
    double chi2;
} rx_network_adu;
rx_status rx_network_sky_add(const rx_network_input *input, const float *m, const rx_coarse *sky,
                             int nthreads, rx_network_adu *dst, rx_error *err);

#endif
