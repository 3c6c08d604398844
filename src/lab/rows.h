/* What a unit of a campaign measures: tables whose columns have names. A row is a thing (an object, a tile, a false
 * detection): first its own columns, then those that every run has in turn. The columns of a table are declared
 * once, by a list of X(identifier, name, unit, text), of which the identifiers and the names are made; the journal's
 * header holds the names, so that numbers of other columns are never read as these. */
#ifndef RX_LAB_ROWS_H
#define RX_LAB_ROWS_H

#include "lab/journal.h"

typedef struct rx_lab_column {
    const char *name, *unit, *help;
} rx_lab_column;
#define RX_LAB_RUN "run" /* a table's own column of that name holds the number of a run */
#define RX_LAB_ID(id, name, unit, help) id,
#define RX_LAB_COLUMN(id, name, unit, help) {name, unit, help},

typedef struct rx_lab_schema {
    const char *name;
    int nown, neach;
    const rx_lab_column *own, *each;
    int exact; /* 1: doubles; 0: floats, which nine digits of the journal hold */
} rx_lab_schema;

typedef struct rx_lab_table {
    const rx_lab_schema *schema;
    int nruns, width; /* width = nown + nruns neach */
    long n, capacity; /* rows */
    double *v;        /* [n][width]; owned */
} rx_lab_table;

void rx_lab_table_begin(const rx_lab_schema *schema, int nruns, rx_lab_table *dst); /* without rows */
void rx_lab_tables_free(int ntables, rx_lab_table *tables);                         /* content only */

/* n more rows of zeros, the first one at *first. Rows move when more are added. Errors: RX_SYSTEM. */
rx_status rx_lab_rows_add(rx_lab_table *table, long n, double **first, rx_error *err);

/* Columns of row i: its own, and those of a run. */
static inline double *rx_lab_own(const rx_lab_table *table, long i)
{
    return table->v + i * table->width;
}

static inline double *rx_lab_each(const rx_lab_table *table, long i, int run)
{
    return table->v + i * table->width + table->schema->nown + run * table->schema->neach;
}

double rx_lab_sum(const rx_lab_table *table, int column); /* of an own column over the rows */

/* "= TABLE.name ..." of the journal's header. */
void rx_lab_schema_fact(const rx_lab_schema *schema, rx_journal_facts *facts);

/* A unit's values: of each table the number of rows, then the rows. rx_lab_unpack() adds them to tables that have rows
 * already. Errors: RX_SYSTEM; RX_INPUT (values of other tables). */
rx_status rx_lab_pack(int ntables, const rx_lab_table *tables, rx_unit_values *dst, rx_error *err);
rx_status rx_lab_unpack(int ntables, rx_lab_table *tables, const rx_unit_values *src, rx_error *err);

#endif
