/* A look at the headers of a FITS file before cfitsio sees them, for what it does not survive. Private to
 * io/. */
#ifndef RX_IO_FITS_WALK_H
#define RX_IO_FITS_WALK_H

#include "base/error.h"

/* RX_INPUT when a compressed image has a tile (ZTILEn) of no or negative size: cfitsio divides by it as soon
 * as it moves to the HDU. Walks uncompressed files from header to header and reads nothing else; where a
 * header makes no sense the walk ends, and cfitsio says what is wrong. */
rx_status rx_fits_walk(const char *path, rx_error *err);

#endif
