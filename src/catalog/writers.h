/* The text formats of catalogue files; rx_catalog_write() chooses among them. */
#ifndef RX_CATALOG_WRITERS_H
#define RX_CATALOG_WRITERS_H

#include <stdbool.h>
#include <stdio.h>

#include "catalog/catalog.h"

/* All write n tables to an open stream; a full disk shows when the caller closes it. They fail
 * (RX_SYSTEM) only without memory. The caller has set the locale (cell.h). */
rx_status rx_ascii_write(FILE *file, rx_table *const *tables, int n, bool head, rx_error *err);
rx_status rx_skycat_write(FILE *file, rx_table *const *tables, int n, rx_error *err);
rx_status rx_votable_write(FILE *file, rx_table *const *tables, int n, const rx_record_pair *record,
                           int npairs, rx_error *err);

#endif
