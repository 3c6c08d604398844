/* The truth catalogue. */
#include "simulate/truth.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

#define DEGREE (180.0 / 3.14159265358979323846)

typedef enum truth_column {
    TRUTH_NUMBER,
    TRUTH_X,
    TRUTH_Y,
    TRUTH_ALPHA,
    TRUTH_DELTA,
    TRUTH_FLUX,
    TRUTH_MAG,
    TRUTH_TYPE,
    TRUTH_RADIUS,
    TRUTH_ELONGATION,
    TRUTH_THETA,
    TRUTH_BULGE,
    TRUTH_SERSIC,
    TRUTH_TEMPLATE,
    TRUTH_COLUMNS
} truth_column;

typedef struct truth_format {
    const char *name, *unit, *ucd, *format, *description;
    rx_cell_type type;
    int text_width;
} truth_format;

static const truth_format formats[TRUTH_COLUMNS] = {
    [TRUTH_NUMBER] = {"NUMBER", "", "meta.id;meta.main", "%10d", "Running object number", RX_CELL_INT32, 0},
    [TRUTH_X] = {"X_IMAGE", "pixel", "pos.cartesian.x;instr.det", "%12.5f", "True position along x",
                 RX_CELL_DOUBLE, 0},
    [TRUTH_Y] = {"Y_IMAGE", "pixel", "pos.cartesian.y;instr.det", "%12.5f", "True position along y",
                 RX_CELL_DOUBLE, 0},
    [TRUTH_ALPHA] = {"ALPHA_J2000", "deg", "pos.eq.ra;meta.main", "%12.8f", "True right ascension (J2000)",
                     RX_CELL_DOUBLE, 0},
    [TRUTH_DELTA] = {"DELTA_J2000", "deg", "pos.eq.dec;meta.main", "%+12.8f", "True declination (J2000)",
                     RX_CELL_DOUBLE, 0},
    [TRUTH_FLUX] = {"FLUX", "adu", "phot.flux", "%14.7g", "True total flux", RX_CELL_DOUBLE, 0},
    [TRUTH_MAG] = {"MAG", "mag", "phot.mag", "%9.5f", "True total magnitude", RX_CELL_DOUBLE, 0},
    [TRUTH_TYPE] = {"TYPE", "", "src.class", "", "STAR, GALAXY or TEMPLATE", RX_CELL_TEXT, 9},
    [TRUTH_RADIUS] = {"FLUX_RADIUS", "pixel", "phys.angSize", "%10.4f",
                      "True half-light radius along the major axis, without PSF or bar; 0: star",
                      RX_CELL_FLOAT, 0},
    [TRUTH_ELONGATION] = {"ELONGATION", "", "src.ellipticity", "%8.4f", "True major over minor axis",
                          RX_CELL_FLOAT, 0},
    [TRUTH_THETA] = {"THETA_IMAGE", "deg", "pos.posAng;instr.det", "%7.2f",
                     "True position angle of the major axis (CCW/x)", RX_CELL_FLOAT, 0},
    [TRUTH_BULGE] = {"BULGE_SHARE", "", "arith.ratio", "%7.4f", "Share of the bulge in the flux",
                     RX_CELL_FLOAT, 0},
    [TRUTH_SERSIC] = {"SERSIC_N", "", "src.morph.param", "%7.3f",
                      "Sersic index of the bulge, of the disk without one; 0 for stars and templates",
                      RX_CELL_FLOAT, 0},
    [TRUTH_TEMPLATE] = {"TEMPLATE", "", "meta.id", "", "Name of the template", RX_CELL_TEXT, 0},
};

/* --- one cell --- */

static double ratio_of(const rx_object *object)
{
    double ratio = object->type == RX_OBJECT_STAR ? 1.0 : object->ratio;
    if (object->type == RX_OBJECT_GALAXY && object->bulge_share >= 1.0)
        ratio = object->bulge_ratio;
    return ratio > 0.0 ? ratio : 1.0;
}

static double number_of(const rx_object *object, truth_column column)
{
    switch (column) {
    case TRUTH_X:
        return object->x + 1.0;
    case TRUTH_Y:
        return object->y + 1.0;
    case TRUTH_FLUX:
        return object->flux;
    case TRUTH_MAG:
        return object->mag;
    case TRUTH_RADIUS:
        return object->radius;
    case TRUTH_ELONGATION:
        return 1.0 / ratio_of(object);
    case TRUTH_THETA:
        return object->type == RX_OBJECT_STAR ? 0.0 : remainder(object->angle * DEGREE, 180.0);
    case TRUTH_BULGE:
        return object->type == RX_OBJECT_GALAXY ? object->bulge_share : 0.0;
    case TRUTH_SERSIC:
        if (object->type != RX_OBJECT_GALAXY)
            return 0.0;
        return object->bulge_share > 0.0 ? object->bulge_n : 1.0;
    default:
        return NAN;
    }
}

static const char *text_of(const rx_scene *scene, const rx_object *object, truth_column column)
{
    static const char *const types[] = {
        [RX_OBJECT_STAR] = "STAR", [RX_OBJECT_GALAXY] = "GALAXY", [RX_OBJECT_TEMPLATE] = "TEMPLATE"};
    if (column == TRUTH_TYPE)
        return types[object->type];
    if (object->type != RX_OBJECT_TEMPLATE || scene->templates == NULL)
        return "";
    return scene->templates->list[object->template_index].name;
}

/* --- the table --- */

static int is_inside(const rx_scene *scene, const rx_object *object)
{
    return object->x >= -0.5 && object->x < scene->width - 0.5 && object->y >= -0.5 &&
           object->y < scene->height - 0.5;
}

static int set_format(rx_column *dst, const truth_format *format, long nrows)
{
    snprintf(dst->name, sizeof dst->name, "%s", format->name);
    snprintf(dst->unit, sizeof dst->unit, "%s", format->unit);
    snprintf(dst->ucd, sizeof dst->ucd, "%s", format->ucd);
    snprintf(dst->format, sizeof dst->format, "%s", format->format);
    snprintf(dst->description, sizeof dst->description, "%s", format->description);
    dst->type = format->type;
    dst->text_width = format->text_width;
    if (format->type == RX_CELL_TEXT && format->text_width == 0)
        dst->text_width = (int)sizeof((rx_template *)0)->name;
    dst->data = rx_alloc((size_t)nrows, (size_t)rx_column_element_size(dst));
    return dst->data != NULL;
}

static void fill_column(const rx_scene *scene, const long *rows, long nrows, truth_column which,
                        rx_column *dst)
{
    for (long i = 0; i < nrows; i++) {
        const rx_object *object = &scene->objects[rows[i]];
        if (dst->type == RX_CELL_TEXT) /* memory is zeroed and the last byte stays */
            strncpy((char *)dst->data + i * dst->text_width, text_of(scene, object, which),
                    (size_t)dst->text_width - 1);
        else if (dst->type == RX_CELL_INT32)
            ((int32_t *)dst->data)[i] = (int32_t)(rows[i] + 1);
        else if (dst->type == RX_CELL_FLOAT)
            ((float *)dst->data)[i] = (float)number_of(object, which);
        else
            ((double *)dst->data)[i] = number_of(object, which);
    }
}

/* x and y of the table, from 1, to its alpha and delta. */
static rx_status fill_sky(const rx_scene *scene, const long *rows, long nrows, rx_wcs *wcs, double *alpha,
                          double *delta, rx_error *err)
{
    double *x = RX_NEW(double, (size_t)nrows), *y = RX_NEW(double, (size_t)nrows);
    rx_status status =
        x == NULL || y == NULL ? rx_error_memory(err, 2 * sizeof(double) * (size_t)nrows) : RX_OK;
    for (long i = 0; status == RX_OK && i < nrows; i++) {
        x[i] = scene->objects[rows[i]].x;
        y[i] = scene->objects[rows[i]].y;
    }
    if (status == RX_OK && nrows > 0)
        rx_wcs_to_sky(wcs, (int)nrows, x, y, alpha, delta);
    free(x);
    free(y);
    return status;
}

rx_status rx_truth_table(const rx_scene *scene, rx_wcs *wcs, int all, rx_table **dst, rx_error *err)
{
    long *rows = RX_NEW(long, (size_t)scene->n), nrows = 0;
    rx_table *table = rx_table_new(wcs != NULL ? TRUTH_COLUMNS : TRUTH_COLUMNS - 2);
    rx_status status = RX_OK;
    *dst = NULL;
    if (rows == NULL || table == NULL)
        RX_TRY_EXIT(rx_error_memory(err, sizeof(long) * (size_t)scene->n));
    for (long i = 0; i < scene->n; i++)
        if (all || is_inside(scene, &scene->objects[i]))
            rows[nrows++] = i;
    table->nrows = nrows;
    for (int k = 0, place = 0; k < TRUTH_COLUMNS; k++) {
        if (wcs == NULL && (k == TRUTH_ALPHA || k == TRUTH_DELTA))
            continue;
        rx_column *column = &table->columns[place++];
        if (!set_format(column, &formats[k], nrows))
            RX_TRY_EXIT(rx_error_memory(err, 0));
        fill_column(scene, rows, nrows, (truth_column)k, column);
    }
    if (wcs != NULL)
        status = fill_sky(scene, rows, nrows, wcs, table->columns[TRUTH_ALPHA].data,
                          table->columns[TRUTH_DELTA].data, err);
    if (status != RX_OK)
        goto exit;
    *dst = table;
    table = NULL;
exit:
    rx_table_free(table);
    free(rows);
    return status;
}
