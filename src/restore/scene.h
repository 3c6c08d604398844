/* A tile made ready for Richardson-Lucy: data above a pedestal, weights, noise.
 *
 * Richardson-Lucy is the maximum-likelihood iteration for Poisson noise, whose variance is
 * proportional to the value. The sky-subtracted data get a pedestal p (ADU) such that this is so:
 *
 *   var(d) = sigma^2 + (d - p) / gain = d / gain     when  p = gain sigma^2,
 *
 * the sky as it was in electrons. Where that is small against the noise (or the gain is 0 = no
 * photon noise known), p = RL_PEDESTAL sigma, at least 1 sigma, so that d < 0, which has
 * to be cut, is rare enough for the sky level to survive. One p serves the whole tile, as K p = p
 * only for a constant; where sigma varies, it comes from the 98 % quantile of sigma over good
 * pixels, at most three times the median. The pixels' own sigma enters the relative weights
 * W = min(1, (median sigma / sigma)^2), which decide between neighbours only, as the
 * update is normalised by K^T W.
 *
 * Working unit: the pedestal. The sky is 1, sources are above it, whatever the unit of the
 * file, so that squares neither overflow nor vanish in single precision. */
#ifndef RX_RESTORE_SCENE_H
#define RX_RESTORE_SCENE_H

#include "base/error.h"
#include "data/tile.h"
#include "restore/restore.h"

typedef struct rx_scene {
    int width, height, nthreads;
    float *data;     /* [height][width], (pixel - level) / p + 1, cut to 0 .. 1e7; 0 under the mask */
    float *weight;   /* [height][width], W; 0 under the mask */
    float *variance; /* [height][width], of the sky's noise, (sigma / p)^2; 1 under the mask */
    uint8_t *mask;   /* [height][width], the tile's bits as far as honoured */
    double pedestal; /* p, ADU */
    double photon;   /* 1 / (gain p), 0 without gain: var = variance + photon max(value - 1, 0) */
    double sigma;    /* median over good pixels, in units of p */
    float peak;      /* largest value of data */
    size_t good;     /* pixels that are not masked */
} rx_scene;

rx_status rx_scene_new(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                       rx_scene **dst, rx_error *err);
void rx_scene_free(rx_scene *scene);

#endif
