/* The text formats of catalogue files; rx_catalog_write() chooses among them. */
#ifndef RX_CATALOG_WRITERS_H
#define RX_CATALOG_WRITERS_H

#include <stdio.h>

#include "base/hash.h"
#include "catalog/catalog.h"

/* All write the tables to an open stream; a full disk shows when the caller closes it. They fail
 * (RX_SYSTEM) only without memory. The caller has set the locale (cell.h). */
rx_status rx_ascii_write(FILE *file, const rx_catalog *catalog, rx_error *err);
rx_status rx_skycat_write(FILE *file, const rx_catalog *catalog, rx_error *err);
rx_status rx_votable_write(FILE *file, const rx_catalog *catalog, rx_error *err);

/* Digests of the rows as those functions write them: lines with their ends; of a VOTable's table the lines
 * from <TR> to </TR>. The locale as above. */
rx_status rx_ascii_digest(rx_table *const *tables, int n, rx_catalog_type type, char dst[RX_HASH_TEXT],
                          rx_error *err);
rx_status rx_votable_digest(const rx_table *table, char dst[RX_HASH_TEXT], rx_error *err);

#endif
