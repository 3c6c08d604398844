/* The catalogue: columns.def names every column once (name, unit, UCD, format, type, how to
 * compute it from an rx_source); writers put the chosen ones into a file. */
#ifndef RX_CATALOG_CATALOG_H
#define RX_CATALOG_CATALOG_H

#include <stdbool.h>
#include <stdio.h>

#include "base/error.h"
#include "base/extern.h"
#include "base/hash.h"
#include "base/log.h"
#include "base/text.h"
#include "data/image.h"
#include "data/record.h"
#include "data/sources.h"
#include "data/table.h"

RX_BEGIN_DECLS

typedef enum rx_catalog_type {
    RX_CATALOG_NONE,
    RX_CATALOG_ASCII,
    RX_CATALOG_ASCII_HEAD,
    RX_CATALOG_ASCII_SKYCAT,
    RX_CATALOG_VOTABLE,
    RX_CATALOG_FITS_1_0,
    RX_CATALOG_FITS_LDAC,
    RX_CATALOG_DS9
} rx_catalog_type;

/* One chosen column of a .param file: FLUX_APER(5) has dim {5, 0}, VIGNET(35,35) {35, 35}. */
typedef struct rx_column_choice {
    int index; /* row of columns.def */
    int dim[2];
} rx_column_choice;

typedef struct rx_column_list {
    int n;
    rx_column_choice *choice;
} rx_column_list;

/* Parse a .param file. Unknown names: RX_USAGE with "did you mean"; known SExtractor columns that we
 * cannot give (model fits...): left out, with one warning for all; none left: RX_USAGE. Free with rx_columns_free(). */
rx_status rx_columns_read(const char *path, rx_log *log, rx_column_list **dst, rx_error *err);
void rx_columns_free(rx_column_list *list);

/* The n columns of these names, as a .param file has them: FLUX_APER(5); vectors without a length have one element.
 * Errors: RX_USAGE (no such column), RX_SYSTEM. */
rx_status rx_columns_of(const char *const *names, int n, rx_column_list **dst, rx_error *err);

/* Of these columns, which must be in the table, the ones that the list lacks. Errors: RX_SYSTEM. */
rx_status rx_columns_add(rx_column_list *list, const char *const *names, int n, rx_error *err);

/* Adds the columns that the format shows whatever was chosen: regions (DS9) are made of positions and ellipses.
 * Errors: RX_SYSTEM. */
rx_status rx_columns_need(rx_column_list *list, rx_catalog_type type, rx_error *err);

/* The columns of config/default.param, for a run without any .param file. */
rx_status rx_columns_default(rx_column_list **dst, rx_error *err);

/* Is the column chosen? The dimensions asked of it, {0,0} when it is not, into dim, unless NULL: VIGNET, FLUX_APER ... say what
 * to measure. */
int rx_columns_requested(const rx_column_list *list, const char *name, int dim[2]);

/* Is a column chosen whose name contains `part`? "_APER" stands for all aperture columns. */
int rx_columns_mention(const rx_column_list *list, const char *part);

/* Cut a vector column to what there is to show (`keyword` gives `available` elements), with a
 * warning, as SExtractor does; never below 1. Nothing happens when the column is not chosen. */
void rx_columns_clip(rx_column_list *list, const char *name, int available, const char *keyword, rx_log *log);

/* All columns as a .param file, `#NAME comment [unit]` (`-dp`). */
void rx_columns_dump(rx_text *dst);

/* Table of the chosen columns of sources measured on `image`. Magnitudes from its zero point (99 for non-positive
 * flux, as SExtractor). Free with rx_table_free(). Errors: RX_SYSTEM. */
rx_status rx_catalog_table(const rx_column_list *list, const rx_image *image, const rx_sources *sources,
                           rx_table **dst, rx_error *err);

/* What one catalogue file holds; it owns nothing. */
typedef struct rx_catalog {
    rx_catalog_type type;
    int n;
    rx_table *const *tables; /* [n] one per extension */
    const rx_record *record; /* what made it: program, version, configuration */
} rx_catalog;

/* The facts of a run as SExtractor's WRITE_XML has them: PARAMs of the program, of each image a row, warnings, keywords. */
typedef struct rx_votable_param {
    const char *name, *datatype;           /* "char", "int", "double" */
    const char *unit, *ucd, *value, *help; /* NULL: none */
} rx_votable_param;
rx_status rx_votable_run_text(const rx_votable_param *params, int nparams, rx_table *const *tables,
                              int ntables, const rx_record *keywords, rx_text *dst, rx_error *err);

/* Write one catalogue file: to `temporary`, which errors call `path`, the name that it will have in the end; or as text
 * to standard_out when temporary is NULL (CATALOG_NAME STDOUT; a FITS type is then RX_USAGE). RX_CATALOG_NONE
 * writes nothing. Errors: RX_SYSTEM too. */
rx_status rx_catalog_write(const rx_catalog *catalog, const char *path, const char *temporary,
                           FILE *standard_out, rx_error *err);

/* Can the record go into a catalogue of that type? Into how many parts do n tables go there, each with a
 * digest? */
int rx_catalog_has_record(rx_catalog_type type);
int rx_catalog_parts(rx_catalog_type type, int n);

/* The digest of the rows of a part as the file will hold them: the data unit of its table in FITS
 * (io/fits_write.h), lines of text elsewhere. Errors: RX_SYSTEM. */
rx_status rx_catalog_digest(rx_catalog_type type, rx_table *const *tables, int n, int part,
                            char dst[RX_HASH_TEXT], rx_error *err);

/* A reference catalogue: FITS, FITS_LDAC, ASCII_HEAD or VOTable, recognised by content; its table `index`, from 0. Free
 * with rx_table_free(). Errors: RX_INPUT, RX_SYSTEM. */
rx_status rx_catalog_read(const char *path, int index, rx_table **dst, rx_error *err);

/* Columns of positions by the names that programs and surveys give them: degrees, or pixels from 1. */
bool rx_catalog_find_positions(const rx_table *table, bool sky, int *x, int *y);

/* Refuses a column of that table, from 0, in which words stand: names the first one and its line. */
rx_status rx_catalog_need_numbers(const char *path, const rx_table *table, int number, rx_error *err);

RX_END_DECLS

#endif
