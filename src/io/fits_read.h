/* Reading plain images (PSF files) and tables (reference catalogues, PSFEx models). */
#ifndef RX_IO_FITS_READ_H
#define RX_IO_FITS_READ_H

#include "base/error.h"
#include "data/table.h"

/* First 2-D (or first) image of the file as floats; *pixels to be freed. NaN kept. */
rx_status rx_fits_read_image(const char *name, float **pixels, int *width, int *height, rx_error *err);

/* First non-empty binary/ASCII table HDU of a FITS or FITS_LDAC file (LDAC: LDAC_OBJECTS; index-th of
 * these for multi-extension files, from 0). Its header cards come along in table->cards. */
rx_status rx_fits_read_table(const char *name, int index, rx_table **dst, rx_error *err);

/* Number of such tables. */
rx_status rx_fits_count_tables(const char *name, int *n, rx_error *err);

/* Value of a key in a block of cards as text (quotes stripped, trimmed) or number; 0 when absent. */
int rx_cards_text(const char *cards, long ncards, const char *key, char *dst, int size);
int rx_cards_number(const char *cards, long ncards, const char *key, double *value);

#endif
