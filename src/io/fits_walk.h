/* A look at the headers of a FITS file before cfitsio goes there, for what it does not survive. Private to
 * io/. */
#ifndef RX_IO_FITS_WALK_H
#define RX_IO_FITS_WALK_H

#include <fitsio.h>

#include <stdbool.h>
#include <stdint.h>

#include "base/error.h"

/* What decides where the next header begins (FITS standard 4.0, section 4.4.1). */
typedef struct rx_fits_layout {
    int64_t bitpix, naxis, product, pcount, gcount;
    bool no_tile;            /* a ZTILEn below 1 */
    bool rice, no_block;     /* ZCMPTYPE is Rice's; ZVAL1, for Rice pixels of a block, is below 1 */
    bool too_long;           /* a value is longer than any of its kind */
    int cards;               /* so far */
    bool is_table, no_table; /* XTENSION says so; the cards that must come first do not */
} rx_fits_layout;

/* Begin a header; take one of its cards (80 characters, none is END); bytes of the data behind it, in whole
 * blocks of 2880, -1 when they make no sense. */
rx_fits_layout rx_fits_layout_begin(void);
void rx_fits_layout_card(rx_fits_layout *layout, const char *card);
int64_t rx_fits_layout_bytes(const rx_fits_layout *layout);

/* What is wrong with a header so that cfitsio must not see it, after its last card; NULL: nothing. */
const char *rx_fits_layout_fault(const rx_fits_layout *layout);

/* RX_INPUT when a compressed image has a tile (ZTILEn), or a block of Rice's, of no or negative size: cfitsio
 * divides by it as soon as it moves to the HDU; when a table does not begin with the cards that it must begin
 * with (standard 4.0, sections 7.2.1 and 7.3.1): cfitsio then asks for memory by a number that it never read;
 * or when a value is too long for cfitsio's memory or its message. They look at each header before cfitsio
 * does; where one makes no sense the walk ends, and cfitsio says what is wrong.
 *
 * rx_fits_walk() is for before a file is opened; it finds nothing in one that is packed as a whole, whose
 * primary header cfitsio reads on opening. rx_fits_walk_open() goes through the other headers of a file just
 * opened, to where cfitsio takes them to be, and back to the first HDU. */
rx_status rx_fits_walk(int file, const char *path, rx_error *err);
rx_status rx_fits_walk_open(fitsfile *file, const char *path, rx_error *err);

/* How many bytes from its beginning a file must have so that the walk through its headers can go on, when
 * `size` of them are there; no more than `size` where it has ended. *place, 0 at first, is where it goes on
 * with more bytes. */
int64_t rx_fits_walk_selected(int file, int64_t size, int64_t *place);

/* Is it the disk that makes cfitsio fail with that status? Then nothing more may be read: cfitsio keeps the
 * block that it could not read as if it had. */
bool rx_fits_is_unreadable(int failed);

#endif
