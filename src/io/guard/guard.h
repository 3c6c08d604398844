/* What keeps hostile files from cfitsio, and hostile headers from wcslib: both trust what they read and end in a
 * crash, an endless loop or all memory where it is damaged. docs/upstream.md has each cause, for those who could mend
 * it there. Private to io/. */
#ifndef RX_IO_GUARD_GUARD_H
#define RX_IO_GUARD_GUARD_H

#include <fitsio.h>

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/error.h"
#include "base/text.h"
#include "io/fits_file.h"

/* --- walk.c: a look at the headers of a FITS file before cfitsio goes there --- */

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

/* --- unpack.c: files packed with gzip, bzip2 or compress --- */

/* Writes to the empty file `to`, and counts in *size, the bytes that the headers of the packed file announce;
 * what it unpacks to beyond them, which may be gigabytes out of kilobytes, is left where it is. Errors:
 * RX_INPUT (cannot be opened, cut off, damaged), RX_SYSTEM. */
rx_status rx_fits_unpack(const char *path, int to, int64_t *size, rx_error *err);

/* Could so much memory be had? Files in memory grow past every limit of a process, until the system kills
 * one. RX_SYSTEM: no. */
rx_status rx_fits_ask_memory(int64_t bytes, rx_error *err);

/* --- tiles.c: damaged compressed images, whose bytes cfitsio trusts and reads beyond --- */

/* Of the current HDU, a compressed image: every tile lies in the heap; a Rice stream (FITS 4.0, 10.4.1), a
 * gzip stream and plain pixels hold as many as their tile, a PLIO list ends where it should, an HCOMPRESS
 * stream too. RX_INPUT otherwise. */
rx_status rx_fits_check_tiles(fitsfile *file, const char *path, int hdu, const rx_fits_shape *shape,
                              rx_error *err);

/* --- hcompress.c: streams that are cut off, behind which cfitsio reads on --- */

/* Walks through a stream (R. L. White 1992, Proc. NASA Space and Earth Science Data Compression Workshop;
 * FITS 4.0, 10.4.4) as its reader would, without making the pixels. *used: bytes that a reader takes from it,
 * 0 where it is cut off, has other than `pixels` pixels, or is no such stream. RX_SYSTEM without memory. */
rx_status rx_hcompress_walk(const unsigned char *data, size_t length, int64_t pixels, size_t *used,
                            rx_error *err);

/* --- wcs.c: damage that would make wcslib read beyond its memory is taken out, what writers usually mean is put in --- */

/* Change cards in place; what was changed in a way that users should know goes to the note. 0: distortions
 * that cannot be applied here, and there are no world coordinates. */
int rx_wcs_guard(char *cards, size_t ncards, rx_text *note);

/* Append a text, behind "; " where there is one before. NULL is fine. */
void rx_wcs_note(rx_text *note, const char *text);

#endif
