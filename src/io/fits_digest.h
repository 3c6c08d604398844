/* Data units as they stand in a FITS file, without what fills their last block: digests (base/hash.h) of what is about to
 * be written, and its DATASUM (FITS 4.0, 4.4.2.7 and appendix J), the one's complement sum of the
 * 32-bit words. That comes from memory, as cfitsio forms it from what it reads back, so that a write that failed unnoticed
 * would get a sum that fits. */
#ifndef RX_IO_FITS_DIGEST_H
#define RX_IO_FITS_DIGEST_H

#include <stddef.h>
#include <stdint.h>

#include "base/error.h"
#include "base/hash.h"
#include "data/table.h"

/* DATASUM of n pixels of 4 bytes, float or int32, as rx_fits_image() writes them, and of a table as rx_fits_table() does;
 * their digest to dst, unless that is NULL. */
uint32_t rx_fits_digest_pixels(const void *pixels, size_t n, char dst[RX_HASH_TEXT]);
uint32_t rx_fits_digest_table(const rx_table *table, char dst[RX_HASH_TEXT]);

/* `sum` of what came before, whole words of it, goes on over these bytes as they stand in the file. */
uint32_t rx_fits_sum_bytes(uint32_t sum, const void *bytes, size_t n);

/* Characters of a text cell in the file: the terminating zero does not go there. */
long rx_fits_text_length(const rx_column *column);

/* For files that are only good as a whole, such as models: nothing is missing, nothing has changed since they were written.
 * Every HDU has CHECKSUM and DATASUM and both are right, the HDUs fill the file to its last byte, and there are `nhdus` of
 * them (0: as many as there are): a single changed byte anywhere is found. Errors: RX_INPUT, with the HDU; RX_SYSTEM. */
rx_status rx_fits_verify(const char *path, int nhdus, rx_error *err);

#endif
