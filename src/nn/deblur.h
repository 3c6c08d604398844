/* Linear optics around the network: the tile's PSF O against the target PSF K (Gaussian of target_fwhm,
 * integrated over the pixel; num/convolve.h rx_gauss_weights()).
 *
 *   Tikhonov copy   w = F^-1[ conj(O) K / (|O|^2 + epsilon) F x ]       the input brought near the target
 *   relative PSF    K' = F^-1[ O conj(K) / (|K|^2 + delta) ], cut to a stamp, sum 1: K' * (target PSF) = O
 *
 * Stamps are odd, centred in pixel (size/2, size/2). Both filters are real and, for a round PSF, even. K' is
 * linear in O, so it can be made basis image by basis image of a varying PSF (then without "sum 1"). */
#ifndef RX_NN_DEBLUR_H
#define RX_NN_DEBLUR_H

#include "base/error.h"
#include "num/fft.h"

/* relative[out_size][out_size] from psf[size][size]. delta is chosen in deblur.c and documented there with
 * the error |K' * K - O| it leaves (fraction of the peak of O) for FWHM 2..8. normalise: 1 = sum 1. Errors:
 * RX_INPUT when the PSF is not finite or its sum not positive, RX_SYSTEM. */
rx_status rx_deblur_relative(const float *psf, int size, double target_fwhm, int out_size, int normalise,
                             float *relative, rx_error *err);

/* Smallest odd stamp that holds all but 1e-3 of |K'| of that PSF, at most `largest`. */
rx_status rx_deblur_relative_size(const float *psf, int size, double target_fwhm, int largest, int *dst,
                                  rx_error *err);

/* spectrum (complex plane of fft, made by the caller) of the Tikhonov filter, ready for rx_convolve():
 * includes 1/(width height). `work`: real plane, overwritten. psf must fit into the domain. */
rx_status rx_deblur_tikhonov(const rx_fft *fft, const float *psf, int size, double target_fwhm,
                             double epsilon, float *work, float *spectrum, rx_error *err);

/* How far the Tikhonov filter reaches: beyond it the filter's values sum (absolutely) to less than 1e-3. */
enum { RX_TIKHONOV_REACH = 48 };

#endif
