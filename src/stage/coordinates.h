/* World coordinates of every source from the tile's WCS. */
#ifndef RX_STAGE_COORDINATES_H
#define RX_STAGE_COORDINATES_H

#include "base/error.h"
#include "data/sources.h"
#include "data/tile.h"

/* Fill alpha, delta and their J2000 and windowed forms (deg) and the local matrix; all NAN
 * where the tile has no celestial coordinates. Error: RX_SYSTEM without memory. */
rx_status rx_coordinates_fill(const rx_tile *tile, rx_sources *sources, rx_error *err);

#endif
