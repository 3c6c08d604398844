/* Sky level and noise maps, weights turned into noise as SExtractor does. */
#ifndef RX_DETECT_BACKGROUND_H
#define RX_DETECT_BACKGROUND_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/image.h"
#include "detect/params.h"

RX_BEGIN_DECLS

/* Background of the image's pixels, to be read through data/map.h; what the image says of sky and noise is not
 * looked at. Hidden pixels are ignored to the bit; the mask must live as long as the result. Every pixel has a
 * level and a sigma, which is 0 for hidden ones. Both are surfaces through the meshes, without a plane; with a
 * weight type sigma is a plane.
 *
 * sigma: no weight (NULL) or RX_WEIGHT_BACKGROUND, the image's own rms map; MAP_RMS, the map;
 * MAP_VAR and MAP_WEIGHT, f sqrt(var) and f / sqrt(weight) with f the median over the meshes of
 * (rms of the image) / sqrt(typical variance of the map), as SExtractor scales them (f = 1 and
 * global_sigma / f with no_rescale). Weights <= 0 of MAP_WEIGHT must be hidden.
 * passes 2: once more from the pixels without sources. These are out of reach of what stands 3 sigmas out of the
 * image after a Gaussian of sigma 2 pixels, above its own mesh or below it: on empty sky as many pixels go on
 * either side, and the level stays. Reach: 2 pixels in x and in y.
 *
 * An image without noise (constant) gets sigma 1, as in SExtractor; a tile without one good pixel level 0,
 * sigma 0, global_sigma 1. Both say so (constant).
 *
 * The result belongs to the caller (rx_background_free). Errors: RX_USAGE for senseless params,
 * RX_SYSTEM without memory. */
rx_status rx_background_measure(const rx_background_params *par, const rx_image *image, rx_background **dst,
                                rx_error *err);

RX_END_DECLS

#endif
