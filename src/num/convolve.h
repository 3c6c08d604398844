/* Convolution on the cyclic domain of an rx_fft, and a Gaussian smoothing that knows masks.
 *
 * A stamp k of odd size s is centred in pixel (s/2, s/2); on the domain
 *   convolve:  dst(x) = sum_u k(u) src(x - u)      correlate:  dst(x) = sum_u k(u) src(x + u)
 * with indices cyclic in width and height. The two are adjoint to each other. Nothing here
 * allocates but rx_gauss_masked(); the same bytes for any number of threads. */
#ifndef RX_NUM_CONVOLVE_H
#define RX_NUM_CONVOLVE_H

#include <stdbool.h>
#include <stdint.h>

#include "num/fft.h"

/* spectrum (a complex plane) of the stamp[size][size], centre moved to the origin, divided
 * by width*height so that the unnormalised inverse needs no further factor. size <= width,
 * height; odd. */
void rx_convolve_spectrum(const rx_fft *fft, const float *stamp, int size, float *spectrum);

/* dst (+)= kernel * src, conj(kernel) * src when `conjugate`; dst may be src. */
void rx_convolve_multiply(const rx_fft *fft, const float *kernel, const float *src, bool conjugate, bool add,
                          float *dst);

/* dst = (1 + delta) numerator conj(denominator) / (|denominator|^2 + delta): the kernel that blurs an image
 * of PSF `denominator` to PSF `numerator`, as far as the denominator passes light (Tikhonov; the factor keeps
 * the sum of 1). All three are complex planes, of rx_convolve_spectrum() but for dst's factor 1/(width
 * height), which it has as well; dst may be the numerator. */
void rx_convolve_divide(const rx_fft *fft, const float *numerator, const float *denominator, double delta,
                        float *dst);

/* Real planes src, dst (may be the same); `half` is a complex plane for scratch. */
void rx_convolve(const rx_fft *fft, const float *kernel, const float *src, float *half, float *dst);
void rx_correlate(const rx_fft *fft, const float *kernel, const float *src, float *half, float *dst);

/* One dimension of a Gaussian of that FWHM (pixels, > 0) integrated over pixels:
 * weights[2*radius+1], sum 1, radius = rx_gauss_radius(fwhm) >= 4 sigma. */
int rx_gauss_radius(double fwhm);
void rx_gauss_weights(double fwhm, int radius, float *weights);

/* Normalised convolution (Knutsson and Westin 1993) of image[height][width] in place with
 * a Gaussian: sum G f / sum G over the pixels with mask 0 (mask NULL: all) inside the
 * image. Masked values are never used and become 0. fwhm <= 0 smooths nothing.
 * Errors: RX_SYSTEM without memory. */
rx_status rx_gauss_masked(int width, int height, double fwhm, const uint8_t *mask, int nthreads, float *image,
                          rx_error *err);

#endif
