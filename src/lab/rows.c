/* Tables with named columns, and their place in a journal. */
#include "lab/rows.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

void rx_lab_table_begin(const rx_lab_schema *schema, int nruns, rx_lab_table *dst)
{
    *dst = (rx_lab_table){.schema = schema, .nruns = nruns, .width = schema->nown + nruns * schema->neach};
}

void rx_lab_tables_free(int ntables, rx_lab_table *tables)
{
    for (int t = 0; t < ntables; t++) {
        free(tables[t].v);
        tables[t] = (rx_lab_table){.schema = tables[t].schema};
    }
}

rx_status rx_lab_rows_add(rx_lab_table *t, long n, double **first, rx_error *err)
{
    const size_t width = (size_t)t->width;
    if (t->v == NULL || t->n + n > t->capacity) {
        const long capacity = t->n + n > 2 * t->capacity ? t->n + n : 2 * t->capacity;
        double *v = rx_regrow(t->v, (size_t)capacity * width + 1, sizeof *v);
        if (v == NULL)
            return rx_error_memory(err, (size_t)capacity * width * sizeof *v);
        t->v = v;
        t->capacity = capacity;
    }
    *first = t->v + t->n * t->width;
    memset(*first, 0, (size_t)n * width * sizeof **first);
    t->n += n;
    return RX_OK;
}

double rx_lab_sum(const rx_lab_table *table, int column)
{
    double sum = 0;
    for (long i = 0; i < table->n; i++)
        sum += rx_lab_own(table, i)[column];
    return sum;
}

static void add_names(rx_text *dst, int n, const rx_lab_column *columns)
{
    for (int i = 0; i < n; i++)
        rx_text_printf(dst, "%s%s%s%s%s", dst->length > 0 ? " " : "", columns[i].name,
                       columns[i].unit[0] != '\0' ? "[" : "", columns[i].unit,
                       columns[i].unit[0] != '\0' ? "]" : "");
}

void rx_lab_schema_fact(const rx_lab_schema *schema, rx_journal_facts *facts)
{
    rx_text names = {0}, name = {0};
    rx_text_printf(&name, "TABLE.%s", schema->name);
    add_names(&names, schema->nown, schema->own);
    if (schema->neach > 0)
        rx_text_add(&names, names.length > 0 ? "; each run:" : "each run:");
    add_names(&names, schema->neach, schema->each);
    if (names.failed || name.failed)
        facts->lines.failed = true;
    else
        rx_journal_fact(facts, name.data, names.data);
    rx_text_free(&names);
    rx_text_free(&name);
}

rx_status rx_lab_pack(int ntables, const rx_lab_table *tables, rx_unit_values *dst, rx_error *err)
{
    long n = ntables;
    for (int t = 0; t < ntables; t++)
        n += tables[t].n * tables[t].width;
    *dst = (rx_unit_values){n, RX_NEW(double, (size_t)n)};
    if (dst->v == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *dst->v);
    double *v = dst->v;
    for (int t = 0; t < ntables; t++) {
        *v++ = (double)tables[t].n;
        for (long i = 0; i < tables[t].n * tables[t].width; i++)
            *v++ = tables[t].schema->exact ? tables[t].v[i] : (double)(float)tables[t].v[i];
    }
    return RX_OK;
}

rx_status rx_lab_unpack(int ntables, rx_lab_table *tables, const rx_unit_values *src, rx_error *err)
{
    const double *v = src->v, *end = src->v + src->n;
    for (int t = 0; t < ntables; t++) {
        double *first;
        const long n = v < end ? (long)*v++ : -1, values = n * tables[t].width;
        if (n < 0 || values > end - v)
            return rx_error_set(err, RX_INPUT, "the journal holds a unit without a table '%s'; delete it",
                                tables[t].schema->name);
        RX_TRY(rx_lab_rows_add(&tables[t], n, &first, err));
        memcpy(first, v, (size_t)values * sizeof *v);
        v += values;
    }
    return v == end ? RX_OK
                    : rx_error_set(err, RX_INPUT, "the journal holds a unit of more tables; delete it");
}
