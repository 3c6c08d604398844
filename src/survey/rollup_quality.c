/* Outliers and trends of a survey. */
#include "survey/rollup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "num/stats.h"
#include "report/figure.h"

enum { FEW = 10, REASONS = 3, TREND_FIGURES = 8, TREND_BINS = 12, MOST_DOTS = 500 };
static const double FAR = 6.0, CLEAR = 4.0;

/* What is compared, of rollup_facts.def. */
typedef struct quantity {
    const char *name, *title, *unit;
    int image, logarithmic;
    double floor;
} quantity;

#define SHOWN(...)
#define FACT(name, digits, unit, help, heading, ...) COMPARED(name, __VA_ARGS__)
#define COMPARED(name, title, suffix, image, log, floor, ...) {name, title, suffix, image, log, floor},
static const quantity QUANTITIES[] = {
#include "survey/rollup_facts.def"
};
#undef COMPARED
enum { NQUANTITIES = sizeof QUANTITIES / sizeof *QUANTITIES };

static double error_of(const rx_estimate *e)
{
    return e->n > 0 ? 0.25 * (e->high - e->low) : 0;
}

/* What is compared of a row, side by side with those of others: most of the time goes through these. */
typedef struct rx_rollup_numbers {
    const rx_rollup_run *run;
    double card[RX_RECORD_CARDS];
    struct {
        double value, error; /* error: how far the value's own reaches */
    } of[NQUANTITIES];
} numbers;

/* Numbers of an image are of its first run, and NAN of the others. */
static void measure(const rx_rollup *all, const rx_rollup_row *r, numbers *dst)
{
    const rx_extension_facts *e = r->image;
    const rx_run_facts *f = r->facts;
#define COMPARED(name, title, suffix, image, log, floor, error, value)                                       \
    {(image) && f != e->run ? NAN : (value), error},
    *dst = (numbers){.run = r->run,
                     .of = {
#include "survey/rollup_facts.def"
                     }};
    for (int c = 0; c < all->ncards; c++) {
        dst->card[c] = NAN;
        for (int k = 0; k < e->ncards; k++)
            if (strcasecmp(e->card[k].name, all->card[c]) == 0)
                dst->card[c] = e->card[k].value;
    }
}

/* As it is compared. */
static double scaled(const numbers *row, int q)
{
    const double value = row->of[q].value;
    return QUANTITIES[q].logarithmic ? (value > 0 ? log(value) : NAN) : value;
}

/* --- outliers --- */

typedef struct level {
    double median, spread; /* spread 0: too few */
} level;

static level level_of(const rx_rollup *r, const rx_rollup_run *run, int q, double *room)
{
    size_t n = 0;
    level l = {0};
    for (int i = 0; i < r->nrows; i++) {
        const double value = r->numbers[i].run == run ? scaled(&r->numbers[i], q) : NAN;
        if (isfinite(value))
            room[n++] = value;
    }
    if (n >= FEW)
        l.spread = fmax(rx_sigma_mad(room, n, &l.median), QUANTITIES[q].floor);
    return l;
}

/* The REASONS quantities that are furthest, into `why`; returns the distance of the first, 0: none is far. */
static double add_reasons(const level *own, const rx_rollup_row *row, rx_text *why)
{
    double off[NQUANTITIES], most = 0;
    for (int q = 0; q < NQUANTITIES; q++) {
        const double value = scaled(row->numbers, q);
        off[q] = own[q].spread > 0 && isfinite(value)
                     ? fabs(value - own[q].median) / fmax(own[q].spread, row->numbers->of[q].error)
                     : 0;
    }
    for (int k = 0; k < REASONS; k++) {
        int best = 0;
        for (int q = 1; q < NQUANTITIES; q++)
            best = off[q] > off[best] ? q : best;
        if (!(off[best] > FAR))
            break;
        const quantity *q = &QUANTITIES[best];
        const double middle = q->logarithmic ? exp(own[best].median) : own[best].median;
        rx_text_printf(why, "%s%s%s%s %.4g%s (the others: %.4g +- %.2g)", why->length > 0 ? "; " : "",
                       q->image ? "" : row->run->name, q->image ? "" : " ", q->title,
                       row->numbers->of[best].value, q->unit, middle,
                       q->logarithmic ? middle * own[best].spread : own[best].spread);
        most = fmax(most, off[best]);
        off[best] = 0;
    }
    return most;
}

rx_text *rx_rollup_note(rx_text *dst, const char *before, const char *run)
{
    rx_text_printf(dst, "%s%s%s%s", dst->length > 0 ? "; " : "", before, run, run[0] != '\0' ? ": " : "");
    return dst;
}

void rx_rollup_row_notes(rx_text *dst, const rx_rollup_row *row, const char *before)
{
    const rx_run_facts *f = row->facts;
    const rx_tile_state *state = &row->image->state;
    if (f->by[0] != '\0')
        rx_text_printf(rx_rollup_note(dst, before, f->name), "done by %s, %s", f->by, f->why);
    if (f->outside[0] != '\0')
        rx_text_printf(rx_rollup_note(dst, before, f->name), "not made for this tile: %s", f->outside);
    if (rx_fluxcheck_is_off(&f->flux) && strstr(dst->data != NULL ? dst->data : "", "flux scale") == NULL)
        rx_text_printf(rx_rollup_note(dst, before, f->name),
                       "the flux scale is off: %.4f +- %.4f, FLUX_AUTO %.3f +- %.3f", f->flux.wide,
                       f->flux.wide_error, f->flux.automatic, f->flux.automatic_error);
    if (f->guard.known && rx_residual_is_large(f->guard.unexplained))
        rx_text_printf(rx_rollup_note(dst, before, f->name), "the model does not explain %.0f %% of the tile",
                       100.0 * f->guard.unexplained);
    if (f != row->image->run)
        return;
    if (state->wrong > 0)
        rx_text_printf(rx_rollup_note(dst, before, ""), "its page has %d marked Wrong", state->wrong);
}

/* Takes the text over, if there is one. */
static rx_status add_outlier(rx_rollup *r, rx_rollup_outlier outlier, rx_text *why, rx_error *err)
{
    rx_status status = why->failed ? rx_error_memory(err, 0) : RX_OK;
    if (status == RX_OK && why->length > 0)
        status = RX_GROW(r->outlier, (size_t)r->noutliers + 1, err);
    if (status == RX_OK && why->length > 0) {
        outlier.why = why->data;
        r->outlier[r->noutliers++] = outlier;
        *why = (rx_text){0};
    }
    rx_text_free(why);
    return status;
}

/* A tile that failed, or its images. levels: [nruns][NQUANTITIES]. */
static rx_status check_tile(rx_rollup *r, const rx_rollup_tile *tile, const level *levels, rx_error *err)
{
    const rx_tile_record *record = &tile->record;
    const rx_rollup_row *row = tile->row, *end = tile->row + tile->nrows;
    const int before = r->noutliers;
    rx_text why = {0};
    while (row < end) {
        const rx_extension_facts *e = row->image;
        const int gate = e->verdict == RX_VERDICT_FAIL;
        double most = 0;
        for (; row < end && row->image == e; row++) {
            most = fmax(most, add_reasons(&levels[row->run->place * NQUANTITIES], row, &why));
            rx_rollup_row_notes(&why, row, "");
        }
        if (gate)
            rx_text_add(rx_rollup_note(&why, "", ""), "a quality gate failed");
        RX_TRY(add_outlier(r,
                           (rx_rollup_outlier){.name = record->name,
                                               .image = record->image,
                                               .page = e->page,
                                               .hdu = e->hdu,
                                               .rank = gate,
                                               .off = most},
                           &why, err));
    }
    r->apart += r->noutliers > before && record->status == RX_OK;
    if (record->status == RX_OK || record->status == RX_GATE_FAIL || record->status == RX_GATE_INSUFFICIENT)
        return RX_OK;
    rx_text_printf(&why, "failed, exit status %d: %s", record->status, record->what);
    return add_outlier(
        r, (rx_rollup_outlier){.name = record->name, .image = record->image, .hdu = -1, .rank = 2}, &why,
        err);
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

static void name_cards(rx_rollup *r)
{
    for (int i = 0; i < r->ntiles; i++)
        for (int row = 0; row < r->tile[i]->nrows; row++) {
            const rx_extension_facts *e = r->tile[i]->row[row].image;
            for (int c = 0; c < e->ncards; c++) {
                int k = 0;
                while (k < r->ncards && strcasecmp(r->card[k], e->card[c].name) != 0)
                    k++;
                if (k == r->ncards && k < RX_RECORD_CARDS)
                    r->card[r->ncards++] = e->card[c].name;
            }
        }
}

rx_status rx_rollup_outliers(rx_rollup *r, rx_error *err)
{
    double *room = RX_NEW(double, (size_t)r->nrows + 1);
    level *levels = RX_NEW(level, (size_t)r->nruns * NQUANTITIES + 1);
    r->numbers = RX_TAKE(&r->arena, numbers, (size_t)r->nrows);
    rx_status status = room != NULL && levels != NULL && r->numbers != NULL ? RX_OK : rx_error_memory(err, 0);
    name_cards(r);
    for (int i = 0; i < r->nrows && status == RX_OK; i++) {
        measure(r, r->row[i], &r->numbers[i]);
        r->row[i]->numbers = &r->numbers[i];
    }
    for (int i = 0; i < r->nruns * NQUANTITIES && status == RX_OK; i++)
        levels[i] = level_of(r, r->run[i / NQUANTITIES], i % NQUANTITIES, room);
    for (int i = 0; i < r->ntiles && status == RX_OK; i++)
        status = check_tile(r, r->tile[i], levels, err);
    for (int i = 0; i < r->nmissing && status == RX_OK; i++) {
        rx_text why = {0};
        rx_text_add(&why, "no record: it was not run, or was killed");
        status = add_outlier(r,
                             (rx_rollup_outlier){.name = r->tiles->tile[r->missing[i]].name,
                                                 .image = rx_tiles_image(r->tiles, r->missing[i]),
                                                 .hdu = -1,
                                                 .rank = 2},
                             &why, err);
    }
    r->fine -= r->apart;
    if (status == RX_OK && r->noutliers > 1)
        qsort(r->outlier, (size_t)r->noutliers, sizeof *r->outlier, worse);
    free(levels);
    free(room);
    return status;
}

/* --- trends --- */

RX_COLUMNS(TRENDS, RX_TEXT("card", "of the header (RECORD_CARDS)"),
           RX_TEXT("run", "restorer; empty: of the image alone", "restorer"), RX_TEXT("quantity", NULL),
           RX_COUNT("images", "with both"), RX_NUMBER("rho", 3, "", "rank correlation (Spearman)"),
           RX_NUMBER("sigmas", 1, "", "of no correlation"));

typedef struct trend {
    int card, quantity, n;
    int order;                /* of equal ones */
    const rx_rollup_run *run; /* NULL: of the image alone */
    double rho, sigmas;
} trend;

/* A card and a quantity of one image, and their ranks from the middle. */
typedef struct point {
    double v[2], rank[2];
} point;

static int by_card(const void *a, const void *b)
{
    const double x = ((const point *)a)->v[0], y = ((const point *)b)->v[0];
    return (x > y) - (x < y);
}

static int by_quantity(const void *a, const void *b)
{
    const double x = ((const point *)a)->v[1], y = ((const point *)b)->v[1];
    return (x > y) - (x < y);
}

/* By the quantity, then by the card: in its order they are left. Equal ones share a rank. */
static double spearman(point *points, int n)
{
    double xx = 0, yy = 0, xy = 0;
    for (int side = 1; side >= 0; side--) {
        qsort(points, (size_t)n, sizeof *points, side ? by_quantity : by_card);
        for (int i = 0, end; i < n; i = end) {
            for (end = i; end < n && points[end].v[side] == points[i].v[side]; end++)
                ;
            for (int k = i; k < end; k++)
                points[k].rank[side] = 0.5 * (i + end - 1) - 0.5 * (n - 1);
        }
    }
    for (int i = 0; i < n; i++) {
        xx += points[i].rank[0] * points[i].rank[0];
        yy += points[i].rank[1] * points[i].rank[1];
        xy += points[i].rank[0] * points[i].rank[1];
    }
    return xx > 0 && yy > 0 ? xy / sqrt(xx * yy) : NAN;
}

/* The images of a trend. */
static int collect(const rx_rollup *r, const trend *t, point *dst)
{
    int n = 0;
    for (int i = 0; i < r->nrows; i++) {
        const numbers *row = &r->numbers[i];
        const double card = row->card[t->card], value = row->of[t->quantity].value;
        if ((t->run == NULL || t->run == row->run) && isfinite(value) && isfinite(card))
            dst[n++] = (point){.v = {card, value}};
    }
    return n;
}

static int stronger(const void *a, const void *b)
{
    const trend *x = a, *y = b;
    const double p = fabs(x->sigmas), q = fabs(y->sigmas);
    return p != q ? (p < q ? 1 : -1) : x->order - y->order;
}

static void draw_trend(rx_figures *dst, const rx_rollup *r, const trend *t, int number, int n,
                       const point *points, double *room)
{
    const quantity *q = &QUANTITIES[t->quantity];
    const int bins = n / FEW < TREND_BINS ? n / FEW : TREND_BINS, step = (n + MOST_DOTS - 1) / MOST_DOTS;
    const char *run = t->run != NULL ? t->run->name : "";
    char id[RX_FIGURE_ID], title[160], ylabel[80], reading[120];
    rx_curves c = {0};
    rx_curves_add(&c, RX_CURVE_DOTS, 0, "images");
    for (int i = 0; i < n; i += step)
        rx_curves_put(&c, points[i].v[0], points[i].v[1], NAN, NAN);
    rx_curves_add(&c, RX_CURVE_JOINED, 1, "median of as many");
    for (int b = 0; b < bins; b++) {
        const int from = b * n / bins, to = (b + 1) * n / bins;
        for (int i = from; i < to; i++)
            room[i - from] = points[i].v[1];
        rx_curves_put(&c, points[(from + to - 1) / 2].v[0], rx_quantile(room, (size_t)(to - from), 0.5), NAN,
                      NAN);
    }
    for (int i = 0; i < n; i++)
        room[i] = points[i].v[1];
    const double low = rx_quantile(room, (size_t)(n), 0.005), high = rx_quantile(room, (size_t)(n), 0.995);
    snprintf(id, sizeof id, "trend-%02d", number);
    snprintf(title, sizeof title, "%s%s%s against %s", run, run[0] != '\0' ? " " : "", q->title,
             r->card[t->card]);
    snprintf(ylabel, sizeof ylabel, q->unit[0] != '\0' ? "%s [%s]" : "%s", q->title,
             q->unit[0] != '\0' ? q->unit + 1 : "");
    snprintf(reading, sizeof reading, "Rank correlation %.2f, %.1f sigma, %d images%s.", t->rho, t->sigmas, n,
             step > 1 ? ", some of which are drawn" : "");
    rx_curves_figure(dst, id, title, reading,
                     &(rx_axes){.xlabel = r->card[t->card],
                                .ylabel = ylabel,
                                .x0 = points[0].v[0],
                                .x1 = points[n - 1].v[0],
                                .y0 = low - 0.2 * (high - low),
                                .y1 = high + 0.2 * (high - low)},
                     &c);
}

rx_status rx_rollup_trends(const rx_rollup *r, rx_report *report, rx_report_table **dst, rx_error *err)
{
    const int all = r->ncards * NQUANTITIES * r->nruns;
    point *points = RX_NEW(point, (size_t)r->nrows + 1);
    double *room = RX_NEW(double, (size_t)r->nrows + 1);
    trend *trends = RX_NEW(trend, (size_t)all + 1);
    rx_report_table *t = *dst = RX_REPORT_TABLE(report, "trends", TRENDS, RX_REPORT_EVERYWHERE);
    const rx_status status =
        points != NULL && room != NULL && trends != NULL ? RX_OK : rx_error_memory(err, 0);
    int n = 0;
    for (int i = 0; i < all && status == RX_OK; i++) {
        const int q = i / r->nruns % NQUANTITIES, run = i % r->nruns, image = QUANTITIES[q].image;
        trend one = {
            .card = i / r->nruns / NQUANTITIES, .order = i, .quantity = q, .run = image ? NULL : r->run[run]};
        if (image && run > 0)
            continue;
        one.n = collect(r, &one, points);
        one.rho = one.n >= FEW ? spearman(points, one.n) : NAN;
        /* Fieller, Hartley and Pearson 1957, Biometrika 44, 470 */
        one.sigmas = atanh(fmax(fmin(one.rho, 0.999999), -0.999999)) * sqrt((one.n - 3) / 1.06);
        if (isfinite(one.rho))
            trends[n++] = one;
    }
    if (n > 1)
        qsort(trends, (size_t)n, sizeof *trends, stronger);
    for (int i = 0; i < n; i++) {
        const trend *one = &trends[i];
        rx_report_put(t, r->card[one->card], one->run != NULL ? one->run->name : "",
                      QUANTITIES[one->quantity].name, one->n, one->rho, one->sigmas);
        if (i < TREND_FIGURES && fabs(one->sigmas) > CLEAR) {
            const int m = collect(r, one, points);
            qsort(points, (size_t)m, sizeof *points, by_card);
            draw_trend(rx_report_figures_of(report), r, one, i, m, points, room);
        }
    }
    free(trends);
    free(points);
    free(room);
    return status;
}
