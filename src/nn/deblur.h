/* Linear optics around the network: the tile's PSF O against the target PSF K (Gaussian of target_fwhm,
 * integrated over the pixel; num/convolve.h rx_gauss_weights()).
 *
 *   Tikhonov copy   w  = F^-1[ (1 + epsilon) conj(O) K / (|O|^2 + epsilon) F x ]
 *                   the input brought near the target
 *   relative PSF    K' = F^-1[ (1 + delta) O conj(K) / (|K|^2 + delta) ], cut to a stamp
 *                   K' * (target PSF) = O
 *
 * The factors before the fractions make both keep the flux of a PSF of sum 1. Stamps are odd, centred in
 * pixel (size/2, size/2). K' is linear in O, so it can be made basis image by basis image of a varying PSF
 * (then without "sum 1").
 *
 * delta = 1e-4. For round Moffat PSFs integrated over the pixel and a target of 2 pixels:
 *
 *   FWHM of O                     2      2.25    2.5     3       4       6        8
 *   |K' * K - O| / peak, beta 3   1.4 %  0.9 %   0.5 %   0.21 %  0.04 %  0.005 %  0.002 %
 *                        beta 5   1.2 %  0.7 %   0.4 %   0.14 %  0.02 %  0.004 %  0.002 %
 *   lowest pixel / peak of K'     -5 %   -1.2 %  -0.2 %  0 from here on
 *
 * and |K'^| <= 1 at every frequency. With delta 1e-5, |O/K| comes through near the corner of the frequency
 * plane when FWHM is the target's (gain 1.4, lobes of -8 %); with 1e-3 the error at 2 pixels is 5 %. */
#ifndef RX_NN_DEBLUR_H
#define RX_NN_DEBLUR_H

#include "base/error.h"
#include "num/fft.h"

/* relative[out_size][out_size] from psf[size][size]. normalise: 1 = sum 1. Errors: RX_INPUT when the PSF is
 * not finite, or (normalise) its sum not positive, RX_SYSTEM. */
rx_status rx_deblur_relative(const float *psf, int size, double target_fwhm, int out_size, int normalise,
                             float *relative, rx_error *err);

/* Smallest odd stamp that holds all but 1e-3 of |K'| of that PSF, at most `largest`. */
rx_status rx_deblur_relative_size(const float *psf, int size, double target_fwhm, int largest, int *dst,
                                  rx_error *err);

typedef struct rx_tikhonov {
    double target_fwhm, epsilon;
    int relative; /* 1: the stamp is the relative PSF, O = K' * K */
} rx_tikhonov;

/* spectrum (complex plane of fft, made by the caller) of the Tikhonov filter, ready for rx_convolve():
 * includes 1/(width height). The stamp must fit into the domain. Its adjoint is rx_correlate(). Errors:
 * RX_INPUT (a PSF that is not finite, or larger than the domain), RX_SYSTEM. */
rx_status rx_deblur_tikhonov(const rx_fft *fft, const float *stamp, int size, const rx_tikhonov *filter,
                             float *spectrum, rx_error *err);

/* How far the Tikhonov filter reaches (in x or y): beyond it the filter's values sum (absolutely) to less
 * than 1e-3, for epsilon 0.02 and Moffat PSFs of FWHM up to 8, beta 3 to 5: 8e-4 at FWHM 8 and beta 3 (where
 * all of it sums to 7), 2e-4 at FWHM 6, 3e-5 at 4. */
enum { RX_TIKHONOV_REACH = 48 };

#endif
