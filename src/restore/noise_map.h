/* Noise for detection on a restored image.
 *
 * A restorer that knows what the sky looks like leaves next to none of its noise on empty sky: so many sigmas
 * of that say nothing. What a threshold has to be compared with is the noise of the input, and beside bright
 * objects what the restorer makes of their wings:
 *
 *   sigma(x) sqrt(1 + (0.1 env(x))^2)
 *   env = Gaussian of sigma 1.5 pixels * max((pixels - level) / sigma, 0)
 *
 * (an empirical law from prototypes; what thresholds in its units give is measured by the detection
 * campaign). */
#ifndef RX_RESTORE_NOISE_MAP_H
#define RX_RESTORE_NOISE_MAP_H

#include <stdint.h>

#include "base/error.h"
#include "data/image.h"
#include "data/map.h"

/* *dst makes `factor` times that, ADU, of an image whose owners must live as long; to be freed with free().
 * mask: the one that a restorer honoured (non-zero: hidden; NULL: nothing is), in place of the image's; hidden
 * pixels are not looked at, the sigma around them stays as it is, but the light of RX_MASK_UNTOUCHED counts.
 * A row by itself costs what 17 do. More than nthreads threads at once wait for each other. Errors:
 * RX_SYSTEM. */
rx_status rx_noise_map(const rx_image *image, const uint8_t *mask, float factor, int nthreads,
                       rx_map_maker **dst, rx_error *err);

#endif
