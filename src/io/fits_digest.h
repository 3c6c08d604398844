/* Digests (base/hash.h) of the data units of FITS files, without what fills their last block: of what is
 * about to be written, and of what a file holds. */
#ifndef RX_IO_FITS_DIGEST_H
#define RX_IO_FITS_DIGEST_H

#include <stddef.h>
#include <stdint.h>

#include "base/error.h"
#include "base/hash.h"
#include "data/table.h"

/* As rx_fits_image() and rx_fits_image_int() write n pixels: 4 bytes each, the most significant first. */
void rx_fits_digest_floats(const float *pixels, size_t n, char dst[RX_HASH_TEXT]);
void rx_fits_digest_ints(const int32_t *pixels, size_t n, char dst[RX_HASH_TEXT]);

/* As rx_fits_table() writes it, row by row. */
void rx_fits_digest_table(const rx_table *table, char dst[RX_HASH_TEXT]);

/* Of HDU number hdu (from 0) of a file. `path` is a plain file name. Errors: RX_INPUT (no FITS file, no such
 * HDU, its data cut off), RX_SYSTEM. */
rx_status rx_fits_digest_hdu(const char *path, int hdu, char dst[RX_HASH_TEXT], rx_error *err);

/* How many HDUs a file has. Errors: RX_INPUT. */
rx_status rx_fits_hdus(const char *path, int *n, rx_error *err);

#endif
