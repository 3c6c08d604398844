/* The report of a photometry campaign. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "lab/photometry.h"
#include "lab/report.h"
#include "quality/completeness.h"
#include "quality/evaluate.h"
#include "quality/hypothesis.h"
#include "report/curves.h"

static const double LEVEL = 0.95;

/* --- quantities --- */

typedef enum statistic {
    RECALL,    /* stars found at the cut: number of the precision, or */
    PRECISION, /* of the whole list */
    AP,
    CROWDED,
    MEAN, /* of a value of the stars found */
    MEDIAN,
    WIDTH /* sigma_MAD */
} statistic;
enum { WHOLE = -1, DRAWN = 3 };

typedef enum star_value { ERROR_PERCENT, ERROR_CLEAN, SIGNED_PERCENT, SIGNED_MAG, PULL } star_value;

/* The first of these are drawn; behind them those at equal precision, and both lie open. */
static const rx_quantity QUANTITIES[] = {
    {"magerr", "%", 2, MEAN, ERROR_PERCENT, WHOLE, 0, 0, 0,
     "mean of 100 |F - F0| / F0 over the stars found (the paper's MagErr)"},
    {"recall", "", 3, RECALL, 0, WHOLE, 0, 0, 0, "share of the stars found, whole list"},
    {"precision", "", 3, PRECISION, 0, WHOLE, 0, 0, 0,
     "stars found / (stars found + false detections on the same tiles)"},
    {"ap", "", 3, AP, 0, WHOLE, 0, 0, 0,
     "average precision: area under the steps of the precision-recall curve"},
    {"magerr_clean", "%", 2, MEAN, ERROR_CLEAN, WHOLE, 0, 0, 0, "magerr without stars flagged as blended"},
    {"blended", "", 3, CROWDED, 0, WHOLE, 0, 0, 0,
     "share of the stars found that FLAGS calls blended or crowded"},
    {"bias_percent", "%", 2, MEDIAN, SIGNED_PERCENT, WHOLE, 0, 0, 0, "median of 100 (F - F0) / F0"},
    {"scatter_percent", "%", 2, WIDTH, SIGNED_PERCENT, WHOLE, 0, 0, 0, "sigma_MAD of 100 (F - F0) / F0"},
    {"bias_mag", "mag", 3, MEDIAN, SIGNED_MAG, WHOLE, 0, 0, 0, "median of m - m0"},
    {"scatter_mag", "mag", 3, WIDTH, SIGNED_MAG, WHOLE, 0, 0, 0, "sigma_MAD of m - m0"},
    {"pull_median", "", 2, MEDIAN, PULL, WHOLE, 0, 0, 0, "median of (F - F0) / error, 0 when unbiased"},
    {"pull_width", "", 2, WIDTH, PULL, WHOLE, 0, 0, 0,
     "sigma_MAD of (F - F0) / error, 1 when errors are true"},
};

void rx_photometry_name_set(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96])
{
    snprintf(names[0], sizeof *names, "%s", lab->sky[unit->condition].name);
    snprintf(names[1], sizeof *names, "%g", lab->scene[unit->scene].mag);
}

static const rx_lab_table *stars_of(const rx_lab *lab, int field, int k)
{
    return &rx_lab_set_of(lab, field, k)->table[RX_PHOTOMETRY_STAR];
}

/* Of a star in a matched filter on this field, background-limited. */
static double snr_of(const rx_lab *lab, int field, int k)
{
    const rx_lab_table *tile = &rx_lab_set_of(lab, field, k)->table[RX_PHOTOMETRY_TILE];
    return rx_lab_sum(tile, RX_FIELD_SNR) / (double)tile->n;
}

static double mpixels_of(const rx_lab *lab, int field, int k)
{
    return rx_lab_sum(&rx_lab_set_of(lab, field, k)->table[RX_PHOTOMETRY_TILE], RX_FIELD_MPIXELS);
}

static double value_of(const double *star, star_value kind)
{
    const double off = star[RX_STAR_RATIO] - 1;
    switch (kind) {
    case ERROR_PERCENT:
        return 100 * fabs(off);
    case ERROR_CLEAN:
        return star[RX_STAR_CROWDED] > 0 ? NAN : 100 * fabs(off);
    case SIGNED_PERCENT:
        return 100 * off;
    case SIGNED_MAG:
        return star[RX_STAR_RATIO] > 0 ? -2.5 * log10(star[RX_STAR_RATIO]) : NAN;
    case PULL:
        return star[RX_STAR_PULL];
    }
    return NAN;
}

/* Of the values of the stars found; work [stars]. */
static rx_estimate measure_values(const rx_lab_table *star, int run, const rx_quantity *q, double *work)
{
    rx_estimate median, width;
    long n = 0;
    for (long i = 0; i < star->n; i++) {
        const double *v = rx_lab_each(star, i, run);
        work[n] = isnan(v[RX_STAR_SCORE]) ? NAN : value_of(v, (star_value)q->part);
        n += isfinite(work[n]) != 0;
    }
    if (q->statistic == MEAN)
        return rx_mean_estimate(n, work, LEVEL);
    rx_robust_estimates(work, n, LEVEL, &median, &width);
    return q->statistic == MEDIAN ? median : width;
}

/* --- thresholds of a field --- */

/* A threshold of a run on a field, all magnitudes together: precision number 0.., or -1: the whole list. */
typedef struct cut {
    double score;   /* +infinity: the precision is never reached */
    int whole_list; /* the list ends before precision falls so low: completeness is a lower limit */
    rx_estimate precision, recall;
    rx_estimate mag50, mag90;     /* magnitudes of 50 and 90 % completeness */
    rx_estimate false_per_mpixel; /* of the whole list; n: false detections */
} cut;

typedef struct field {
    const rx_lab *lab;
    int number;
    uint64_t seed;
    rx_lab_group group; /* its conditions: the magnitudes */
    cut *cuts;          /* [nruns][nprecisions + 1]; owned */
    double *work;       /* [stars of all magnitudes]; owned */
} field;

static cut *cut_of(const field *f, int run, int precision)
{
    return &f->cuts[run * (f->lab->nprecisions + 1) + precision + 1];
}

/* Magnitudes of 50 and 90 % completeness for stars found at the cut. The bin goes from half a step above the brightest
 * set to half a step below the faintest, completeness only asks for its range; sets go from bright to faint in equal
 * steps. */
static rx_status depth(const field *f, int run, cut *dst, rx_error *err)
{
    const rx_lab *lab = f->lab;
    const rx_resampling by = {.seed = f->seed, .nthreads = 1};
    const int last = lab->nscenes - 1;
    const double step = last > 0 ? lab->scene[1].mag - lab->scene[0].mag : 1;
    const rx_bins bins = {.n = 1,
                          .edge = {lab->scene[0].mag - 0.5 * step, lab->scene[0].mag + (last + 0.5) * step}};
    long n = 0, all = 1;
    for (int k = 0; k <= last; k++)
        all += stars_of(lab, f->number, k)->n;
    unsigned char *found = NULL;
    RX_TRY(RX_MAKE(found, (size_t)all, err));
    for (int k = 0; k <= last; k++)
        for (long i = 0; i < stars_of(lab, f->number, k)->n; i++) {
            found[n] = rx_lab_each(stars_of(lab, f->number, k), i, run)[RX_STAR_SCORE] >= dst->score;
            f->work[n++] = lab->scene[k].mag;
        }
    rx_status status =
        rx_completeness(&bins, &(rx_found){n, f->work, found}, 0.5, LEVEL, by, &dst->mag50, err);
    if (status == RX_OK)
        status = rx_completeness(&bins, &(rx_found){n, f->work, found}, 0.9, LEVEL, by, &dst->mag90, err);
    free(found);
    return status;
}

/* The whole list, and the lowest score at which precision is at least each of those named. */
static rx_status choose_cuts(const field *f, int run, rx_error *err)
{
    const rx_lab *lab = f->lab;
    const rx_list list = rx_list_of_all(lab, f->number);
    const rx_estimate none = {NAN, NAN, NAN, 0};
    long stars = 0, found = 0, wrong = 0;
    double mpixels = 0;
    rx_pr pr = {0};
    rx_status status = rx_list_curve(&list, run, &stars, &pr, err);
    for (int k = 0; k < lab->nscenes; k++) {
        const rx_list one = rx_list_of(lab, f->number, k);
        found += rx_list_found(&one, run, -INFINITY);
        wrong += rx_list_wrong(&one, run, -INFINITY, -1, 0, 0);
        mpixels += mpixels_of(lab, f->number, k);
    }
    for (int p = -1; p < lab->nprecisions && status == RX_OK; p++) {
        cut *dst = cut_of(f, run, p);
        const rx_pr_point *point = p < 0 ? NULL : rx_pr_cut(&pr, lab->precision[p]);
        *dst = (cut){.score = INFINITY, .precision = none, .false_per_mpixel = none};
        dst->recall = rx_binomial_interval(point != NULL ? point->matched : p < 0 ? found : 0, stars, LEVEL);
        if (p < 0) {
            dst->score = -INFINITY;
            dst->whole_list = 1;
            dst->precision = rx_binomial_interval(found, found + wrong, LEVEL);
            dst->false_per_mpixel = rx_poisson_rate(wrong, mpixels, LEVEL);
        } else if (point != NULL) {
            dst->score = point->score;
            dst->whole_list = point == &pr.point[pr.n - 1];
            dst->precision = rx_binomial_interval(point->matched, point->detections, LEVEL);
        }
        status = depth(f, run, dst, err);
    }
    rx_pr_free(&pr);
    return status;
}

static rx_status measure_set(const field *f, int k, int run, rx_error *err)
{
    const rx_lab_table *star = stars_of(f->lab, f->number, k);
    const rx_list list = rx_list_of(f->lab, f->number, k);
    const long found = rx_list_found(&list, run, -INFINITY),
               wrong = rx_list_wrong(&list, run, -INFINITY, -1, 0, 0);
    long objects, crowded = 0;
    rx_pr pr = {0};
    RX_TRY(rx_interrupt_check(err));
    rx_status status = rx_list_curve(&list, run, &objects, &pr, err);
    for (long i = 0; i < star->n; i++)
        crowded += !isnan(rx_lab_each(star, i, run)[RX_STAR_SCORE]) &&
                   rx_lab_each(star, i, run)[RX_STAR_CROWDED] > 0;
    for (int i = 0; i < f->group.nquantities && status == RX_OK; i++) {
        const rx_quantity *q = &f->group.quantity[i];
        rx_estimate *dst = &rx_lab_group_at(&f->group, i, k, run)->value;
        switch ((statistic)q->statistic) {
        case RECALL:
            *dst = rx_list_share(&list, run, cut_of(f, run, q->cut)->score, -1, 0, 0);
            break;
        case PRECISION:
            *dst = rx_binomial_interval(found, found + wrong, LEVEL);
            break;
        case AP:
            status = rx_pr_interval(&pr, star->n, LEVEL, (rx_resampling){.seed = f->seed, .nthreads = 1}, dst,
                                    err);
            break;
        case CROWDED:
            *dst = rx_binomial_interval(crowded, found, LEVEL);
            break;
        case MEAN:
        case MEDIAN:
        case WIDTH:
            *dst = measure_values(star, run, q, f->work);
        }
    }
    rx_pr_free(&pr);
    return status;
}

static rx_status measure_field(field *f, rx_error *err)
{
    const rx_lab *lab = f->lab;
    rx_lab_group *g = &f->group;
    size_t stars = 1;
    *g = (rx_lab_group){.name = lab->sky[f->number].name, .axis = "magnitude", .nquantities = DRAWN};
    memcpy(g->quantity, QUANTITIES, DRAWN * sizeof *QUANTITIES);
    for (int p = 0; p < lab->nprecisions; p++) {
        rx_quantity *q = &g->quantity[g->nquantities++];
        *q = (rx_quantity){"", "", 3, RECALL, 0, p, 0, 0, 0, ""};
        snprintf(q->name, sizeof q->name, "recall_p%g", lab->precision[p]);
        snprintf(q->help, sizeof q->help, "share of the stars found at precision %g", lab->precision[p]);
    }
    memcpy(&g->quantity[g->nquantities], QUANTITIES + DRAWN, sizeof QUANTITIES - DRAWN * sizeof *QUANTITIES);
    g->nquantities += (int)(sizeof QUANTITIES / sizeof *QUANTITIES) - DRAWN;
    RX_TRY(rx_lab_group_open(g, lab, lab->nscenes, err));
    for (int k = 0; k < lab->nscenes; k++) {
        snprintf(g->condition[k], sizeof *g->condition, "%g", g->place[k] = lab->scene[k].mag);
        stars += (size_t)stars_of(lab, f->number, k)->n;
    }
    RX_TRY(RX_MAKE(f->cuts, (size_t)lab->nruns * ((size_t)lab->nprecisions + 1), err));
    RX_TRY(RX_MAKE(f->work, stars, err));
    for (int run = 0; run < lab->nruns; run++)
        RX_TRY(choose_cuts(f, run, err));
    for (int i = 0; i < lab->nscenes * lab->nruns; i++)
        RX_TRY(measure_set(f, i / lab->nruns, i % lab->nruns, err));
    return RX_OK;
}

/* --- figures --- */

/* Figures of the first fields only: the page of a long list of conditions stays readable. */
enum { CURVES = 6, POINTS_MAX = 200, FIELDS_WITH_CURVES = 2, FIGURE_FIELDS = 12 };
static const double NEARLY_ALL = 0.95;

/* As the paper's figure six magnitudes, around those where stars begin to be lost: is this one among them. */
static int has_curve(const field *f, int k)
{
    const int n = f->lab->nscenes;
    int lost = 0, below = 0;
    for (; lost < n && !below; lost++)
        for (int run = 0; run < f->lab->nruns; run++)
            below |= rx_lab_group_at(&f->group, 1, lost, run)->value.value < NEARLY_ALL;
    const int wanted = lost - below - 2, last = n > CURVES ? n - CURVES : 0,
              first = wanted < 0      ? 0
                      : wanted > last ? last
                                      : wanted;
    return f->number < FIELDS_WITH_CURVES && k >= first && k < first + CURVES;
}

RX_COLUMNS(PR, RX_TEXT("scene", "field"), RX_TEXT("condition", "magnitude of the stars"),
           RX_TEXT("run", "restorer"), RX_NUMBER("score", 2, "", "S/N of the detection"),
           RX_NUMBER("recall", 4, "", "of the stars with this score or a higher one"),
           RX_NUMBER("precision", 4, "", "the same"));

/* Precision over recall of one magnitude, thinned: first, last and POINTS_MAX between. */
static rx_status add_curves(rx_report *report, const field *f, int k, rx_report_table *t, rx_error *err)
{
    static const rx_axes axes = {"recall", "precision", 0, 1.02, 0, 1.02, false, false};
    const rx_list list = rx_list_of(f->lab, f->number, k);
    rx_status status = RX_OK;
    rx_curves c = {0};
    char id[RX_FIGURE_ID], title[96];
    for (int run = 0; run < f->lab->nruns && status == RX_OK; run++) {
        const char *name = f->group.column[run];
        rx_pr pr = {0};
        long objects;
        status = rx_list_curve(&list, run, &objects, &pr, err);
        if (has_curve(f, k))
            rx_curves_add(&c, RX_CURVE_LINE, rx_method_color(name), name);
        for (long j = 0; j < pr.n; j++)
            if (j % (pr.n / POINTS_MAX + 1) == 0 || j + 1 == pr.n) {
                const rx_pr_point *p = &pr.point[j];
                rx_report_put(t, f->group.name, f->group.condition[k], name, p->score, p->recall,
                              p->precision);
                if (has_curve(f, k))
                    rx_curves_put(&c, p->recall, p->precision, NAN, NAN);
            }
        rx_pr_free(&pr);
    }
    snprintf(id, sizeof id, "field%d-curve%d", f->number, k);
    snprintf(title, sizeof title, "Magnitude %g (S/N %.3g)", f->lab->scene[k].mag,
             snr_of(f->lab, f->number, k));
    rx_curves_figure(rx_report_figures_of(report), id, title, "", &axes, &c);
    return status;
}

/* --- page --- */

RX_COLUMNS(RUNS, RX_TEXT("name", ""), RX_TEXT("settings", ""));

RX_COLUMNS(SETS, RX_TEXT("scene", "field"), RX_TEXT("condition", "magnitude of the stars"),
           RX_NUMBER("mag", 2, "mag", "of the stars"),
           RX_NUMBER("snr", 1, "", "in a matched filter on the background"), RX_COUNT("tiles", ""),
           RX_COUNT("stars", ""), RX_NUMBER("mpixels", 3, "", ""), RX_TEXT("about", "the field"));

RX_COLUMNS(CUTS, RX_TEXT("scene", "field"), RX_TEXT("run", "restorer"),
           RX_NUMBER("precision_from", 2, "", "at least this precision; nan: the whole list"),
           RX_NUMBER("score", 2, "", "lowest score; inf: the precision is never reached"),
           RX_COUNT("whole_list", "1: the list ends above this precision, completeness is a lower limit"),
           RX_ESTIMATE("precision", 4, "", "over all sets of the field"),
           RX_ESTIMATE("recall", 3, "", "over all sets of the field"),
           RX_ESTIMATE("mag50", 2, "mag", "magnitude of 50 % completeness"),
           RX_ESTIMATE("mag90", 2, "mag", "magnitude of 90 % completeness"),
           RX_ESTIMATE("false_per_mpixel", 2, "", "whole list"));

/* Thresholds of a field; on the page without what its other tables have. */
static void add_cuts(rx_report *report, const field *f, rx_report_table *t)
{
    static const char *const shown[] = {"run",    "precision_from", "score", "precision",
                                        "recall", "mag50",          "mag90"};
    const rx_report_view view = {
        .from = rx_report_rows(t),
        .ncolumns = sizeof shown / sizeof *shown,
        .columns = shown,
        .title = "Over all magnitudes: depth, and thresholds of equal precision",
        .note = "The threshold is the lowest score (S/N of the detection) at which precision over "
                "all magnitudes is at least that named. A depth with an infinite end is a limit.",
        .in_brief = 1};
    for (int p = -1; p < f->lab->nprecisions; p++)
        for (int run = 0; run < f->lab->nruns; run++) {
            const cut *c = cut_of(f, run, p);
            rx_report_put(t, f->group.name, f->group.column[run], p < 0 ? NAN : f->lab->precision[p],
                          c->score, c->whole_list, c->precision, c->recall, c->mag50, c->mag90,
                          c->false_per_mpixel);
        }
    rx_report_show(report, t, &view);
}

const char rx_photometry_reading[] = "Stars of one magnitude at a time are put onto tiles with other objects "
                                     "and noise; every restorer restores "
                                     "the same tiles. A star is found when a detection lies on it; a false "
                                     "detection is neither a star nor any "
                                     "object known to be there, so precision depends on how many stars a "
                                     "tile holds, the same for all. On a real "
                                     "tile, what was found before the stars were added counts neither as "
                                     "right nor as false; all that is found on "
                                     "as many realisations of its noise without sources is false. <b>Equal "
                                     "precision</b>: each restorer gets the "
                                     "threshold at which its own precision has the value named; then "
                                     "completeness is compared. <b>MagErr</b> is a "
                                     "mean of absolute values, which hides the sign and weighs gross errors. "
                                     "It, bias, scatter and pull are of the "
                                     "stars that a restorer found: one that finds more has more of the "
                                     "difficult ones. Intervals: Clopper-Pearson, "
                                     "order statistics, Student's t of means, bootstrap of average precision "
                                     "and depth; they take stars of one "
                                     "tile as independent, and thresholds as given.";

rx_status rx_photometry_report(const rx_lab *lab, rx_lab_page *page, rx_error *err)
{
    rx_report *report = page->report;
    rx_report_table *runs = RX_REPORT_TABLE(report, "runs", RUNS, RX_REPORT_IN_JSON),
                    *sets = RX_REPORT_TABLE(report, "sets", SETS, RX_REPORT_EVERYWHERE),
                    *cuts = RX_REPORT_TABLE(report, "cuts", CUTS, RX_REPORT_EVERYWHERE),
                    *curves = RX_REPORT_TABLE(report, "curves", PR, RX_REPORT_IN_FILE);
    rx_status status = RX_OK;
    rx_report_fact_numbers(report, "precisions", lab->nprecisions, lab->precision);
    for (int i = 0; i < lab->nconditions && status == RX_OK; i++) {
        field f = {.lab = lab, .number = i, .seed = page->seed};
        const long from = rx_report_rows(sets);
        char id[32];
        snprintf(id, sizeof id, "field%d", i);
        status = measure_field(&f, err);
        for (int k = 0; k < lab->nscenes && status == RX_OK; k++) {
            status = add_curves(report, &f, k, curves, err);
            rx_report_put(sets, f.group.name, f.group.condition[k], lab->scene[k].mag, snr_of(lab, i, k),
                          rx_lab_set_of(lab, i, k)->table[RX_PHOTOMETRY_TILE].n, stars_of(lab, i, k)->n,
                          mpixels_of(lab, i, k), lab->sky[i].about);
        }
        if (status == RX_OK) {
            const int open = DRAWN + lab->nprecisions;
            rx_lab_group_show(page, &f.group, id, f.group.name, i < FIGURE_FIELDS ? open : 0, open,
                              lab->sky[i].about);
            add_cuts(report, &f, cuts);
            rx_report_fold(report, "Tiles");
            rx_report_show(report, sets, RX_VIEW(.from = from));
            rx_report_unfold(report);
        }
        rx_lab_group_free(&f.group);
        free(f.cuts);
        free(f.work);
    }
    rx_report_section(report, "runs", "Restorers");
    for (int run = 0; run < lab->nruns; run++)
        rx_report_put(runs, lab->run[run].name, lab->run[run].settings);
    rx_report_show(report, runs, RX_VIEW(.from = 0));
    return status;
}
