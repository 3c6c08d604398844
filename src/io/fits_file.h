/* Opening FITS files for reading: names, sanity before cfitsio allocates, errors.
 *
 * For the files of io/ alone. A name is `path`, `path[n]`, `path[NAME]`, `path[NAME,version]`,
 * each possibly followed by a section `[x1:x2,y1:y2]` (FITS counting, `*` = all), of a cube
 * `[x1:x2,y1:y2,k]` with the number of a plane, and one more for each further axis. What else
 * cfitsio's grammar knows (row filters, output files, pipes, networks) is refused: a file
 * name must never run or write anything.
 */
#ifndef RX_IO_FITS_FILE_H
#define RX_IO_FITS_FILE_H

#include <fitsio.h>

#include <stdint.h>

#include "base/error.h"

/* A rectangle of pixels as FITS counts them, from 1, inclusive; plane: the places on the third axis and those after
 * it, in a name 0 where it gives none. */
enum { RX_FITS_AXES = 9 };

/* Bytes of a table that are read or written at a time. */
enum { RX_FITS_ROWS = 1 << 22 };

typedef struct rx_fits_section {
    long first[2], last[2], plane[RX_FITS_AXES - 2];
} rx_fits_section;

typedef struct rx_fits_name {
    char path[1024];
    int hdu;          /* from 0; -1: not given by number */
    char extname[72]; /* "" : not given by name */
    int extver;       /* 0: any */
    int has_section;
    rx_fits_section section; /* last 0 = to the end */
} rx_fits_name;

/* What an HDU holds, as far as images are concerned. */
typedef struct rx_fits_shape {
    int is_image; /* 0: a table */
    int is_compressed;
    int naxis, bitpix;
    LONGLONG axes[RX_FITS_AXES]; /* the first */
} rx_fits_shape;

rx_status rx_fits_name_parse(const char *name, rx_fits_name *dst, rx_error *err);

/* True when the name selects one HDU. */
int rx_fits_name_selects(const rx_fits_name *name);

/* An open file. cfitsio cannot read a last block without its padding, which many programs leave out, and unpacks
 * a file of gzip whatever its size before anyone can look at it: such files are held in memory, padded. */
typedef struct rx_fits_source {
    fitsfile *file;
    const char *path; /* lent */
    int hdu;          /* where it is, from 0; -1: anywhere */
    int64_t bytes;    /* of a file held in memory, without padding; else 0 */
} rx_fits_source;

/* Check that path is a regular file that begins like FITS (or is compressed), then open it. */
rx_status rx_fits_open(const char *path, rx_fits_source *dst, rx_error *err);

/* The path as cfitsio has to be given it: it would make the home folder of a '~' at the beginning, drop blanks
 * there, and open another file. */
enum { RX_FITS_LITERAL = FLEN_FILENAME + 2 };
void rx_fits_literal(const char *path, char dst[RX_FITS_LITERAL]);
/* Bytes of the file that are in memory as long as it is open: padded, or unpacked; else 0. */
size_t rx_fits_held(const rx_fits_source *source);
void rx_fits_done(rx_fits_source *source); /* close, errors ignored; a source of zeros is fine */

/* Go to HDU number hdu (from 0), or to the one the name selects. */
rx_status rx_fits_goto(rx_fits_source *source, int hdu, rx_error *err);
rx_status rx_fits_goto_name(rx_fits_source *source, const rx_fits_name *name, rx_error *err);

/* *n: the HDUs that can be reached; a broken one ends the count and sets *broken (may be NULL). RX_INPUT: the
 * disk fails. */
rx_status rx_fits_count(rx_fits_source *source, int *n, int *broken, rx_error *err);

/* Shape of the HDU where it is. */
rx_status rx_fits_shape_of(const rx_fits_source *source, rx_fits_shape *dst, rx_error *err);

/* 1 when the shape is an image of two axes; further ones do not count that are of length 1 or on which the section
 * gives a place. */
int rx_fits_is_plane(const rx_fits_shape *shape, const rx_fits_section *section);

/* RX_INPUT when the data of the current HDU cannot be in the file: cut off, or a header that claims too much;
 * or when an image's BSCALE or BZERO is no number. */
rx_status rx_fits_check_size(const rx_fits_source *source, const rx_fits_shape *shape, rx_error *err);

/* The part of an image of that shape, a line or more, that the name selects: its section, or all. */
rx_fits_section rx_fits_part(const rx_fits_name *name, const rx_fits_shape *shape);

/* n rows of a part of the current image HDU from `row` (from 0) on, as doubles, *null where there is no value, or with null
 * NULL as floats, as they are. */
rx_status rx_fits_read_rows(const rx_fits_source *source, const rx_fits_section *part, size_t row, size_t n,
                            const double *null, void *dst, rx_error *err);

/* Pixels of a part of the current image HDU: BLANK, NaN and infinity become NAN, what is too large for a float infinite. dst
 * is [height][width] of the part. Errors: RX_INPUT, also of an image whose values are too small for floats. */
rx_status rx_fits_read_pixels(const rx_fits_source *source, const rx_fits_section *part, float *dst,
                              rx_error *err);

/* Header of the current HDU as 80-character cards without END; a compressed image's header is
 * that of the image. *cards to be freed with free(). */
rx_status rx_fits_read_cards(const rx_fits_source *source, char **cards, size_t *ncards, rx_error *err);

/* RX_OK where a cfitsio status is 0, else an error of the current HDU; the last line of cfitsio's message stack comes along. */
rx_status rx_fits_check(const rx_fits_source *source, rx_status kind, int status, const char *what,
                        rx_error *err);

#endif
