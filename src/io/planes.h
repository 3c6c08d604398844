/* Files in which an image and its maps stand side by side, known by EXTNAME. For io/ alone. */
#ifndef RX_IO_PLANES_H
#define RX_IO_PLANES_H

#include <stdbool.h>

#include "base/log.h"
#include "io/fits_file.h"
#include "io/tile_weight.h"

/* EXTNAME and EXTVER of the HDU, "" and 0 without; those of a compressed image are its own. The file is left at another HDU. */
enum { RX_EXTNAME = 72 };
typedef struct rx_plane_name {
    char name[RX_EXTNAME];
    int version;
} rx_plane_name;
rx_status rx_planes_name(fitsfile *file, const char *path, int hdu, rx_plane_name *dst, rx_error *err);

/* Have both a name, the same, and the same version unless one states none? */
bool rx_planes_same(const rx_plane_name *a, const rx_plane_name *b);

/* Of the images hdus[*n] of a file those stay that are no maps of another one, unless all are maps; the log names what
 * went, and the keywords that take it. */
rx_status rx_planes_keep_images(fitsfile *file, const char *path, rx_log *log, int *hdus, int *n,
                                rx_error *err);

/* HDUs of the MASK and the VARIANCE of the image at `hdu`, if its EXTNAME is IMAGE and both are there, as Rubin's pipelines
 * and HSC's write; else -1 and -1. Of several images each has the maps before the next one. The file is left at another HDU. */
rx_status rx_planes_find(fitsfile *file, const char *path, int hdu, int *mask, int *variance, rx_error *err);

/* Of an image with both the variance becomes the tile's weight map, and what the mask's header calls BAD, CR, NO_DATA
 * (no data) or SAT (saturated) joins tile->mask. Of other files nothing. Errors: as of rx_tile_add_weight(). */
rx_status rx_planes_add(const rx_tile_params *par, fitsfile *file, const rx_tile_place *place, rx_log *log,
                        rx_tile *tile, rx_error *err);

#endif
