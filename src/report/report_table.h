/* The tables of a report, and how they look in its files. */
#ifndef RX_REPORT_REPORT_TABLE_H
#define RX_REPORT_REPORT_TABLE_H

#include <stdbool.h>

#include "report/formats.h"
#include "report/table.h"

/* Of an estimate there are four numbers, of a measured value two. */
typedef union rx_report_slot {
    double number;
    char *words; /* owned, never NULL */
} rx_report_slot;

struct rx_report_table {
    char *name;
    int ncolumns, nslots;
    const rx_report_column *columns; /* not owned */
    int *first;                      /* [ncolumns] first slot of a row */
    int where;
    long nrows, room;     /* room: rows there is memory for */
    rx_report_slot *slot; /* [nrows][nslots] */
    rx_text fact;         /* of its file alone, as it stands there */
    bool failed;          /* memory ran out */
};

void rx_report_table_make(rx_report_table *dst, const char *name, int ncolumns,
                          const rx_report_column *columns, int where);
void rx_report_table_clear(rx_report_table *table); /* content only */

/* Rows of the view from `from` to `to` - 1. */
void rx_report_table_html(rx_text *dst, const rx_report_table *table, const rx_report_view *view);
void rx_report_table_brief(rx_text *dst, const rx_report_table *table, const rx_report_view *view);
void rx_report_table_json(rx_json *json,
                          const rx_report_table *table); /* "name": [{...}, ...], a row a line */
/* head: of every file, with the facts of the report. */
void rx_report_table_ecsv(rx_text *dst, const rx_report_table *table, const rx_ecsv *head);

/* A cell of words, a dash for NULL and "". */
void rx_report_html_words(rx_text *dst, const char *words);
/* <open>text [unit]<close>; unit may be NULL. */
void rx_report_html_named(rx_text *dst, const char *open, const char *text, const char *unit,
                          const char *close);

#endif
