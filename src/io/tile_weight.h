/* The maps that go with a tile: weights and flags. For io/ alone. */
#ifndef RX_IO_TILE_WEIGHT_H
#define RX_IO_TILE_WEIGHT_H

#include "io/fits_file.h"
#include "io/tile.h"

/* What is asked for, so that the companions of the same HDU and section are taken. */
typedef struct rx_tile_place {
    const rx_fits_name *name; /* of the tile */
    int hdu;
    int extension;        /* from 1 among the HDUs processed */
    long full[2];         /* axes of the whole HDU */
    rx_fits_section part; /* that is read */
} rx_tile_place;

/* Fill tile->weight, tile->weight_type and RX_MASK_WEIGHT; nothing for NONE and BACKGROUND. */
rx_status rx_tile_add_weight(const rx_tile_params *par, const rx_tile_place *place, rx_tile *tile,
                             rx_error *err);

/* The same from the caller's array, of which a copy is taken; NULL: none. Errors: RX_USAGE (a map without a type, a type
 * without a map), RX_SYSTEM. */
rx_status rx_tile_take_weight(const rx_tile_params *par, const float *weight, rx_tile *tile, rx_error *err);

/* Flags of the tile's pixels from a map of integers, dst [height][width]. */
rx_status rx_tile_read_flags(const char *name, const rx_tile_place *place, uint32_t *dst, rx_error *err);

/* rx_tile_list() with the maps of other images. */
rx_status rx_tile_list_all(const char *name, rx_log *log, int **hdus, int *n, rx_error *err);

/* Fill tile->flagmaps from the FLAG_IMAGE list. */
rx_status rx_tile_add_flags(const rx_tile_params *par, const rx_tile_place *place, rx_tile *tile,
                            rx_error *err);

#endif
