/* Tables as ECSV 1.0 (Astropy's APE 6): text that astropy and every CSV reader open.
 *
 *   rx_ecsv t = rx_ecsv_on(&text);
 *   rx_ecsv_meta(&t, "campaign", name);                          any number
 *   rx_ecsv_column(&t, "mag", RX_ECSV_FLOAT, "mag", "of the stars");  one or more
 *   rx_ecsv_columns_end(&t);
 *   rx_ecsv_number(&t, 18.5); ... one call per column, then rx_ecsv_row_end(&t);
 */
#ifndef RX_REPORT_ECSV_H
#define RX_REPORT_ECSV_H

#include <stdbool.h>

#include "base/text.h"

typedef enum rx_ecsv_type { RX_ECSV_FLOAT, RX_ECSV_LONG, RX_ECSV_TEXT } rx_ecsv_type;

typedef struct rx_ecsv {
    rx_text *text;
    rx_text names;
    bool in_meta, in_columns; /* begun */
    bool filled;              /* the row has a cell */
} rx_ecsv;

rx_ecsv rx_ecsv_on(rx_text *text);
void rx_ecsv_meta(rx_ecsv *table, const char *name, const char *value);
void rx_ecsv_meta_number(rx_ecsv *table, const char *name, double value);
/* unit "" = none; name is a plain word; description one line without quotes. */
void rx_ecsv_column(rx_ecsv *table, const char *name, rx_ecsv_type type, const char *unit,
                    const char *description);
void rx_ecsv_columns_end(rx_ecsv *table); /* also frees what the writer holds */

void rx_ecsv_number(rx_ecsv *table, double value);
void rx_ecsv_count(rx_ecsv *table, long value);
void rx_ecsv_text(rx_ecsv *table, const char *value); /* quoted and escaped */
void rx_ecsv_row_end(rx_ecsv *table);

#endif
