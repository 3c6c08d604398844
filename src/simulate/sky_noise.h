/* The noise of a real tile: its width per pixel and its correlation, measured on source-free pixels, and
 * realisations of it without any source. */
#ifndef RX_SIMULATE_SKY_NOISE_H
#define RX_SIMULATE_SKY_NOISE_H

#include <stdint.h>

#include "base/error.h"

enum { RX_NOISE_LAGS = 4 };

typedef struct rx_sky_noise {
    /* correlation [dy][dx + RX_NOISE_LAGS] of (pixel - level) / sigma at lags dy 0..LAGS, dx -LAGS..LAGS; 1
     * at (0, 0) */
    double correlation[RX_NOISE_LAGS + 1][2 * RX_NOISE_LAGS + 1];
    double error;   /* 1 sigma of one of them */
    long pixels;    /* behind the measurement */
    int correlated; /* any lag beyond 4 sigma and 0.02 */
} rx_sky_noise;

/* pixels: sky subtracted; sigma: noise per pixel; used: 0 = a source or masked, and kept out. All
 * [height][width]. */
rx_status rx_sky_noise_measure(int width, int height, const float *pixels, const float *sigma,
                               const unsigned char *used, rx_sky_noise *dst, rx_error *err);

/* dst = one realisation: sigma(x, y) times unit noise with that correlation (white when not `correlated`). */
rx_status rx_sky_noise_draw(const rx_sky_noise *noise, int width, int height, const float *sigma,
                            uint64_t seed, uint64_t stream, int nthreads, float *dst, rx_error *err);

#endif
