/* Tables in memory. */
#include "data/table.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"

long rx_column_elements(const rx_column *column)
{
    long n = 1;
    for (int i = 0; i < column->ndim; i++)
        n *= column->dim[i];
    return n;
}

long rx_column_element_size(const rx_column *column)
{
    switch (column->type) {
    case RX_CELL_INT16:
        return 2;
    case RX_CELL_INT32:
    case RX_CELL_FLOAT:
        return 4;
    case RX_CELL_INT64:
    case RX_CELL_DOUBLE:
        return 8;
    case RX_CELL_TEXT:
        return column->text_width;
    }
    return 0;
}

rx_table *rx_table_new(int ncolumns)
{
    rx_table *table = RX_NEW(rx_table, 1);
    if (table == NULL)
        return NULL;
    table->columns = RX_NEW(rx_column, (size_t)ncolumns);
    table->name = rx_strdup("");
    table->ncolumns = ncolumns;
    if (table->columns == NULL || table->name == NULL) {
        rx_table_free(table);
        return NULL;
    }
    return table;
}

rx_status rx_table_make(const char *name, const rx_column *like, int n, long nrows, rx_table **dst,
                        rx_error *err)
{
    *dst = NULL;
    rx_table *table = rx_table_new(n);
    if (table == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *like);
    free(table->name);
    table->name = rx_strdup(name);
    table->nrows = nrows;
    bool made = table->name != NULL;
    for (int i = 0; i < n; i++) {
        rx_column *column = &table->columns[i];
        *column = like[i];
        column->data =
            rx_alloc((size_t)nrows, (size_t)(rx_column_elements(column) * rx_column_element_size(column)));
        made = made && column->data != NULL;
    }
    if (!made) {
        rx_table_free(table);
        return rx_error_memory(err, 0);
    }
    *dst = table;
    return RX_OK;
}

rx_status rx_table_copy_cards(rx_table *table, const char *cards, size_t n, rx_error *err)
{
    table->cards = rx_alloc(n, 80);
    if (table->cards == NULL)
        return rx_error_memory(err, n * 80);
    memcpy(table->cards, cards, n * 80);
    table->ncards = (long)n;
    return RX_OK;
}

void rx_table_free(rx_table *table)
{
    if (table == NULL)
        return;
    for (int i = 0; table->columns != NULL && i < table->ncolumns; i++)
        free(table->columns[i].data);
    free(table->columns);
    free(table->name);
    free(table->cards);
    free(table->facts);
    free(table);
}

int rx_table_find(const rx_table *table, const char *name)
{
    for (int i = 0; i < table->ncolumns; i++)
        if (strcasecmp(table->columns[i].name, name) == 0)
            return i;
    return -1;
}

double rx_column_value(const rx_column *column, long row, long element)
{
    long i = row * rx_column_elements(column) + element;
    switch (column->type) {
    case RX_CELL_INT16:
        return ((const int16_t *)column->data)[i];
    case RX_CELL_INT32:
        return ((const int32_t *)column->data)[i];
    case RX_CELL_INT64:
        return (double)((const int64_t *)column->data)[i];
    case RX_CELL_FLOAT:
        return ((const float *)column->data)[i];
    case RX_CELL_DOUBLE:
        return ((const double *)column->data)[i];
    case RX_CELL_TEXT:
        break;
    }
    return NAN;
}

/* Out-of-range integers stop at the type's ends instead of wrapping. */
static double clamp(double value, double low, double high)
{
    return isnan(value) ? 0.0 : value < low ? low : value > high ? high : value;
}

void rx_column_set(rx_column *column, long i, double number, const char *text)
{
    switch (column->type) {
    case RX_CELL_INT16:
        ((int16_t *)column->data)[i] = (int16_t)clamp(number, INT16_MIN, INT16_MAX);
        break;
    case RX_CELL_INT32:
        ((int32_t *)column->data)[i] = (int32_t)clamp(number, INT32_MIN, INT32_MAX);
        break;
    case RX_CELL_INT64: /* the largest double below 2^63 */
        ((int64_t *)column->data)[i] = (int64_t)clamp(number, (double)INT64_MIN, 0x1.fffffffffffffp62);
        break;
    case RX_CELL_FLOAT:
        ((float *)column->data)[i] = (float)number;
        break;
    case RX_CELL_DOUBLE:
        ((double *)column->data)[i] = number;
        break;
    case RX_CELL_TEXT:
        snprintf((char *)column->data + i * column->text_width, (size_t)column->text_width, "%s", text);
        break;
    }
}
