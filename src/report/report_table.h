/* The tables of a report, and how they look in its files. */
#ifndef RX_REPORT_REPORT_TABLE_H
#define RX_REPORT_REPORT_TABLE_H

#include <stdbool.h>

#include "report/json.h"
#include "report/report.h"

/* An entry of the head: a text, numbers, or null. */
typedef struct rx_report_entry {
    const char *name; /* not owned */
    char *text;       /* owned, as numbers */
    long nnumbers;
    bool list;
    double *numbers;
} rx_report_entry;

struct rx_report_table {
    rx_table *table; /* NULL: memory ran out */
    int ncolumns;
    const rx_report_column *columns; /* not owned */
    int *first;                      /* [ncolumns] the first of its columns in `table` */
    int where;
    long room;            /* rows there is memory for */
    rx_report_entry fact; /* of its file alone; name NULL: none */
    bool failed;
};

void rx_report_table_make(rx_report_table *dst, const char *name, int ncolumns,
                          const rx_report_column *columns, int where);
void rx_report_table_clear(rx_report_table *table); /* content only */

void rx_report_table_html(rx_text *dst, const rx_report_table *table, const rx_report_view *view);
void rx_report_table_brief(rx_text *dst, const rx_report_table *table, const rx_report_view *view);
void rx_report_table_json(rx_json *json,
                          const rx_report_table *table); /* "name": [{...}, ...], a row a line */
void rx_report_table_ecsv(rx_text *dst, const rx_report_table *table, int nfacts,
                          const rx_report_entry *facts);

#endif
