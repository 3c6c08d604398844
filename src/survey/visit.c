/* Catalogues of visits. */
#include "survey/visit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "catalog/catalog.h"
#include "io/fits_read.h"

static const double DEG = M_PI / 180.0, ARCSEC = 3600.0;

/* --- columns --- */

static bool take(const rx_table *table, const char *name, char dst[72])
{
    const bool there = rx_table_find(table, name) >= 0;
    if (there)
        snprintf(dst, 72, "%s", name);
    return there;
}

static bool find_positions(const rx_table *table, rx_visit_columns *dst)
{
    static const char *const best[][2] = {{"ALPHATEMPLATE_J2000", "DELTATEMPLATE_J2000"},
                                          {"ALPHAPSF_J2000", "DELTAPSF_J2000"},
                                          {"ALPHAWIN_J2000", "DELTAWIN_J2000"}};
    int x, y;
    for (size_t i = 0; i < sizeof best / sizeof *best; i++)
        if (take(table, best[i][0], dst->alpha) && take(table, best[i][1], dst->delta))
            return true;
    if (!rx_catalog_find_positions(table, true, &x, &y))
        return false;
    return take(table, table->columns[x].name, dst->alpha) && take(table, table->columns[y].name, dst->delta);
}

static bool find_magnitudes(const rx_survey_config *config, const rx_table *table, rx_visit_columns *dst)
{
    static const char *const kinds[] = {"_TEMPLATE", "_PSF", "_AUTO", "_BEST", "_PETRO", "_ISO", ""};
    char name[2][16];
    if (config->repeat_columns.n == 2)
        return take(table, config->repeat_columns.v[0], dst->mag) &&
               take(table, config->repeat_columns.v[1], dst->error);
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        snprintf(name[0], sizeof name[0], "MAG%s", kinds[i]);
        snprintf(name[1], sizeof name[1], "MAGERR%s", kinds[i]);
        if (take(table, name[0], dst->mag) && take(table, name[1], dst->error))
            return true;
    }
    return false;
}

rx_status rx_visit_columns_find(const rx_survey_config *config, const char *path, rx_visit_columns *dst,
                                rx_error *err)
{
    static const char *const stars[] = {"CLASS_TEMPLATE", "P_STAR", "CLASS_STAR"};
    rx_table *table = NULL;
    *dst = (rx_visit_columns){0};
    RX_TRY(rx_catalog_read(path, 0, &table, err));
    rx_status status = RX_OK;
    if (!find_positions(table, dst))
        status = rx_error_at(err, RX_INPUT, path, -1, 0,
                             "has no column of positions on the sky, by which visits are matched; write "
                             "ALPHAWIN_J2000 and DELTAWIN_J2000, of an image with world coordinates");
    else if (!find_magnitudes(config, table, dst))
        status = config->repeat_columns.n == 2
                     ? rx_error_at(err, RX_INPUT, path, -1, 0,
                                   "has no columns %s and %s; name existing ones in REPEAT_COLUMNS",
                                   config->repeat_columns.v[0], config->repeat_columns.v[1])
                     : rx_error_at(err, RX_INPUT, path, -1, 0,
                                   "has no magnitudes with errors, as MAG_AUTO and MAGERR_AUTO; name them in "
                                   "REPEAT_COLUMNS");
    for (size_t i = 0; i < sizeof stars / sizeof *stars && dst->star[0] == '\0'; i++)
        take(table, stars[i], dst->star);
    take(table, "FLAGS", dst->flags);
    rx_table_free(table);
    return status;
}

/* --- reading --- */

/* The column, or NULL where `name` is "". */
static rx_status find_column(const char *path, const rx_table *table, const char *name, const rx_column **dst,
                             rx_error *err)
{
    const int i = name[0] != '\0' ? rx_table_find(table, name) : -1;
    *dst = i >= 0 ? &table->columns[i] : NULL;
    if (name[0] != '\0' && i < 0)
        return rx_error_at(err, RX_INPUT, path, -1, 0,
                           "has no column %s, which the first visit has; give all visits the same columns",
                           name);
    return i >= 0 ? rx_catalog_need_numbers(path, table, i, err) : RX_OK;
}

static rx_status grow(rx_visit *v, size_t n, rx_error *err)
{
    double **const columns[] = {&v->alpha, &v->delta, &v->x, &v->y, &v->mag, &v->error, &v->star};
    for (size_t i = 0; i < sizeof columns / sizeof *columns; i++)
        RX_TRY(RX_GROW(*columns[i], n, err));
    return RX_GROW(v->flags, n, err);
}

static rx_status add_rows(const char *path, const rx_table *table, const rx_visit_columns *names, rx_visit *v,
                          rx_error *err)
{
    const char *const name[] = {names->alpha, names->delta, names->mag,
                                names->error, names->star,  names->flags};
    enum { ALPHA, DELTA, MAG, ERROR, STAR, FLAGS, COLUMNS };
    const rx_column *column[COLUMNS];
    for (int i = 0; i < COLUMNS; i++)
        RX_TRY(find_column(path, table, name[i], &column[i], err));
    RX_TRY(grow(v, (size_t)(v->n + table->nrows) + 1, err));
    for (long row = 0; row < table->nrows; row++) {
        double value[COLUMNS];
        for (int i = 0; i < COLUMNS; i++)
            value[i] = column[i] != NULL ? rx_column_value(column[i], row, 0) : NAN;
        const bool known = fabs(value[MAG]) < 90 && value[ERROR] > 0 && value[ERROR] < 90;
        v->alpha[v->n] = value[ALPHA];
        v->delta[v->n] = value[DELTA];
        v->mag[v->n] = known ? value[MAG] : NAN;
        v->error[v->n] = known ? value[ERROR] : NAN;
        v->star[v->n] = value[STAR];
        v->flags[v->n++] = isfinite(value[FLAGS]) ? (long)value[FLAGS] : 0;
    }
    return RX_OK;
}

/* What the image sees: by the weight map and its header, else the image's header. */
static rx_status see(const char *path, const char *weight, const char *cards, long ncards,
                     rx_visit_frame *frame, rx_error *err)
{
    rx_fits_cube map = {0};
    double size[2] = {0, 0};
    rx_status status = RX_OK;
    if (weight != NULL)
        RX_TRY_EXIT(rx_fits_read_cube(weight, &map, err));
    for (int i = 0; i < 2 && cards != NULL; i++)
        rx_cards_number(cards, ncards, i == 0 ? "NAXIS1" : "NAXIS2", &size[i]);
    if (weight != NULL && cards != NULL && (map.width != size[0] || map.height != size[1]))
        RX_TRY_EXIT(
            rx_error_at(err, RX_INPUT, weight, -1, 0,
                        "has %d x %d pixels, the image of %s %.0f x %.0f; give the weight map of that "
                        "image, in the order of the catalogues",
                        map.width, map.height, path, size[0], size[1]));
    frame->width = weight != NULL ? map.width : (int)fmin(size[0], 1e9);
    frame->height = weight != NULL ? map.height : (int)fmin(size[1], 1e9);
    if (weight != NULL)
        RX_TRY_EXIT(
            rx_wcs_from_cards(map.cards, (size_t)map.ncards, map.width, map.height, &frame->wcs, NULL, err));
    if (frame->wcs == NULL && cards != NULL && frame->width > 0 && frame->height > 0)
        RX_TRY_EXIT(
            rx_wcs_from_cards(cards, (size_t)ncards, frame->width, frame->height, &frame->wcs, NULL, err));
    if (weight != NULL && frame->wcs == NULL)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, weight, -1, 0,
                                "has no world coordinates, nor has the header of the image in %s; give a map "
                                "that has, or a catalogue of FITS_LDAC",
                                path));
    frame->weight = map.pixels;
    map.pixels = NULL;
exit:
    rx_fits_cube_free(&map);
    return status;
}

static int by_place(const void *a, const void *b)
{
    const double *p = a, *q = b;
    return p[0] != q[0] ? (p[0] > q[0]) - (p[0] < q[0]) : (p[1] > q[1]) - (p[1] < q[1]);
}

/* Convex hull (Andrew 1979, Inf. Process. Lett. 9, 216) of the sources from `from` on. */
static rx_status hull(const rx_visit *v, long from, long to, rx_visit_frame *frame, rx_error *err)
{
    const size_t most = (size_t)(to - from);
    double(*point)[2] = rx_alloc(most + 1, sizeof *point);
    long n = 0;
    int m = 0;
    rx_status status = point != NULL ? RX_OK : rx_error_memory(err, 0);
    if (status == RX_OK)
        status = RX_MAKE(frame->x, 2 * most + 2, err);
    if (status == RX_OK)
        status = RX_MAKE(frame->y, 2 * most + 2, err);
    if (status != RX_OK)
        goto exit;
    for (long i = from; i < to; i++)
        if (isfinite(v->x[i])) {
            point[n][0] = v->x[i];
            point[n++][1] = v->y[i];
        }
    if (n > 1)
        qsort(point, (size_t)n, sizeof *point, by_place);
    for (int side = 0; side < 2; side++) {
        const int first = m;
        for (long k = 0; k < n; k++) {
            const double *p = point[side == 0 ? k : n - 1 - k];
            while (m >= first + 2 && (frame->x[m - 1] - frame->x[m - 2]) * (p[1] - frame->y[m - 2]) <=
                                         (frame->y[m - 1] - frame->y[m - 2]) * (p[0] - frame->x[m - 2]))
                m--;
            frame->x[m] = p[0];
            frame->y[m++] = p[1];
        }
        m -= m > 0; /* the last corner begins the other side */
    }
    frame->n = m;
exit:
    free(point);
    return status;
}

rx_status rx_visit_read(const char *path, const char *weight, const rx_visit_columns *columns, rx_visit *dst,
                        rx_error *err)
{
    int n = 1;
    *dst = (rx_visit){.name = path};
    for (int i = 0; i < n; i++) {
        rx_table *table = NULL;
        char *cards = NULL;
        long ncards = 0;
        rx_status status;
        RX_TRY_EXIT(rx_catalog_read_image(path, i, &n, &cards, &ncards, err));
        if (n > 1 && weight != NULL)
            RX_TRY_EXIT(rx_error_at(err, RX_USAGE, path, -1, 0,
                                    "holds %d tables, WEIGHT_IMAGE is for catalogues of one; leave it out",
                                    n));
        RX_TRY_EXIT(rx_catalog_read(path, i, &table, err));
        RX_TRY_EXIT(RX_GROW(dst->frame, (size_t)i + 1, err));
        dst->frame[i] = (rx_visit_frame){0};
        dst->nframes = i + 1;
        dst->frame[i].first = dst->n;
        RX_TRY_EXIT(add_rows(path, table, columns, dst, err));
        dst->frame[i].last = dst->n;
        status = see(path, weight, cards, ncards, &dst->frame[i], err);
    exit:
        rx_table_free(table);
        free(cards);
        if (status != RX_OK)
            return status;
    }
    return RX_OK;
}

void rx_visit_free(rx_visit *v)
{
    for (int i = 0; i < v->nframes; i++) {
        rx_wcs_free(v->frame[i].wcs);
        free(v->frame[i].weight);
        free(v->frame[i].x);
        free(v->frame[i].y);
    }
    void *const owned[] = {v->alpha, v->delta, v->x, v->y, v->mag, v->error, v->star, v->flags, v->frame};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    *v = (rx_visit){0};
}

/* --- on the sky --- */

static void direction(double alpha, double delta, double dst[3])
{
    dst[0] = cos(DEG * delta) * cos(DEG * alpha);
    dst[1] = cos(DEG * delta) * sin(DEG * alpha);
    dst[2] = sin(DEG * delta);
}

rx_status rx_visit_project(const rx_visit *first, rx_visit *v, rx_error *err)
{
    double centre[3] = {0, 0, 0}, p[3];
    for (long i = 0; i < first->n; i++) {
        direction(first->alpha[i], first->delta[i], p);
        for (int k = 0; k < 3 && isfinite(p[0] + p[2]); k++)
            centre[k] += p[k];
    }
    const double alpha = atan2(centre[1], centre[0]), delta = atan2(centre[2], hypot(centre[0], centre[1]));
    for (long i = 0; i < v->n; i++) {
        const double a = DEG * v->alpha[i] - alpha, d = DEG * v->delta[i];
        const double z = sin(delta) * sin(d) + cos(delta) * cos(d) * cos(a);
        v->x[i] = z > 0 ? ARCSEC / DEG * cos(d) * sin(a) / z : NAN;
        v->y[i] = z > 0 ? ARCSEC / DEG * (cos(delta) * sin(d) - sin(delta) * cos(d) * cos(a)) / z : NAN;
    }
    for (int i = 0; i < v->nframes; i++)
        if (v->frame[i].wcs == NULL)
            RX_TRY(hull(v, v->frame[i].first, v->frame[i].last, &v->frame[i], err));
    return RX_OK;
}

static bool in_hull(const rx_visit_frame *f, double x, double y, double margin)
{
    bool inside = f->n > 2 && isfinite(x);
    for (int i = 0; i < f->n && inside; i++) {
        const int j = (i + 1) % f->n;
        const double ex = f->x[j] - f->x[i], ey = f->y[j] - f->y[i];
        inside = ex * (y - f->y[i]) - ey * (x - f->x[i]) >= margin * hypot(ex, ey);
    }
    return inside;
}

rx_status rx_visit_sees(const rx_visit *v, const rx_visit *of, double margin, unsigned char *dst,
                        rx_error *err)
{
    double *x = NULL, *y = NULL;
    rx_status status;
    memset(dst, 0, (size_t)of->n);
    RX_TRY_EXIT(RX_MAKE(x, (size_t)of->n + 1, err));
    RX_TRY_EXIT(RX_MAKE(y, (size_t)of->n + 1, err));
    for (int k = 0; k < v->nframes; k++) {
        const rx_visit_frame *f = &v->frame[k];
        double edge = margin;
        if (f->wcs != NULL) {
            edge /= rx_wcs_pixel_scale(f->wcs, 0.5 * f->width, 0.5 * f->height);
            rx_wcs_to_pixel(f->wcs, (int)of->n, of->alpha, of->delta, x, y);
        }
        for (long i = 0; i < of->n; i++) {
            if (f->wcs == NULL) {
                dst[i] |= in_hull(f, of->x[i], of->y[i], edge);
                continue;
            }
            const bool inside = x[i] >= edge - 0.5 && x[i] < f->width - 0.5 - edge && y[i] >= edge - 0.5 &&
                                y[i] < f->height - 0.5 - edge;
            dst[i] |= inside && (f->weight == NULL || f->weight[lround(y[i]) * f->width + lround(x[i])] > 0);
        }
    }
exit:
    free(x);
    free(y);
    return status;
}
