/* How faint an image is beside its noise: the one scale of the trainer (SIGMA_RANGE), of a model's dictionary, of a
 * tile's domain (RXNETNOI) and of the bins of the restoration campaign.
 *
 *   B = max(q, p / 40)    brightness: q the value that the brightest 0.1 % of the pixels exceed (quantile 0.999, linear
 *                         between pixels as rx_quantile()), p the brightest pixel; all in units of the noise
 *   N = 255 / B           noise level, without unit: the noise of that image on a scale on which B is 255
 *
 * A pixel counts above the sky, in units of the effective noise: that of independent pixels whose matched filter is as
 * noisy (data/noise_correlation.h), which is what the network's input is in. Trainer and campaign take light without
 * noise; on tiles the noise is in the pixels, and 0.1 % of it exceed 3.1: none has N much above 80.
 *
 * What is inside a training for levels N1 to N2: B is that of whole fields, and what the network sees of them, a
 * patch, may have any of it: half of the patches of fields of N 12 to 15 are above 15, one in fourteen above 130, as
 * good as empty (tests/unit/train/test_samples_light). So a model knows every B up to 255 / N1, pixels up to 40 times
 * that, and no tile is too faint for it; what it did in the bin of N2 is the nearest that is known of fainter ones. */
#ifndef RX_NN_NOISE_LEVEL_H
#define RX_NN_NOISE_LEVEL_H

#include <stddef.h>

#include "base/extern.h"

RX_BEGIN_DECLS

enum { RX_NOISE_LEVEL_SCALE = 255, RX_NOISE_LEVEL_PEAK = 40 };

/* B of light[n], all finite, reordered here; its `few` brightest pixels, which may be a cosmic ray, do not count for p.
 * Units are those of the light. NAN for n = 0. */
double rx_brightness(float *light, size_t n, size_t few);

/* The same of n values by the `top` largest alone: rx_brightness_needs(n) of them at least. */
double rx_brightness_of_top(float *light, size_t top, size_t n, size_t few);
size_t rx_brightness_needs(size_t n);

/* The smallest of the `count` largest of v[n], n > 0, reordered here. */
float rx_upper_value(float *v, size_t n, size_t count);

/* N of B in noise units; infinite where nothing is above the sky, NAN for NAN. */
double rx_noise_level(double brightness);

RX_END_DECLS

#endif
