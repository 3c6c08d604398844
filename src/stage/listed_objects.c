/* Objects of a user's list. */
#include "stage/listed_objects.h"

#include <math.h>

#include "base/memory.h"
#include "catalog/catalog.h"

enum { MAG, FLUX, RADIUS, ELONGATION, THETA, INDEX, NUMBERS };

/* What a column may hold, and what stands for one that is not there. */
static const struct {
    const char *name;
    double least, most, without;
} COLUMN[NUMBERS] = {[MAG] = {"MAG", -50, 99, NAN},           [FLUX] = {"FLUX", 0, 1e30, NAN},
                     [RADIUS] = {"FLUX_RADIUS", 0, 1e4, 0},   [ELONGATION] = {"ELONGATION", 1, 20, 1},
                     [THETA] = {"THETA_IMAGE", -360, 360, 0}, [INDEX] = {"SERSIC_N", 0.3, 8, 1}};

static rx_status find_columns(const char *path, const rx_table *list, bool *sky, int position[2],
                              int column[NUMBERS], rx_error *err)
{
    *sky = *sky && rx_catalog_find_positions(list, true, &position[0], &position[1]);
    if (!*sky && !rx_catalog_find_positions(list, false, &position[0], &position[1]))
        return rx_error_at(err, RX_INPUT, path, -1, 0,
                           "has no columns of positions; call them X_IMAGE and Y_IMAGE, pixels from 1, or on "
                           "a tile with celestial coordinates ALPHA_J2000 and DELTA_J2000");
    for (int i = 0; i < 2; i++)
        RX_TRY(rx_catalog_need_numbers(path, list, position[i], err));
    for (int i = 0; i < NUMBERS; i++) {
        column[i] = rx_table_find(list, COLUMN[i].name);
        if (column[i] >= 0)
            RX_TRY(rx_catalog_need_numbers(path, list, column[i], err));
    }
    if (column[MAG] < 0 && column[FLUX] < 0)
        return rx_error_at(err, RX_INPUT, path, -1, 0,
                           "says not how bright its objects are; give it MAG or FLUX");
    return RX_OK;
}

static rx_status read_row(const char *path, const rx_table *list, const int column[NUMBERS], long row,
                          double value[NUMBERS], rx_error *err)
{
    for (int i = 0; i < NUMBERS; i++) {
        value[i] = COLUMN[i].without;
        if (column[i] < 0)
            continue;
        value[i] = rx_column_value(&list->columns[column[i]], row, 0);
        /* the truth's index of a star is 0 */
        const bool unused = i == INDEX && value[i] == 0.0 && value[RADIUS] == 0.0;
        if (!unused && !(value[i] >= COLUMN[i].least && value[i] <= COLUMN[i].most))
            return rx_error_at(err, RX_INPUT, path, -1, 0, "row %ld: %s is %g; give %g to %g", row + 1,
                               COLUMN[i].name, value[i], COLUMN[i].least, COLUMN[i].most);
    }
    return RX_OK;
}

/* One Sersic profile; its exponential disk where the index is 1. */
static rx_object object_of(const double value[NUMBERS], double zeropoint)
{
    const double flux = isfinite(value[FLUX]) ? value[FLUX] : pow(10.0, -0.4 * (value[MAG] - zeropoint));
    rx_object object = {
        .type = RX_OBJECT_STAR, .flux = flux, .mag = zeropoint - 2.5 * log10(flux), .ratio = 1};
    if (!(value[RADIUS] > 0))
        return object;
    object.type = RX_OBJECT_GALAXY;
    object.radius = value[RADIUS];
    object.ratio = object.bulge_ratio = 1 / value[ELONGATION];
    object.angle = value[THETA] * M_PI / 180;
    if (value[INDEX] == 1.0) {
        object.disk_radius = object.radius;
        return object;
    }
    object.bulge_share = 1;
    object.bulge_n = value[INDEX];
    object.bulge_radius = object.radius;
    return object;
}

rx_status rx_listed_objects(const char *path, rx_wcs *wcs, rx_simulation *simulation, rx_error *err)
{
    const rx_scene_params *scene = &simulation->scene;
    rx_table *list = NULL;
    long used = 0;
    bool sky = wcs != NULL;
    int position[2], column[NUMBERS];
    rx_status status;
    RX_TRY_EXIT(rx_catalog_read(path, 0, &list, err));
    RX_TRY_EXIT(find_columns(path, list, &sky, position, column, err));
    RX_TRY_EXIT(RX_MAKE(simulation->listed, (size_t)list->nrows, err));
    for (long i = 0; i < list->nrows; i++) {
        const double x = rx_column_value(&list->columns[position[0]], i, 0),
                     y = rx_column_value(&list->columns[position[1]], i, 0);
        double value[NUMBERS];
        RX_TRY_EXIT(read_row(path, list, column, i, value, err));
        rx_object *object = &simulation->listed[used];
        *object = object_of(value, simulation->scene.zeropoint);
        object->x = x - 1; /* FITS counts from 1 */
        object->y = y - 1;
        if (sky)
            rx_wcs_to_pixel(wcs, 1, &x, &y, &object->x, &object->y);
        /* objects of the whole survey may be listed: those farther away than the tile is large are left out */
        used += object->x > -scene->width && object->x < 2 * scene->width && object->y > -scene->height &&
                object->y < 2 * scene->height;
    }
    simulation->scene.listed = simulation->listed;
    simulation->scene.nlisted = used;
exit:
    rx_table_free(list);
    return status;
}
