/* Reading plain images (PSF files) and tables (reference catalogues, PSFEx models). */
#ifndef RX_IO_FITS_READ_H
#define RX_IO_FITS_READ_H

#include <stddef.h>

#include "base/error.h"
#include "data/table.h"
#include "io/cards.h"

/* First 2-D (or first) image of the file as floats; *pixels to be freed. NaN kept. */
rx_status rx_fits_read_image(const char *name, float **pixels, int *width, int *height, rx_error *err);

/* An image of two or three axes with its header, 80 characters a card. */
typedef struct rx_fits_cube {
    float *pixels; /* [planes][height][width] */
    int width, height, planes;
    char *cards;
    long ncards;
} rx_fits_cube;

/* The same, of the first image of two or three axes (or the first). Free with rx_fits_cube_free(). */
rx_status rx_fits_read_cube(const char *name, rx_fits_cube *dst, rx_error *err);
void rx_fits_cube_free(rx_fits_cube *cube);

/* index-th (from 0) binary or ASCII table of a FITS or FITS_LDAC file: of the LDAC_OBJECTS where there
 * are any, else of the tables with rows, else of those without. A name[n] reads that HDU. The HDU's
 * header comes along in table->cards. Integers with TNULL become floating (NAN for no value), scaled
 * columns too, logicals and bits int16, complex numbers pairs, dimensions beyond two are joined;
 * columns of variable length are left out. *dst to be freed by rx_table_free(). */
rx_status rx_fits_read_table(const char *name, int index, rx_table **dst, rx_error *err);

/* The table of that EXTNAME, read in the same way; no such HDU is no error: *dst NULL, *hdu -1. `path` is a
 * plain file name. */
rx_status rx_fits_read_named(const char *path, const char *extname, rx_table **dst, int *hdu, rx_error *err);

/* Header of HDU number hdu (from 0) as 80-character cards without END; *cards to be freed. `path` is a plain
 * file name. */
rx_status rx_fits_read_header(const char *path, int hdu, char **cards, long *ncards, rx_error *err);

/* For files that are only good as a whole, such as models: nothing is missing, nothing has changed since they were written.
 * Every HDU has CHECKSUM and DATASUM and both are right, the HDUs fill the file to its last byte, and there are `nhdus` of
 * them (0: as many as there are): a single changed byte anywhere is found. Errors: RX_INPUT, with the HDU; RX_SYSTEM. */
rx_status rx_fits_verify(const char *path, int nhdus, rx_error *err);

/* Version of the library (cfitsio). */
void rx_fits_library(char *dst, size_t size);

#endif
