/* Outliers and trends of a survey. */
#include "survey/rollup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/stats.h"
#include "report/figure.h"

enum { FEW = 10, WHYS = 3, TREND_FIGURES = 8, TREND_BINS = 12, MOST_DOTS = 500 };
static const double FAR = 6.0, CLEAR = 4.0;

/* What is compared, of rollup_facts.def. */
typedef struct quantity {
    const char *name, *title, *unit;
    int image, logarithmic;
    double floor;
    double (*value)(const rx_rollup_row *row), (*error)(const rx_rollup_row *row);
} quantity;

static double error_of(const rx_estimate *e)
{
    return e->n > 0 ? 0.25 * (e->high - e->low) : 0;
}

#define SHOWN(...)
#define FACT(function, name, digits, unit, help, heading, ...) COMPARED(function, name, __VA_ARGS__)
#define COMPARED(function, name, title, suffix, image, log, floor, error, value)                             \
    static double function(const rx_rollup_row *r)                                                           \
    {                                                                                                        \
        return value;                                                                                        \
    }                                                                                                        \
    static double function##_error(const rx_rollup_row *r)                                                   \
    {                                                                                                        \
        (void)r;                                                                                             \
        return error;                                                                                        \
    }
#include "survey/rollup_facts.def"
#undef COMPARED
#define COMPARED(function, name, title, suffix, image, log, floor, error, value)                             \
    {name, title, suffix, image, log, floor, function, function##_error},
static const quantity QUANTITIES[] = {
#include "survey/rollup_facts.def"
};
enum { NQUANTITIES = sizeof QUANTITIES / sizeof *QUANTITIES };

/* As it is compared; NAN: not known, or not of this row. */
static double scaled(const quantity *q, const rx_rollup_row *row)
{
    const double value = q->image && !row->leads ? NAN : q->value(row);
    return q->logarithmic ? (value > 0 ? log(value) : NAN) : value;
}

/* --- outliers --- */

typedef struct level {
    double median, spread; /* spread 0: too few */
} level;

static level level_of(const rx_rollup *r, int run, const quantity *q, double *room)
{
    size_t n = 0;
    level l = {0};
    for (int i = 0; i < r->nrows; i++) {
        const double value = r->row[i].run == run ? scaled(q, &r->row[i]) : NAN;
        if (isfinite(value))
            room[n++] = value;
    }
    if (n >= FEW)
        l.spread = fmax(rx_sigma_mad(room, n, &l.median), q->floor);
    return l;
}

static double distance(const quantity *q, const level *l, const rx_rollup_row *row)
{
    const double value = scaled(q, row);
    return l->spread > 0 && isfinite(value) ? fabs(value - l->median) / fmax(l->spread, q->error(row)) : 0;
}

static void say(rx_text *why, const quantity *q, const level *l, const rx_rollup_row *row, const char *run)
{
    const double middle = q->logarithmic ? exp(l->median) : l->median;
    rx_text_printf(why, "%s%s%s%s %.4g%s (the others: %.4g +- %.2g)", why->length > 0 ? "; " : "",
                   q->image ? "" : run, q->image ? "" : " ", q->title, q->value(row), q->unit, middle,
                   q->logarithmic ? middle * l->spread : l->spread);
}

static rx_status keep(rx_rollup *r, rx_rollup_outlier outlier, rx_text *why, rx_error *err)
{
    rx_rollup_outlier *grown = rx_regrow(r->outlier, (size_t)r->noutliers + 1, sizeof *grown);
    if (grown != NULL)
        r->outlier = grown;
    if (grown == NULL || why->failed || why->data == NULL) {
        rx_text_free(why);
        return rx_error_memory(err, 0);
    }
    outlier.why = why->data;
    *why = (rx_text){0};
    r->outlier[r->noutliers++] = outlier;
    return RX_OK;
}

/* The WHYS quantities that are furthest, into `why`; returns the distance of the first, 0: none is far. */
static double reasons(const rx_rollup *r, const level *levels, const rx_rollup_row *row, rx_text *why)
{
    int said[NQUANTITIES] = {0};
    double most = 0;
    const level *own = &levels[row->run * NQUANTITIES];
    for (int k = 0; k < WHYS; k++) {
        int best = -1;
        double at = FAR;
        for (int i = 0; i < NQUANTITIES; i++) {
            const double off = said[i] ? 0 : distance(&QUANTITIES[i], &own[i], row);
            if (off > at) {
                at = off;
                best = i;
            }
        }
        if (best < 0)
            break;
        said[best] = 1;
        most = fmax(most, at);
        say(why, &QUANTITIES[best], &own[best], row, r->run[row->run].name);
    }
    return most;
}

/* Rows of one tile and HDU together: by tile, HDU, and the place among them. */
static int by_image(const void *a, const void *b)
{
    const rx_rollup_row *x = *(const rx_rollup_row *const *)a, *y = *(const rx_rollup_row *const *)b;
    return x->tile != y->tile ? x->tile->place - y->tile->place : x->place - y->place;
}

rx_text *rx_rollup_note(rx_text *dst, const char *before, const char *run)
{
    rx_text_printf(dst, "%s%s%s%s", dst->length > 0 ? "; " : "", before, run, run[0] != '\0' ? ": " : "");
    return dst;
}

void rx_rollup_row_notes(rx_text *dst, const rx_rollup_row *row, const char *before, const char *run)
{
    if (row->by[0] != '\0')
        rx_text_printf(rx_rollup_note(dst, before, run), "done by %s, %s", row->by, row->why);
    if (row->outside != NULL)
        rx_text_printf(rx_rollup_note(dst, before, run), "not made for this tile: %s", row->outside);
    if (rx_fluxcheck_is_off(&row->flux) && strstr(dst->data != NULL ? dst->data : "", "flux scale") == NULL)
        rx_text_printf(rx_rollup_note(dst, before, run),
                       "the flux scale is off: %.4f +- %.4f, FLUX_AUTO %.3f +- %.3f", row->flux.wide,
                       row->flux.wide_error, row->flux.automatic, row->flux.automatic_error);
    if (row->guard.known && rx_residual_is_large(row->guard.unexplained))
        rx_text_printf(rx_rollup_note(dst, before, run),
                       "%.0f %% of the tile are not explained by the restored image",
                       100.0 * row->guard.unexplained);
    if (rx_result_is_sharp(row->sharp, row->sources))
        rx_text_printf(rx_rollup_note(dst, before, run), "%.0f %% of the sources are sharper than the PSF",
                       100.0 * row->sharp);
    const rx_anomalies anomalies = {
        .rows = row->state.rows, .columns = row->state.columns, .light = row->state.light};
    if (row->leads && rx_anomalies_is_striped(&anomalies))
        rx_text_printf(rx_rollup_note(dst, before, ""),
                       "rows are offset by %.2g sigma of a pixel, columns by %.2g", anomalies.rows,
                       anomalies.columns);
    if (row->leads && rx_anomalies_is_lit(&anomalies))
        rx_text_printf(rx_rollup_note(dst, before, ""), "%.0f %% of the tile hold light of no source",
                       100.0 * anomalies.light);
    if (row->leads && row->state.wrong > 0)
        rx_text_printf(rx_rollup_note(dst, before, ""), "its page has %d marked Wrong", row->state.wrong);
}

static rx_status find_far(rx_rollup *r, const level *levels, const rx_rollup_row **order, rx_error *err)
{
    const rx_rollup_tile *last = NULL;
    rx_status status = RX_OK;
    for (int i = 0; i < r->nrows; i++)
        order[i] = &r->row[i];
    if (r->nrows > 1)
        qsort(order, (size_t)r->nrows, sizeof *order, by_image);
    for (int i = 0, end; i < r->nrows && status == RX_OK; i = end) {
        const rx_rollup_row *first = order[i];
        rx_text why = {0};
        double most = 0;
        for (end = i; end < r->nrows && order[end]->tile == first->tile && order[end]->hdu == first->hdu;
             end++) {
            const rx_rollup_row *row = order[end];
            most = fmax(most, reasons(r, levels, row, &why));
            rx_rollup_row_notes(&why, row, "", r->run[row->run].name);
        }
        const int gate = first->verdict == RX_VERDICT_FAIL;
        if (gate)
            rx_text_add(rx_rollup_note(&why, "", ""), "a quality gate failed");
        if (why.length > 0 && first->tile != last && first->tile->status == RX_OK)
            r->apart++;
        last = why.length > 0 ? first->tile : last;
        if (why.length > 0)
            status = keep(r,
                          (rx_rollup_outlier){.row = first,
                                              .name = first->tile->name,
                                              .image = first->tile->image,
                                              .page = first->page,
                                              .hdu = first->hdu,
                                              .rank = gate,
                                              .off = most},
                          &why, err);
        rx_text_free(&why);
    }
    return status;
}

/* Tiles without an image, and those that no record is of. */
static rx_status find_failed(rx_rollup *r, rx_error *err)
{
    rx_status status = RX_OK;
    rx_text why = {0};
    for (int i = 0; i < r->ntiles && status == RX_OK; i++) {
        const rx_rollup_tile *tile = r->tile[i];
        if (tile->status == RX_OK || tile->status == RX_GATE_FAIL || tile->status == RX_GATE_INSUFFICIENT)
            continue;
        rx_text_printf(&why, "failed, exit status %d: %s", tile->status, tile->what);
        status = keep(r, (rx_rollup_outlier){.name = tile->name, .image = tile->image, .rank = 2}, &why, err);
    }
    for (int i = 0; i < r->nmissing && status == RX_OK; i++) {
        rx_text_add(&why, "no record: it was not run, or was killed");
        status = keep(r,
                      (rx_rollup_outlier){.name = r->tiles->tile[r->missing[i]].name,
                                          .image = rx_tiles_image(r->tiles, r->missing[i]),
                                          .rank = 2},
                      &why, err);
    }
    return status;
}

static int worse(const void *a, const void *b)
{
    const rx_rollup_outlier *x = a, *y = b;
    if (x->rank != y->rank)
        return y->rank - x->rank;
    if (x->off != y->off)
        return x->off < y->off ? 1 : -1;
    const int order = strcmp(x->name, y->name);
    return order != 0 ? order : x->hdu - y->hdu;
}

rx_status rx_rollup_outliers_find(rx_rollup *r, rx_error *err)
{
    double *room = RX_NEW(double, (size_t)r->nrows + 1);
    level *levels = RX_NEW(level, (size_t)r->nruns * NQUANTITIES + 1);
    const rx_rollup_row **order = rx_alloc((size_t)r->nrows + 1, sizeof *order);
    rx_status status = room != NULL && levels != NULL && order != NULL ? RX_OK : rx_error_memory(err, 0);
    for (int run = 0; run < r->nruns && status == RX_OK; run++)
        for (int i = 0; i < NQUANTITIES; i++)
            levels[run * NQUANTITIES + i] = level_of(r, run, &QUANTITIES[i], room);
    if (status == RX_OK)
        status = find_failed(r, err);
    if (status == RX_OK)
        status = find_far(r, levels, order, err);
    r->fine -= r->apart;
    if (status == RX_OK && r->noutliers > 1)
        qsort(r->outlier, (size_t)r->noutliers, sizeof *r->outlier, worse);
    free(order);
    free(levels);
    free(room);
    return status;
}

/* --- trends --- */

RX_COLUMNS(TRENDS, RX_TEXT("card", "of the header (RECORD_CARDS)"),
           {.name = "run", .help = "restorer; empty: of the image alone", .heading = "restorer"},
           RX_TEXT("quantity", NULL), RX_COUNT("images", "with both"),
           RX_NUMBER("rho", 3, "", "rank correlation (Spearman)"),
           RX_NUMBER("sigmas", 1, "", "of no correlation"));

typedef struct point {
    double x, y, rank[2];
} point;

static int by_x(const void *a, const void *b)
{
    const double x = ((const point *)a)->x, y = ((const point *)b)->x;
    return (x > y) - (x < y);
}

static int by_y(const void *a, const void *b)
{
    const double x = ((const point *)a)->y, y = ((const point *)b)->y;
    return (x > y) - (x < y);
}

/* Ranks of one side, equal ones shared; the points are left in its order. */
static void rank(point *points, int n, int side)
{
    qsort(points, (size_t)n, sizeof *points, side ? by_y : by_x);
    for (int i = 0, end; i < n; i = end) {
        for (end = i; end < n && (side ? points[end].y == points[i].y : points[end].x == points[i].x); end++)
            ;
        for (int k = i; k < end; k++)
            points[k].rank[side] = 0.5 * (i + end - 1) - 0.5 * (n - 1);
    }
}

/* Left in the order of x. */
static double spearman(point *points, int n)
{
    double xx = 0, yy = 0, xy = 0;
    rank(points, n, 1);
    rank(points, n, 0);
    for (int i = 0; i < n; i++) {
        xx += points[i].rank[0] * points[i].rank[0];
        yy += points[i].rank[1] * points[i].rank[1];
        xy += points[i].rank[0] * points[i].rank[1];
    }
    return xx > 0 && yy > 0 ? xy / sqrt(xx * yy) : NAN;
}

typedef struct trend {
    int card, run, quantity, n;
    double rho, sigmas;
} trend;

static int collect(const rx_rollup *r, int run, const quantity *q, int card, point *dst)
{
    int n = 0;
    for (int i = 0; i < r->nrows; i++) {
        const rx_rollup_row *row = &r->row[i];
        const double value = q->image && !row->leads ? NAN : q->value(row);
        if ((q->image || row->run == run) && isfinite(value) && isfinite(row->card[card]))
            dst[n++] = (point){.x = row->card[card], .y = value};
    }
    return n;
}

static int stronger(const void *a, const void *b)
{
    const trend *x = a, *y = b;
    const double p = fabs(x->sigmas), q = fabs(y->sigmas);
    if (p != q)
        return p < q ? 1 : -1;
    return x->card != y->card           ? x->card - y->card
           : x->quantity != y->quantity ? x->quantity - y->quantity
                                        : x->run - y->run;
}

static void draw_trend(rx_figures *dst, const rx_rollup *r, const trend *t, int number, point *points)
{
    const quantity *q = &QUANTITIES[t->quantity];
    const int n = collect(r, t->run, q, t->card, points), bins = n / FEW < TREND_BINS ? n / FEW : TREND_BINS;
    double *room = RX_NEW(double, (size_t)n + 1), low, high;
    char id[RX_FIGURE_ID], title[160], xlabel[RX_CARD_NAME], ylabel[80];
    rx_curves c = {0};
    if (room == NULL) {
        dst->script.failed = true;
        return;
    }
    qsort(points, (size_t)n, sizeof *points, by_x);
    for (int i = 0; i < n; i++)
        room[i] = points[i].y;
    low = rx_quantile(room, (size_t)n, 0.005);
    high = rx_quantile(room, (size_t)n, 0.995);
    rx_curves_add(&c, RX_CURVE_DOTS, 0, "images");
    const int step = (n + MOST_DOTS - 1) / MOST_DOTS;
    for (int i = 0; i < n; i += step)
        rx_curves_put(&c, points[i].x, points[i].y, NAN, NAN);
    rx_curves_add(&c, RX_CURVE_JOINED, 1, "median of as many");
    for (int b = 0; b < bins; b++) {
        const int from = b * n / bins, to = (b + 1) * n / bins;
        for (int i = from; i < to; i++)
            room[i - from] = points[i].y;
        rx_curves_put(&c, points[(from + to - 1) / 2].x, rx_quantile(room, (size_t)(to - from), 0.5), NAN,
                      NAN);
    }
    snprintf(id, sizeof id, "trend-%02d", number);
    snprintf(title, sizeof title, "%s%s%s against %s", q->image ? "" : r->run[t->run].name,
             q->image ? "" : " ", q->title, r->card[t->card]);
    snprintf(xlabel, sizeof xlabel, "%s", r->card[t->card]);
    snprintf(ylabel, sizeof ylabel, "%s%s%s%s", q->title, q->unit[0] != '\0' ? " [" : "",
             q->unit[0] != '\0' ? q->unit + 1 : "", q->unit[0] != '\0' ? "]" : "");
    char reading[120];
    snprintf(reading, sizeof reading, "Rank correlation %.2f, %.1f sigma, %d images%s.", t->rho, t->sigmas,
             t->n, step > 1 ? ", some of which are drawn" : "");
    rx_curves_figure(dst, id, title, reading,
                     &(rx_axes){.xlabel = xlabel,
                                .ylabel = ylabel,
                                .x0 = points[0].x,
                                .x1 = points[n - 1].x,
                                .y0 = low - 0.2 * (high - low),
                                .y1 = high + 0.2 * (high - low)},
                     &c);
    free(room);
}

rx_status rx_rollup_trends(const rx_rollup *r, rx_report *report, rx_report_table **dst, rx_error *err)
{
    point *points = RX_NEW(point, (size_t)r->nrows + 1);
    trend *trends = RX_NEW(trend, (size_t)r->ncards * NQUANTITIES * (size_t)r->nruns + 1);
    rx_report_table *t = *dst = RX_REPORT_TABLE(report, "trends", TRENDS, RX_REPORT_EVERYWHERE);
    int n = 0;
    if (points == NULL || trends == NULL) {
        free(points);
        free(trends);
        return rx_error_memory(err, 0);
    }
    for (int card = 0; card < r->ncards; card++)
        for (int k = 0; k < NQUANTITIES; k++)
            for (int run = 0; run < (QUANTITIES[k].image && r->nruns > 0 ? 1 : r->nruns); run++) {
                const int m = collect(r, run, &QUANTITIES[k], card, points);
                const double rho = m >= FEW ? spearman(points, m) : NAN;
                if (isfinite(rho)) /* Fieller, Hartley and Pearson 1957, Biometrika 44, 470 */
                    trends[n++] = (trend){
                        card, run, k,
                        m,    rho, atanh(fmax(fmin(rho, 0.999999), -0.999999)) * sqrt((m - 3) / 1.06)};
            }
    if (n > 1)
        qsort(trends, (size_t)n, sizeof *trends, stronger);
    for (int i = 0; i < n; i++) {
        const quantity *q = &QUANTITIES[trends[i].quantity];
        rx_report_put(t, r->card[trends[i].card], q->image ? "" : (const char *)r->run[trends[i].run].name,
                      q->name, trends[i].n, trends[i].rho, trends[i].sigmas);
        if (i < TREND_FIGURES && fabs(trends[i].sigmas) > CLEAR)
            draw_trend(rx_report_figures_of(report), r, &trends[i], i, points);
    }
    free(trends);
    free(points);
    return RX_OK;
}
