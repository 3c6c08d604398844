/* A look at the headers of a FITS file before cfitsio sees them, for what it does not survive. Private to
 * io/. */
#ifndef RX_IO_FITS_WALK_H
#define RX_IO_FITS_WALK_H

#include <stdbool.h>
#include <stdint.h>

#include "base/error.h"

/* What decides where the next header begins (FITS standard 4.0, section 4.4.1). */
typedef struct rx_fits_layout {
    int64_t bitpix, naxis, product, pcount, gcount;
    bool no_tile; /* a ZTILEn below 1 */
} rx_fits_layout;

/* Begin a header; take one of its cards (80 characters, none is END); bytes of the data behind it, in whole
 * blocks of 2880, -1 when they make no sense. */
rx_fits_layout rx_fits_layout_begin(void);
void rx_fits_layout_card(rx_fits_layout *layout, const char *card);
int64_t rx_fits_layout_bytes(const rx_fits_layout *layout);

/* RX_INPUT when a compressed image has a tile (ZTILEn) of no or negative size: cfitsio divides by it as soon
 * as it moves to the HDU. Walks uncompressed files from header to header and reads nothing else; where a
 * header makes no sense the walk ends, and cfitsio says what is wrong. */
rx_status rx_fits_walk(const char *path, rx_error *err);

#endif
