/* From the source list to a table of the chosen columns. */
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "catalog/catalog.h"
#include "catalog/columns.h"

static void describe(rx_column *column, const rx_column_def *def, const int dim[2])
{
    snprintf(column->name, sizeof column->name, "%s", def->name);
    snprintf(column->unit, sizeof column->unit, "%s", def->unit);
    snprintf(column->ucd, sizeof column->ucd, "%s", def->ucd);
    snprintf(column->description, sizeof column->description, "%s", def->description);
    snprintf(column->format, sizeof column->format, "%s", def->format);
    column->type = def->type;
    /* One element is a plain number, as in SExtractor's FITS tables. */
    column->ndim = def->naxis == 1 && dim[0] <= 1 ? 0 : def->naxis;
    column->dim[0] = dim[0];
    column->dim[1] = dim[1];
}

static rx_status fill(rx_column *column, const rx_column_choice *choice, const rx_column_def *def,
                      const rx_image *image, const rx_sources *sources, rx_error *err)
{
    long elements = rx_column_elements(column);
    rx_cell_place place = {.image = image, .sources = sources, .dim = {choice->dim[0], choice->dim[1]}};
    size_t bytes = (size_t)elements * (size_t)rx_column_element_size(column);
    column->data = rx_alloc((size_t)sources->n, bytes);
    if (column->data == NULL)
        return rx_error_memory(err, (size_t)sources->n * bytes);
    for (place.row = 0; place.row < sources->n; place.row++)
        for (long i = 0; i < elements; i++)
            rx_column_set(column, place.row * elements + i, def->value(&sources->list[place.row], &place, i),
                          NULL);
    return RX_OK;
}

rx_status rx_catalog_table(const rx_column_list *list, const rx_image *image, const rx_sources *sources,
                           rx_table **dst, rx_error *err)
{
    rx_status status = RX_OK;
    int n;
    const rx_column_def *defs = rx_column_defs(&n);
    rx_table *table = rx_table_new(list->n);
    *dst = NULL;
    if (table == NULL)
        return rx_error_memory(err, (size_t)list->n * sizeof(rx_column));
    table->nrows = sources->n;
    free(table->name);
    table->name = rx_strdup("OBJECTS");
    if (table->name == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    for (int i = 0; i < list->n; i++) {
        const rx_column_choice *choice = &list->choice[i];
        describe(&table->columns[i], &defs[choice->index], choice->dim);
        RX_TRY_EXIT(fill(&table->columns[i], choice, &defs[choice->index], image, sources, err));
    }
    *dst = table;
    table = NULL;
exit:
    rx_table_free(table);
    return status;
}
