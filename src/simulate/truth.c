/* The truth catalogue. */
#include "simulate/truth.h"

#include <math.h>

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

static const rx_column COLUMNS[TRUTH_COLUMNS] = {
    [TRUTH_NUMBER] = {"NUMBER", "", "meta.id;meta.main", "Running object number", "%10d",
                      .type = RX_CELL_INT32},
    [TRUTH_X] = {"X_IMAGE", "pixel", "pos.cartesian.x;instr.det", "True position along x", "%12.5f",
                 .type = RX_CELL_DOUBLE},
    [TRUTH_Y] = {"Y_IMAGE", "pixel", "pos.cartesian.y;instr.det", "True position along y", "%12.5f",
                 .type = RX_CELL_DOUBLE},
    [TRUTH_ALPHA] = {"ALPHA_J2000", "deg", "pos.eq.ra;meta.main", "True right ascension (J2000)", "%12.8f",
                     .type = RX_CELL_DOUBLE},
    [TRUTH_DELTA] = {"DELTA_J2000", "deg", "pos.eq.dec;meta.main", "True declination (J2000)", "%+12.8f",
                     .type = RX_CELL_DOUBLE},
    [TRUTH_FLUX] = {"FLUX", "adu", "phot.flux", "True total flux", "%14.7g", .type = RX_CELL_DOUBLE},
    [TRUTH_MAG] = {"MAG", "mag", "phot.mag", "True total magnitude", "%9.5f", .type = RX_CELL_DOUBLE},
    [TRUTH_TYPE] = {"TYPE", "", "src.class", "STAR, GALAXY or TEMPLATE", "", .type = RX_CELL_TEXT,
                    .text_width = 9},
    [TRUTH_RADIUS] = {"FLUX_RADIUS", "pixel", "phys.angSize",
                      "True half-light radius along the major axis, without PSF or bar; 0: star", "%10.4f",
                      .type = RX_CELL_FLOAT},
    [TRUTH_ELONGATION] = {"ELONGATION", "", "src.ellipticity", "True major over minor axis", "%8.4f",
                          .type = RX_CELL_FLOAT},
    [TRUTH_THETA] = {"THETA_IMAGE", "deg", "pos.posAng;instr.det",
                     "True position angle of the major axis (CCW/x)", "%7.2f", .type = RX_CELL_FLOAT},
    [TRUTH_BULGE] = {"BULGE_SHARE", "", "arith.ratio", "Share of the bulge in the flux", "%7.4f",
                     .type = RX_CELL_FLOAT},
    [TRUTH_SERSIC] = {"SERSIC_N", "", "src.morph.param",
                      "Sersic index of the bulge, of the disk without one; 0 for stars and templates",
                      "%7.3f", .type = RX_CELL_FLOAT},
    [TRUTH_TEMPLATE] = {"TEMPLATE", "", "meta.id", "Name of the template", "", .type = RX_CELL_TEXT,
                        .text_width = (int)sizeof((rx_template *)0)->name},
};

/* --- one cell --- */

static void numbers_of(const rx_object *o, long number, rx_wcs *wcs, double dst[TRUTH_COLUMNS])
{
    const int galaxy = o->type == RX_OBJECT_GALAXY;
    const double ratio = o->type == RX_OBJECT_STAR         ? 1.0
                         : galaxy && o->bulge_share >= 1.0 ? o->bulge_ratio
                                                           : o->ratio;
    dst[TRUTH_NUMBER] = (double)number;
    dst[TRUTH_X] = o->x + 1.0;
    dst[TRUTH_Y] = o->y + 1.0;
    if (wcs != NULL)
        rx_wcs_to_sky(wcs, 1, &o->x, &o->y, &dst[TRUTH_ALPHA], &dst[TRUTH_DELTA]);
    dst[TRUTH_FLUX] = o->flux;
    dst[TRUTH_MAG] = o->mag;
    dst[TRUTH_RADIUS] = o->radius;
    dst[TRUTH_ELONGATION] = 1.0 / (ratio > 0.0 ? ratio : 1.0);
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

rx_status rx_truth_table(const rx_scene *scene, rx_wcs *wcs, int all, rx_table **dst, rx_error *err)
{
    rx_column like[TRUTH_COLUMNS];
    int shown[TRUTH_COLUMNS], n = 0;
    long nrows = 0;
    for (long i = 0; i < scene->n; i++)
        nrows += all || is_inside(scene, &scene->objects[i]);
    for (int k = 0; k < TRUTH_COLUMNS; k++)
        if (wcs != NULL || (k != TRUTH_ALPHA && k != TRUTH_DELTA)) {
            shown[n] = k;
            like[n++] = COLUMNS[k];
        }
    RX_TRY(rx_table_make("", like, n, nrows, dst, err));
    for (long i = 0, row = 0; i < scene->n; i++) {
        const rx_object *object = &scene->objects[i];
        double numbers[TRUTH_COLUMNS];
        if (!all && !is_inside(scene, object))
            continue;
        numbers_of(object, i + 1, wcs, numbers);
        for (int k = 0; k < n; k++)
            rx_column_set(&(*dst)->columns[k], row, numbers[shown[k]],
                          text_of(scene, object, (truth_column)shown[k]));
        row++;
    }
    return RX_OK;
}
