/* Realisations of a tile's noise, without any source. */
#ifndef RX_SIMULATE_SKY_NOISE_H
#define RX_SIMULATE_SKY_NOISE_H

#include "base/error.h"
#include "base/random.h"
#include "data/map.h"
#include "data/noise_correlation.h"
#include "num/fft.h"

/* dst = one realisation: noise->scale * sigma(x, y) times unit noise with that correlation (white when not
 * `correlated`); 0 where sigma is. Correlated noise is white noise filtered with the root of the power
 * spectrum, the Fourier transform of the correlation; where that is negative (lags beyond RX_NOISE_REACH were
 * cut off, or measured with error) it counts as 0, and what is left is scaled to the variance asked for: such
 * a correlation is met as nearly as a possible one can. Errors: RX_INPUT (no power at any frequency), RX_SYSTEM. */
rx_status rx_sky_noise_draw(const rx_noise_correlation *noise, const rx_map *sigma, int height,
                            rx_random_stream from, int nthreads, float *dst, rx_error *err);

/* The filter (a complex plane of fft, for rx_fft_filter()) that makes noise of such a correlation, of the same rms, from
 * white noise; plane: a real one for scratch. Errors: RX_INPUT (no power at any frequency). */
rx_status rx_sky_noise_filter(const rx_noise_correlation *noise, const rx_fft *fft, float *plane,
                              float *filter, rx_error *err);

/* pixels [height][width], independent from pixel to pixel, is convolved with the kernel of sum 1 whose power spectrum
 * is that of the noise: sums over many pixels keep their variance, what is at the borders is not wrapped around.
 * Uncorrelated: nothing is done. Errors: RX_INPUT (no power at any frequency), RX_SYSTEM. */
rx_status rx_sky_noise_smooth(const rx_noise_correlation *noise, int width, int height, int nthreads,
                              float *pixels, rx_error *err);

#endif
