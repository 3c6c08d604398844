/* Files in which an image and its maps stand side by side, known by EXTNAME. For io/ alone. */
#ifndef RX_IO_PLANES_H
#define RX_IO_PLANES_H

#include "base/log.h"
#include "io/fits_file.h"
#include "io/tile_weight.h"

/* EXTNAME of the HDU, "" without one; that of a compressed image is its own. The file is left at another HDU. */
enum { RX_EXTNAME = 72 };
rx_status rx_planes_name(fitsfile *file, const char *path, int hdu, char dst[RX_EXTNAME], rx_error *err);

/* Of the images hdus[*n] of a file those stay that are no maps of another one, unless all are maps; the log names what
 * went, and the keywords that take it. */
rx_status rx_planes_keep_images(fitsfile *file, const char *path, rx_log *log, int *hdus, int *n,
                                rx_error *err);

/* HDUs of the MASK and the VARIANCE beside an image of this EXTNAME, if it is IMAGE and both are there, as Rubin's pipelines
 * and HSC's write; else -1 and -1. The file is left at another HDU. */
rx_status rx_planes_find(fitsfile *file, const char *path, const char *extname, int *mask, int *variance,
                         rx_error *err);

/* Of an image with both the variance becomes the tile's weight map, and what the mask's header calls BAD, CR, NO_DATA
 * (no data) or SAT (saturated) joins tile->mask. Of other files nothing. Errors: as of rx_tile_add_weight(). */
rx_status rx_planes_add(const rx_tile_params *par, fitsfile *file, const rx_tile_place *place, rx_log *log,
                        rx_tile *tile, rx_error *err);

#endif
