/* The text formats of catalogues, read and written. Whoever calls a function here has set the locale (base/point.h). */
#ifndef RX_CATALOG_FORMATS_H
#define RX_CATALOG_FORMATS_H

#include "base/point.h"
#include "catalog/catalog.h"

/* --- read by rx_catalog_read() --- */

/* No file may make a table larger than this, whatever it claims. */
enum { RX_READ_COLUMNS = 4096, RX_READ_TEXT = 256 };
#define RX_READ_BYTES ((size_t)1 << 30)

/* Columns of blank- or comma-separated values; names from SExtractor's `#   1 NAME ...` lines, from
 * the last `# name name` comment, or from a first line that holds no number; else col1, col2 ...
 * `nan`, `null`, `--` and nothing between two commas are NAN. Lines must have equal length. */
rx_status rx_ascii_read(const char *path, rx_table **dst, rx_error *err);

/* The index-th TABLE (from 0) of a VOTable in TABLEDATA serialisation. Integer columns with null
 * cells become DOUBLE with NAN; arrays of variable length become text. */
rx_status rx_votable_read(const char *path, int index, rx_table **dst, rx_error *err);

/* --- written by rx_catalog_write(), summed by rx_catalog_digest() --- */

/* What stands before, among and behind the rows of a catalogue; NULL: nothing. Functions add to a text. */
typedef struct rx_text_format {
    void (*head)(rx_text *dst, const rx_catalog *catalog);
    void (*table)(rx_text *dst, const rx_catalog *catalog, int i); /* before the rows of table i */
    void (*row)(rx_text *dst, const rx_table *table, long row);    /* a line with its end */
    const char *table_end, *end;
} rx_text_format;

/* Name and value of the i-th card of a table's own facts; false where it is no keyword's. */
bool rx_table_fact(const rx_table *table, long i, char name[9], char value[512]);

/* Of any text type but a VOTable. */
const rx_text_format *rx_ascii_format(rx_catalog_type type);
const rx_text_format *rx_votable_format(void);

/* Element of a cell with no padding and all digits: the shortest text that reads back as the same number. */
void rx_cell_exact(rx_text *dst, const rx_column *column, long row, long element);

/* The same in the column's printf format (width, precision and one of d u f e g; a sensible one when it has
 * none). Text that holds blanks is put in double quotes. */
void rx_cell_format(rx_text *dst, const rx_column *column, long row, long element);

#endif
