/* The text formats of catalogue files, which rx_catalog_write() and rx_catalog_digest() go through. */
#ifndef RX_CATALOG_WRITERS_H
#define RX_CATALOG_WRITERS_H

#include "catalog/catalog.h"

/* What stands before, among and behind the rows of a catalogue; NULL: nothing. Functions add to a text, and their caller has set
 * the locale (cell.h). */
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

#endif
