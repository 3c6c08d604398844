/* The truth catalogue. */
#include "simulate/truth.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

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

static void numbers_of(const rx_object *o, long number, rx_wcs *wcs, double dst[TRUTH_COLUMNS])
{
    const int galaxy = o->type == RX_OBJECT_GALAXY;
    dst[TRUTH_NUMBER] = (double)number;
    dst[TRUTH_X] = o->x + 1.0;
    dst[TRUTH_Y] = o->y + 1.0;
    if (wcs != NULL)
        rx_wcs_to_sky(wcs, 1, &o->x, &o->y, &dst[TRUTH_ALPHA], &dst[TRUTH_DELTA]);
    dst[TRUTH_FLUX] = o->flux;
    dst[TRUTH_MAG] = o->mag;
    dst[TRUTH_RADIUS] = o->radius;
    dst[TRUTH_ELONGATION] = 1.0 / ratio_of(o);
    dst[TRUTH_THETA] = o->type == RX_OBJECT_STAR ? 0.0 : remainder(o->angle * (180.0 / M_PI), 180.0);
    dst[TRUTH_BULGE] = galaxy ? o->bulge_share : 0.0;
    dst[TRUTH_SERSIC] = !galaxy ? 0.0 : o->bulge_share > 0.0 ? o->bulge_n : 1.0;
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

static void set_cell(rx_column *dst, long row, double number, const char *text)
{
    if (dst->type == RX_CELL_TEXT) /* memory is zeroed and the last byte stays */
        strncpy((char *)dst->data + row * dst->text_width, text, (size_t)dst->text_width - 1);
    else if (dst->type == RX_CELL_INT32)
        ((int32_t *)dst->data)[row] = (int32_t)number;
    else if (dst->type == RX_CELL_FLOAT)
        ((float *)dst->data)[row] = (float)number;
    else
        ((double *)dst->data)[row] = number;
}

rx_status rx_truth_table(const rx_scene *scene, rx_wcs *wcs, int all, rx_table **dst, rx_error *err)
{
    rx_table *table = rx_table_new(wcs != NULL ? TRUTH_COLUMNS : TRUTH_COLUMNS - 2);
    rx_column *column[TRUTH_COLUMNS] = {NULL};
    int missing = table == NULL;
    *dst = NULL;
    for (long i = 0; i < scene->n && !missing; i++)
        table->nrows += all || is_inside(scene, &scene->objects[i]);
    for (int k = 0, place = 0; k < TRUTH_COLUMNS && !missing; k++)
        if (wcs != NULL || (k != TRUTH_ALPHA && k != TRUTH_DELTA)) {
            column[k] = &table->columns[place++];
            missing = !set_format(column[k], &formats[k], table->nrows);
        }
    if (missing) {
        rx_table_free(table);
        return rx_error_memory(err, 0);
    }
    for (long i = 0, row = 0; i < scene->n; i++) {
        const rx_object *object = &scene->objects[i];
        double numbers[TRUTH_COLUMNS];
        if (!all && !is_inside(scene, object))
            continue;
        numbers_of(object, i + 1, wcs, numbers);
        for (int k = 0; k < TRUTH_COLUMNS; k++)
            if (column[k] != NULL)
                set_cell(column[k], row, numbers[k], text_of(scene, object, (truth_column)k));
        row++;
    }
    *dst = table;
    return RX_OK;
}
