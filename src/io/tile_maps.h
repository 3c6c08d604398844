/* The images of a file, which of them are maps of others, known by EXTNAME, and the maps that go with a tile: weights and
 * flags. For io/ alone. */
#ifndef RX_IO_TILE_MAPS_H
#define RX_IO_TILE_MAPS_H

#include "base/log.h"
#include "io/cards.h"
#include "io/fits_file.h"
#include "io/tile.h"

/* An HDU with its EXTNAME and EXTVER, "" and 0 without; those of a compressed image are its own. */
enum { RX_EXTNAME = RX_CARD - RX_CARD_KEY };
typedef struct rx_image_hdu {
    int hdu;
    char name[RX_EXTNAME];
    int version;
} rx_image_hdu;

typedef struct rx_image_list {
    rx_image_hdu *list;
    int n;
} rx_image_list;

/* The 2-D images of the file, maps as well; dst->list to be freed. No such image: RX_INPUT; HDUs that are skipped are named in
 * the log. */
rx_status rx_images_of_file(const rx_fits_name *name, rx_log *log, rx_image_list *dst, rx_error *err);

/* HDUs of the MASK and the VARIANCE of the image at `hdu`, if its EXTNAME is IMAGE and both are there, as Rubin's pipelines
 * and HSC's write; else -1 and -1. Of several images each has the maps before the next one. */
void rx_images_own_maps(const rx_image_list *all, int hdu, int *mask, int *variance);

/* RX_OK when the HDU of that shape is a 2-D image with pixels, or the section gives a plane of it, else the reason. */
rx_status rx_image_check(const char *path, int hdu, const rx_fits_shape *shape,
                         const rx_fits_section *section, rx_error *err);

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
