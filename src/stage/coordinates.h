/* World coordinates of every source from the image's WCS. */
#ifndef RX_STAGE_COORDINATES_H
#define RX_STAGE_COORDINATES_H

#include "base/error.h"
#include "data/image.h"
#include "data/sources.h"

/* Fill alpha, delta and their J2000 and windowed forms (deg) and the local matrix; all NAN
 * where the image has no celestial coordinates. Error: RX_SYSTEM without memory. */
rx_status rx_coordinates_fill(const rx_image *image, rx_sources *sources, rx_error *err);

#endif
