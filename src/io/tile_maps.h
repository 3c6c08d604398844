/* The maps that go with a tile: weights and flags. For io/ alone. */
#ifndef RX_IO_TILE_MAPS_H
#define RX_IO_TILE_MAPS_H

#include "io/fits_file.h"
#include "io/tile.h"

/* What is asked for, so that the companions of the same HDU and section are taken. */
typedef struct rx_tile_place {
    const rx_fits_name *name; /* of the tile */
    int hdu;
    int extension;        /* from 1 among the HDUs processed */
    rx_fits_shape shape;  /* of the whole HDU */
    rx_fits_section part; /* that is read */
} rx_tile_place;

/* Fill tile->weight, tile->weight_type, tile->flagmaps and RX_MASK_WEIGHT from WEIGHT_IMAGE and the FLAG_IMAGE list, and
 * tile->restored and its noise from RESTORED_NAME and RESTORED_NOISE. With
 * par->own_maps and both a MASK and a VARIANCE beside the image the variance becomes the weight map, and what the mask's
 * header calls BAD, CR, NO_DATA (no data) or SAT (saturated) joins tile->mask. */
rx_status rx_tile_add_maps(const rx_tile_params *par, const rx_tile_place *place, rx_log *log, rx_tile *tile,
                           rx_error *err);

/* The weights from the caller's array, of which a copy is taken; NULL: none. Errors: RX_USAGE (a map without a type, a type
 * without a map), RX_SYSTEM. */
rx_status rx_tile_take_weight(const rx_tile_params *par, const float *weight, rx_tile *tile, rx_error *err);

#endif
