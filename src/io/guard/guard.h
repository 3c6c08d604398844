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

/* --- header.c: headers as cfitsio may see them --- */

/* Does cfitsio end a header with the card? "END / of it" is one for it, too. */
bool rx_fits_is_end(const char *card);

typedef struct rx_fits_header {
    rx_text cards;   /* without END */
    bool is_rebuilt; /* some are no longer those of the file */
    char fault[240]; /* why cfitsio must not see it; "": it may */
} rx_fits_header;

/* Writes every card anew by which cfitsio finds its way through a file, makes columns, or unpacks an image, unless
 * it stands there already as it would be written: keyword, '=' and one value of the keyword's kind, which can be
 * read in one way only. Faults are such cards that cfitsio alone would find (behind HIERARCH, without '=' in column
 * 9, TFORM01) or whose value is none of the kind, two of one keyword that differ, values longer than its memory or
 * its messages; sizes below 1 that it divides by; and a table that does not begin as tables do. */
rx_status rx_fits_header_rebuild(rx_fits_header *header, rx_error *err);

/* --- walk.c: from header to header through a file, before cfitsio goes there --- */

/* Bytes of the data behind a header of n cards (without END), in whole blocks; -1 when they make no sense. */
int64_t rx_fits_data_bytes(const char *cards, size_t n);

/* RX_INPUT when cfitsio must not see a header of the file. `mend`: those that had to be rebuilt are written back;
 * otherwise *odd says whether there are any, and cfitsio must get a copy in memory that has gone through here. A
 * header that makes no sense ends the walk, and cfitsio says what is wrong.
 *
 * rx_fits_walk_open() goes through the headers of a file just opened, to where cfitsio takes them to be, and back
 * to the first HDU: they must be as if rebuilt. *failed: what cfitsio says where the disk fails. */
rx_status rx_fits_walk(int file, bool mend, const char *path, bool *odd, rx_error *err);
rx_status rx_fits_walk_open(fitsfile *file, const char *path, int *failed, rx_error *err);

/* How many bytes from its beginning a file must have so that the walk through its headers can go on, when `size` of
 * them are there; no more than `size` where it has ended. *place, 0 at first, is where it goes on with more bytes. */
int64_t rx_fits_walk_selected(int file, int64_t size, int64_t *place);

/* Is it the disk that makes cfitsio fail with that status? Then nothing more may be read: cfitsio keeps the
 * block that it could not read as if it had. */
bool rx_fits_is_unreadable(int failed);

/* --- unpack.c: files packed with gzip or bzip2, or plain --- */

/* Writes to the empty file `to`, and counts in *size, the bytes that the headers of the file announce;
 * what it unpacks to beyond them, which may be gigabytes out of kilobytes, is left where it is. Errors:
 * RX_INPUT (cannot be opened, cut off, damaged), RX_SYSTEM. */
rx_status rx_fits_unpack(const char *path, int to, int64_t *size, rx_error *err);

/* --- tiles.c: damaged compressed images, whose bytes cfitsio trusts and reads beyond --- */

/* Of the current HDU, a compressed image of these axes: every tile lies in the heap; a Rice stream (FITS 4.0, 10.4.1), a
 * gzip stream and plain pixels hold as many as their tile, a PLIO list ends where it should, an HCOMPRESS
 * stream too. RX_INPUT otherwise. */
rx_status rx_fits_check_tiles(fitsfile *file, const char *path, int hdu, int naxis, const LONGLONG *axes,
                              rx_error *err);

#endif
