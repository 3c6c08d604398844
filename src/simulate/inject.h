/* Injection: objects of known flux added to real pixels, with the photon noise they bring along. */
#ifndef RX_SIMULATE_INJECT_H
#define RX_SIMULATE_INJECT_H

#include <stdint.h>

#include "base/error.h"
#include "simulate/optics.h"
#include "simulate/scene.h"

/* pixels [height][width] (ADU) += scene through optics, with Poisson noise of the added light for that gain
 * (e-/ADU; 0 = infinite gain, no noise). Pixels that reach `saturation` stop there. */
rx_status rx_inject(const rx_scene *scene, const rx_optics *optics, double gain, double saturation,
                    uint64_t seed, uint64_t stream, int nthreads, float *pixels, rx_error *err);

typedef enum rx_inject_place {
    RX_INJECT_AWAY,  /* not on and not within `distance` of a known source or a masked pixel */
    RX_INJECT_AMONG, /* anywhere that is not masked: what a real source would meet */
} rx_inject_place;

/* allowed[height][width] for rx_scene_params. segments: 0 = sky; mask: not 0 = bad; both may be NULL. */
rx_status rx_inject_allowed(rx_inject_place place, int width, int height, const int32_t *segments,
                            const uint8_t *mask, double distance, unsigned char *allowed, rx_error *err);

#endif
