/* The covariances of template fluxes as a table. */
#include "stage/template_table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { EXTENSION, FIRST, SECOND, COVARIANCE, CORRELATION, NCOLUMNS };

static const struct {
    rx_cell_type type;
    const char *name, *unit, *ucd, *format, *description;
} columns[NCOLUMNS] = {
    [EXTENSION] = {RX_CELL_INT32, "EXT_NUMBER", "", "meta.id;meta.dataset", "%3d",
                   "Number of the image extension, from 1"},
    [FIRST] = {RX_CELL_INT32, "NUMBER_1", "", "meta.record", "%10d", "NUMBER of a source"},
    [SECOND] = {RX_CELL_INT32, "NUMBER_2", "", "meta.record", "%10d", "NUMBER of another one of its group"},
    [COVARIANCE] = {RX_CELL_DOUBLE, "COVAR_TEMPLATE", "count**2", "stat.covariance;phot.flux", "%15.8e",
                    "Covariance of their FLUX_TEMPLATE"},
    [CORRELATION] = {RX_CELL_DOUBLE, "CORREL_TEMPLATE", "", "stat.correlation;phot.flux", "%8.5f",
                     "The same over both errors"},
};

static rx_status open_columns(rx_table *table, rx_error *err)
{
    for (int i = 0; i < NCOLUMNS; i++) {
        rx_column *column = &table->columns[i];
        snprintf(column->name, sizeof column->name, "%s", columns[i].name);
        snprintf(column->unit, sizeof column->unit, "%s", columns[i].unit);
        snprintf(column->ucd, sizeof column->ucd, "%s", columns[i].ucd);
        snprintf(column->format, sizeof column->format, "%s", columns[i].format);
        snprintf(column->description, sizeof column->description, "%s", columns[i].description);
        column->type = columns[i].type;
        const size_t bytes = (size_t)rx_column_element_size(column);
        column->data = rx_alloc((size_t)table->nrows, bytes);
        if (column->data == NULL)
            return rx_error_memory(err, (size_t)table->nrows * bytes);
    }
    return RX_OK;
}

static void put(rx_table *table, long row, int extension, const rx_source *a, const rx_source *b,
                double covariance)
{
    ((int32_t *)table->columns[EXTENSION].data)[row] = extension;
    ((int32_t *)table->columns[FIRST].data)[row] = a->number;
    ((int32_t *)table->columns[SECOND].data)[row] = b->number;
    ((double *)table->columns[COVARIANCE].data)[row] = covariance;
    ((double *)table->columns[CORRELATION].data)[row] = covariance / (a->fit.fluxerr * b->fit.fluxerr);
}

/* by_entry[tphot->n]: sources that are still in the list, by their place in the fit. */
static rx_status index_sources(const rx_tphot *tphot, const rx_sources *sources, const rx_source ***by_entry,
                               rx_error *err)
{
    *by_entry = rx_alloc((size_t)tphot->n, sizeof **by_entry);
    if (*by_entry == NULL)
        return rx_error_memory(err, (size_t)tphot->n * sizeof **by_entry);
    for (int i = 0; i < sources->n; i++)
        (*by_entry)[sources->list[i].fit.entry] = &sources->list[i];
    return RX_OK;
}

rx_status rx_template_table(const rx_tphot *tphot, const rx_sources *sources, int extension, rx_table **dst,
                            rx_error *err)
{
    const int npairs = tphot != NULL ? tphot->npairs : 0;
    const rx_source **by_entry = NULL;
    rx_status status = RX_OK;
    long row = 0;
    rx_table *table = rx_table_new(NCOLUMNS);
    if (table == NULL)
        return rx_error_memory(err, NCOLUMNS * sizeof(rx_column));
    free(table->name);
    table->name = rx_strdup("COVARIANCES");
    if (table->name == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    if (tphot != NULL)
        RX_TRY_EXIT(index_sources(tphot, sources, &by_entry, err));
    for (int i = 0; i < npairs; i++)
        table->nrows += by_entry[tphot->pairs[i].i] != NULL && by_entry[tphot->pairs[i].j] != NULL;
    RX_TRY_EXIT(open_columns(table, err));
    for (int i = 0; i < npairs; i++) {
        const rx_source *a = by_entry[tphot->pairs[i].i], *b = by_entry[tphot->pairs[i].j];
        if (a != NULL && b != NULL)
            put(table, row++, extension, a, b, tphot->pairs[i].covariance);
    }
    *dst = table;
    table = NULL;
exit:
    free((void *)by_entry);
    rx_table_free(table);
    return status;
}
