/* Forced photometry: its list and its table. */
#include "stage/positions.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "catalog/catalog.h"
#include "io/wcs.h"
#include "stage/coordinates.h"

/* Columns that identify a row in lists of programs and archives, tried in this order. */
static const char *const identifiers[] = {"NUMBER",    "ID",     "SOURCE_ID", "OBJID",
                                          "OBJECT_ID", "SOURCE", "NAME"};

/* Its columns, with what some of them mean here. */
static const struct {
    const char *name, *description;
} columns[] = {{"NUMBER", "Row of the list, from 1"},
               {"EXT_NUMBER", NULL},
               {"ALPHA_J2000", "Right ascension of the listed position (J2000)"},
               {"DELTA_J2000", "Declination of the listed position (J2000)"},
               {"X_IMAGE_DBL", "Listed position along x"},
               {"Y_IMAGE_DBL", "Listed position along y"},
               {"FLUX_TEMPLATE", "Flux of a point there"},
               {"FLUXERR_TEMPLATE", NULL},
               {"FLUXLIM_TEMPLATE", NULL},
               {"MAG_TEMPLATE", "Its magnitude"},
               {"MAGERR_TEMPLATE", NULL},
               {"MAGLIM_TEMPLATE", NULL},
               {"SNR_TEMPLATE", NULL},
               {"CHI2_TEMPLATE", NULL},
               {"BLEND_TEMPLATE", NULL},
               {"NUMBER_ASSOC", "Sources of the catalogue that it was fitted in place of"},
               {"FLAGS_TEMPLATE", NULL}};

enum { NIDENTIFIERS = sizeof identifiers / sizeof *identifiers, NCOLUMNS = sizeof columns / sizeof *columns };

rx_status rx_position_list_read(const char *path, rx_table **dst, rx_error *err)
{
    rx_table *list = NULL;
    int x, y;
    rx_status status;
    RX_TRY_EXIT(rx_catalog_read(path, 0, &list, err));
    if (list->nrows >= INT32_MAX)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, -1, 0, "has too many rows"));
    for (int sky = 0, known = 0; sky < 2 && list->nrows > 0; sky++) { /* an empty list may have no columns */
        const bool there = rx_catalog_find_positions(list, sky == 1, &x, &y);
        known |= there;
        if (there)
            RX_TRY_EXIT(rx_catalog_need_numbers(path, list, x, err));
        if (there)
            RX_TRY_EXIT(rx_catalog_need_numbers(path, list, y, err));
        if (sky == 1 && !known)
            RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, -1, 0,
                                    "no position columns were recognised; call them ALPHA_J2000 and "
                                    "DELTA_J2000, or X_IMAGE and Y_IMAGE"));
    }
    *dst = list;
    list = NULL;
exit:
    rx_table_free(list);
    return status;
}

rx_status rx_position_list_pixels(const rx_table *list, const char *path, const rx_tile *tile, rx_log *log,
                                  rx_positions *dst, rx_error *err)
{
    int x = 0, y = 0, inside = 0;
    const bool sky = tile->wcs != NULL && rx_catalog_find_positions(list, true, &x, &y);
    if (!sky && list->nrows > 0 && !rx_catalog_find_positions(list, false, &x, &y))
        return rx_error_at(err, RX_INPUT, tile->name, tile->hdu, 0,
                           "has no celestial coordinates, and %.200s no pixels; give it X_IMAGE and Y_IMAGE",
                           path);
    RX_TRY(RX_MAKE(dst->at, (size_t)list->nrows + 1, err));
    dst->n = (int)list->nrows;
    for (long i = 0; i < list->nrows; i++) {
        const double first = rx_column_value(&list->columns[x], i, 0),
                     second = rx_column_value(&list->columns[y], i, 0);
        dst->at[i][0] = first - 1; /* FITS counts from 1 */
        dst->at[i][1] = second - 1;
        if (sky)
            rx_wcs_to_pixel(tile->wcs, 1, &first, &second, &dst->at[i][0], &dst->at[i][1]);
        inside += dst->at[i][0] > -0.5 && dst->at[i][0] < tile->width - 0.5 && dst->at[i][1] > -0.5 &&
                  dst->at[i][1] < tile->height - 0.5;
    }
    if (inside == 0)
        rx_log_warning(log, "%s[%d]: none of the %d positions of %s lies on it", tile->name, tile->hdu,
                       dst->n, path);
    return RX_OK;
}

/* The list's identifiers take the place of the table's first column, which has as many rows. */
static rx_status identify(const rx_table *list, rx_table *table, rx_error *err)
{
    const rx_column *own = NULL;
    for (int i = 0; i < NIDENTIFIERS && own == NULL; i++) {
        const int k = rx_table_find(list, identifiers[i]);
        own = k >= 0 && rx_column_elements(&list->columns[k]) == 1 ? &list->columns[k] : NULL;
    }
    if (own == NULL || list->nrows == 0)
        return RX_OK;
    const size_t size = (size_t)rx_column_element_size(own);
    void *data = rx_alloc((size_t)list->nrows, size);
    if (data == NULL)
        return rx_error_memory(err, (size_t)list->nrows * size);
    memcpy(data, own->data, (size_t)list->nrows * size);
    free(table->columns[0].data);
    table->columns[0] = *own;
    table->columns[0].data = data;
    return RX_OK;
}

rx_status rx_position_list_table(const rx_table *list, const rx_image *image, rx_sources *forced,
                                 rx_table **dst, rx_error *err)
{
    rx_column_list *chosen = NULL;
    rx_table *table = NULL;
    const char *names[NCOLUMNS];
    int alpha, delta;
    rx_status status;
    RX_TRY_EXIT(rx_coordinates_fill(image, forced, err));
    for (int i = 0;
         i < forced->n && image->wcs != NULL && rx_catalog_find_positions(list, true, &alpha, &delta);
         i++) { /* as listed, beyond the projection, too */
        forced->list[i].alpha_j2000 = rx_column_value(&list->columns[alpha], i, 0);
        forced->list[i].delta_j2000 = rx_column_value(&list->columns[delta], i, 0);
    }
    for (int i = 0; i < NCOLUMNS; i++)
        names[i] = columns[i].name;
    RX_TRY_EXIT(rx_columns_of(names, NCOLUMNS, &chosen, err));
    RX_TRY_EXIT(rx_catalog_table(chosen, image, forced, &table, err));
    for (int i = 0; i < NCOLUMNS; i++)
        if (columns[i].description != NULL)
            snprintf(table->columns[i].description, sizeof table->columns[i].description, "%s",
                     columns[i].description);
    free(table->name);
    table->name = rx_strdup("POSITIONS");
    RX_TRY_EXIT(table->name == NULL ? rx_error_memory(err, 0) : identify(list, table, err));
    *dst = table;
    table = NULL;
exit:
    rx_columns_free(chosen);
    rx_table_free(table);
    return status;
}
