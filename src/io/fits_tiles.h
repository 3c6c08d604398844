/* Damaged compressed images: cfitsio trusts the bytes of a compressed tile and may read beyond
 * them, so the tiles are walked through before it sees them. For io/ alone. */
#ifndef RX_IO_FITS_TILES_H
#define RX_IO_FITS_TILES_H

#include "io/fits_file.h"

/* Of the current HDU, a compressed image: every tile lies in the heap; a Rice stream (FITS 4.0, 10.4.1), a
 * gzip stream and plain pixels hold as many as their tile, a PLIO list ends where it should, an HCOMPRESS
 * stream (io/fits_hcompress.h) too. RX_INPUT otherwise. */
rx_status rx_fits_check_tiles(fitsfile *file, const char *path, int hdu, const rx_fits_shape *shape,
                              rx_error *err);

#endif
