/* A table in memory: what catalogues, reference lists and report tables are before
 * they meet a file format. Columns are arrays over rows; a cell may be a vector. */
#ifndef RX_DATA_TABLE_H
#define RX_DATA_TABLE_H

#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"

RX_BEGIN_DECLS

typedef enum rx_cell_type {
    RX_CELL_INT16,
    RX_CELL_INT32,
    RX_CELL_INT64,
    RX_CELL_FLOAT,
    RX_CELL_DOUBLE,
    RX_CELL_TEXT
} rx_cell_type;

typedef struct rx_column {
    char name[72];
    char unit[48]; /* FITS unit string, "" when none */
    char ucd[64];
    char description[160];
    char format[16]; /* printf format for one element in ASCII, e.g. "%11.4f"; "" = default */
    rx_cell_type type;
    int ndim, dim[2]; /* 0 scalar; 1 vector of dim[0]; 2 image dim[0] x fastest, dim[1] */
    int text_width;   /* RX_CELL_TEXT: bytes per element, 0-terminated inside */
    struct {
        long row, element, line;
    } word; /* RX_CELL_TEXT read from a text file: the first cell that is no number, its row and element from 0 */
    void *data; /* [nrows][elements] of the type; owner is the table */
} rx_column;

typedef struct rx_table {
    char *name; /* EXTNAME, "" when none */
    long nrows;
    int ncolumns;
    rx_column *columns;
    char *cards; /* header of the image the rows come from, 80 chars a card, or NULL */
    long ncards;
    char *facts; /* ready 80-character cards that say how the rows were made, or NULL */
    long nfacts;
} rx_table;

/* Elements of one cell (1 for a scalar) and bytes of one element. */
long rx_column_elements(const rx_column *column);
long rx_column_element_size(const rx_column *column);

/* Empty table with memory for ncolumns columns (not yet their data); NULL without memory. */
rx_table *rx_table_new(int ncolumns);

/* A table of nrows rows with these columns: copies of the n in `like`, their data zeroed. Errors: RX_SYSTEM. */
rx_status rx_table_make(const char *name, const rx_column *like, int n, long nrows, rx_table **dst,
                        rx_error *err);

/* A copy of n header cards of 80 characters for table->cards. Errors: RX_SYSTEM. */
rx_status rx_table_copy_cards(rx_table *table, const char *cards, size_t n, rx_error *err);

void rx_table_free(rx_table *table);

/* Index of a column by name, case ignored; -1 when absent. */
int rx_table_find(const rx_table *table, const char *name);

/* Element `element` of row `row` as double (NAN for text). */
double rx_column_value(const rx_column *column, long row, long element);

/* Sets element i of all in the column: to the number, out-of-range ones stop at an integer type's ends and NAN is 0
 * there; to the text, cut at the width, in a column of texts. */
void rx_column_set(rx_column *column, long i, double number, const char *text);

RX_END_DECLS

#endif
