/* Injection: objects of known flux added to real pixels, with the photon noise they bring along. */
#ifndef RX_SIMULATE_INJECT_H
#define RX_SIMULATE_INJECT_H

#include <stdint.h>

#include "base/error.h"
#include "data/noise_correlation.h"
#include "simulate/optics.h"
#include "simulate/scene.h"

typedef struct rx_inject_params {
    double gain;       /* e-/ADU; 0 = infinite, no noise */
    double saturation; /* pixels that reach it stop there */
    /* of the tile's noise, NULL = independent: what smoothed it smoothed the photon noise of its sources as well */
    const rx_noise_correlation *noise;
    uint64_t seed, stream;
} rx_inject_params;

/* pixels [height][width] (ADU) += scene through optics, with Poisson noise of the added light; under correlated noise
 * that is convolved with the kernel of sum 1 whose power spectrum is the noise's (simulate/sky_noise.h), so that a
 * flux summed over many pixels scatters by what its electrons say. Errors: RX_SYSTEM, RX_INPUT (no power in the noise). */
rx_status rx_inject(const rx_scene *scene, const rx_optics *optics, const rx_inject_params *par, int nthreads,
                    float *pixels, rx_error *err);

/* allowed[height][width] for rx_scene_params: what is not masked, not on a known source and not within
 * `distance` of either. segments: 0 = sky; mask: not 0 = bad; both may be NULL. Without segments and distance
 * it is what a real source would meet. */
rx_status rx_inject_allowed(int width, int height, const int32_t *segments, const uint8_t *mask,
                            double distance, unsigned char *allowed, rx_error *err);

#endif
