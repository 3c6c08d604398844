/* DATASUM of what is about to be written, from memory (FITS 4.0, 4.4.2.7 and appendix J): the one's
 * complement sum of the 32-bit words, big-endian, of the data unit. cfitsio forms it from what it reads back,
 * so that a write that failed unnoticed would get a sum that fits. */
#ifndef RX_IO_FITS_SUM_H
#define RX_IO_FITS_SUM_H

#include <stddef.h>
#include <stdint.h>

#include "data/table.h"

/* Pixels of 4 bytes, float or int32. */
uint32_t rx_fits_sum_pixels(const void *pixels, size_t n);
/* The rows of a binary table; texts are filled up with blanks. */
uint32_t rx_fits_sum_table(const rx_table *table);
/* `sum` of what came before, whole words of it, goes on over these bytes as they stand in the file. */
uint32_t rx_fits_sum_bytes(uint32_t sum, const void *bytes, size_t n);

/* Characters of a text cell in the file: the terminating zero does not go there. */
long rx_fits_text_length(const rx_column *column);

#endif
