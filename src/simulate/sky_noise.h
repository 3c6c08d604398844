/* The noise of a real tile: its width per pixel and its correlation, measured on source-free pixels, and
 * realisations of it without any source. */
#ifndef RX_SIMULATE_SKY_NOISE_H
#define RX_SIMULATE_SKY_NOISE_H

#include <stdint.h>

#include "base/error.h"
#include "data/map.h"

enum { RX_NOISE_LAGS = 4 };

/* z = (pixels - mean) / sigma over the used pixels. Of them those within 4 robust sigmas count, for what is
 * left of sources and cosmic rays would raise every lag; a normal distribution so cut is 0.05 % too narrow,
 * which is put right in `scale` and leaves correlations alone.
 *
 * correlation(d) = mean of z(p) z(p + d) over pairs of used pixels, divided by the mean of z^2. Two things
 * raise or lower all lags alike: sky subtraction takes away the sum of all correlations over the pixels of a
 * background mesh (2e-4 for white noise and 64 x 64 meshes, 0.004 for 16 x 16 ones), and sources too faint to
 * be found add some (0.01 on an SDSS frame). So the mean of the outermost lags is taken for that floor, and
 * removed from correlation and scale; unless it is beyond 0.05, which only noise correlated beyond
 * RX_NOISE_LAGS can be. */
typedef struct rx_sky_noise {
    /* at lags dy 0..LAGS, dx -LAGS..LAGS in [dy][dx + RX_NOISE_LAGS]; 1 at (0, 0) */
    double correlation[RX_NOISE_LAGS + 1][2 * RX_NOISE_LAGS + 1];
    double error;   /* 1 sigma of one of them: sqrt(sum of squared correlations / pixels) (Bartlett 1946) */
    double scale;   /* width of z: 1 when sigma is the noise */
    long pixels;    /* behind the measurement */
    int correlated; /* any lag beyond 4 errors and 0.02 */
} rx_sky_noise;

/* pixels: sky subtracted; sigma: noise per pixel (> 0 where used); used: 0 = a source or masked, and kept
 * out. All [height][width]. Errors: RX_INPUT with fewer than 1000 used pixels, RX_SYSTEM memory. */
rx_status rx_sky_noise_measure(int width, int height, const float *pixels, const rx_map *sigma,
                               const unsigned char *used, rx_sky_noise *dst, rx_error *err);

/* dst = one realisation: scale * sigma(x, y) times unit noise with that correlation (white when not
 * `correlated`); 0 where sigma is. Correlated noise is white noise filtered with the root of the power
 * spectrum, the Fourier transform of the correlation; where that is negative (lags beyond RX_NOISE_LAGS were
 * cut off, or measured with error) it counts as 0, and what is left is scaled to the variance asked for: such
 * a correlation is met as nearly as a possible one can. */
rx_status rx_sky_noise_draw(const rx_sky_noise *noise, int width, int height, const rx_map *sigma,
                            uint64_t seed, uint64_t stream, int nthreads, float *dst, rx_error *err);

#endif
