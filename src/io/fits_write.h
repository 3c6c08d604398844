/* Writing images and tables as FITS, with DATASUM and CHECKSUM whose comments hold no
 * date: the same input gives the same bytes. */
#ifndef RX_IO_FITS_WRITE_H
#define RX_IO_FITS_WRITE_H

#include <stddef.h>
#include <stdint.h>

#include "base/error.h"
#include "base/hash.h"
#include "data/table.h"
#include "data/tile.h"
#include "io/cards.h"

typedef struct rx_fits_writer rx_fits_writer; /* one open FITS file */

/* path: the temporary name of rx_outputs_file(); shown: the final name, for errors. */
rx_status rx_fits_create(const char *path, const char *shown, rx_fits_writer **dst, rx_error *err);

/* What an image HDU holds: pixels [height][width], floats (bad ones NaN) or integers, one of the two. */
typedef struct rx_fits_plane {
    const char *extname; /* NULL, "": none */
    int width, height;
    const float *floats;
    const int32_t *integers;
    /* the input's, of which the useful ones are copied (no structural, compression, scaling, checksum keywords; WCS
     * kept); NULL: none */
    const char *cards;
    size_t ncards;
} rx_fits_plane;

/* Shape, name and header of that tile; its pixels are still to be named. */
rx_fits_plane rx_fits_plane_of(const rx_tile *tile);

/* Append an image HDU. extra, here and below: ready 80-character cards (COMMENT, HISTORY, keys), NULL: none. */
rx_status rx_fits_image(rx_fits_writer *writer, const rx_fits_plane *plane, const rx_text *extra,
                        rx_error *err);

/* An empty primary HDU with cards of its own, where tables follow; the first thing written. */
rx_status rx_fits_primary(rx_fits_writer *writer, const rx_text *extra, rx_error *err);

/* Append a binary table (an empty primary is made first when it is the first HDU). */
rx_status rx_fits_table(rx_fits_writer *writer, const rx_table *table, const rx_text *extra, rx_error *err);

/* FITS_LDAC: the LDAC_IMHEAD table holding table->cards and `extra`, then LDAC_OBJECTS whose
 * header holds `extra` too. One pair for each image of a multi-extension file. */
rx_status rx_fits_ldac(rx_fits_writer *writer, const rx_table *table, const rx_text *extra, rx_error *err);

/* DATASUM of n pixels of 4 bytes, float or int32, as rx_fits_image() writes them, and of a table as rx_fits_table() does, without
 * what fills its last block; their digest (base/hash.h) to dst, unless that is NULL. */
uint32_t rx_fits_digest_pixels(const void *pixels, size_t n, char dst[RX_HASH_TEXT]);
uint32_t rx_fits_digest_table(const rx_table *table, char dst[RX_HASH_TEXT]);

/* `sum` of what came before, whole words of it, goes on over these bytes as they stand in the file. */
uint32_t rx_fits_sum_bytes(uint32_t sum, const void *bytes, size_t n);

/* Close with checksums; the writer is freed in any case (NULL is fine for abort). */
rx_status rx_fits_close(rx_fits_writer *writer, rx_error *err);
void rx_fits_abort(rx_fits_writer *writer);

#endif
