/* Is a gain one that the pixels of a tile can have?
 *
 * Too small: it claims photon noise of sources that is not there. Of 3 x 3 pixels whose mean M is above the sky, the cross
 * difference (weights 1 -2 1 times 1 -2 1; Immerkaer 1996, CVIU 64, 300) has the variance
 *
 *   V = V_sky (1 + q),   q = M / (gain W^2 sigma^2)     W: noise of wide sums over that of independent pixels
 *
 * and what light adds by its curvature: V is the least that it can be. Photons make q the same for all pixels of one M however
 * the image was resampled. Where q is 3 or more, half the expected scatter or less has a chance of P = 0.264 (a normal deviate
 * below 0.337): the gain cannot be where k > n / 2 of n such pixels have it and this many or more have a chance below
 * exp(-n D(k / n, P)) < 1e-6, D the relative entropy (Chernoff 1952, Ann. Math. Stat. 23, 493). So it is one that claims four
 * times the photon noise there is, or more; less than that is left to errors. Curvature hides it where it is bright and sharp: all of
 * these pixels are asked, and those below 2, 4, 8, ... times the faintest light.
 *
 * Too large: a sky that is in the pixels (its level is above 30 sigma) has 100 times the noise of its photons, or more, in variance.
 * Read noise would be ten times the sky's, and of 3000 electrons at least, which no detector has. */
#ifndef RX_DETECT_PHOTONS_H
#define RX_DETECT_PHOTONS_H

#include "base/error.h"
#include "data/image.h"

typedef struct rx_photon_test {
    int impossible; /* -1: the gain is too small, 1: too large, 0: it may be right */
    long n, quiet;  /* bright pixels looked at; those with less than half of the expected scatter */
    double ratio;   /* variance of the sky over that of its photons */
} rx_photon_test;

/* image: with sky and noise, level the mean sky (ADU); its correlation decides W, the most that resampling gives where it was
 * not measured. Errors: RX_SYSTEM. */
rx_status rx_photons_test(const rx_image *image, double level, const rx_noise_correlation *noise,
                          rx_photon_test *dst, rx_error *err);

#endif
