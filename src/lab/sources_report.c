/* The report of a campaign of sources. DETECTION: a group for each scene, its conditions those of the campaign; PHOTOMETRY: a
 * group for each field, its conditions the magnitudes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "lab/report.h"
#include "lab/sources.h"
#include "quality/evaluate.h"
#include "quality/statistics.h"
#include "report/figure.h"

#define ALL HUGE_VAL

/* --- quantities --- */

typedef enum statistic {
    AP,
    SHARE,     /* of the objects whose own column `part` is in low..high, found at the cut */
    PRECISION, /* of the whole list */
    RATE,      /* false detections of it */
    CROWDED,
    MEAN, /* of a value of the objects found */
    MEDIAN,
    WIDTH /* sigma_MAD */
} statistic;
enum { WHOLE = -1 }; /* cut; else number of the precision */

typedef enum found_value { ERROR_PERCENT, ERROR_CLEAN, SIGNED_PERCENT, SIGNED_MAG, PULL } found_value;

/* What lies open and is drawn, behind ap and recall at each precision; and what is folded away. */
static const rx_quantity OPEN[] = {
    {"magerr", "%", 2, MEAN, ERROR_PERCENT, WHOLE, 0, 0, 0,
     "mean of 100 |F - F0| / F0 over the objects found (the paper's MagErr)"},
    {"recall", "", 3, SHARE, RX_OBJECT_SNR, WHOLE, -ALL, ALL, 0, "share of the objects found, whole list"},
    {"precision", "", 3, PRECISION, 0, WHOLE, 0, 0, 0,
     "objects found / (objects found + false detections on the same tiles), whole list"}};
static const rx_quantity FOLDED[] = {
    {"false", "per Mpixel", 3, RATE, 0, WHOLE, 0, 0, 0, "false detections, whole list"},
    {"magerr_clean", "%", 2, MEAN, ERROR_CLEAN, WHOLE, 0, 0, 0, "magerr without objects flagged as blended"},
    {"blended", "", 3, CROWDED, 0, WHOLE, 0, 0, 0,
     "share of the objects found that FLAGS calls blended or crowded"},
    {"bias_percent", "%", 2, MEDIAN, SIGNED_PERCENT, WHOLE, 0, 0, 0, "median of 100 (F - F0) / F0"},
    {"scatter_percent", "%", 2, WIDTH, SIGNED_PERCENT, WHOLE, 0, 0, 0, "sigma_MAD of 100 (F - F0) / F0"},
    {"bias_mag", "mag", 3, MEDIAN, SIGNED_MAG, WHOLE, 0, 0, 0, "median of m - m0"},
    {"scatter_mag", "mag", 3, WIDTH, SIGNED_MAG, WHOLE, 0, 0, 0, "sigma_MAD of m - m0"},
    {"pull_median", "", 2, MEDIAN, PULL, WHOLE, 0, 0, 0, "median of (F - F0) / error, 0 when unbiased"},
    {"pull_width", "", 2, WIDTH, PULL, WHOLE, 0, 0, 0,
     "sigma_MAD of (F - F0) / error, 1 when errors are true"}};
static const rx_quantity PAIRS[] = {
    {"resolved", "", 3, SHARE, RX_OBJECT_APART, 0, 0, ALL, 1,
     "share of the pairs resolved, at the first precision of STARS and GALAXIES together"},
    {"resolved_close", "", 3, SHARE, RX_OBJECT_APART, 0, 0, 0.75, 1, "the same, separations below 0.75 FWHM"},
    {"resolved_wide", "", 3, SHARE, RX_OBJECT_APART, 0, 0.75, ALL, 1, "the same, separations from 0.75 FWHM"},
    {"resolved_whole", "", 3, SHARE, RX_OBJECT_APART, WHOLE, 0, ALL, 1,
     "share of the pairs resolved, whole list"}};
enum { SNR_BINS = 4 };
static const double SNR_EDGE[SNR_BINS + 1] = {0, 10, 20, 50, HUGE_VAL};

static void add_quantities(rx_lab_group *g, size_t n, const rx_quantity *quantities)
{
    memcpy(&g->quantity[g->nquantities], quantities, n * sizeof *quantities);
    g->nquantities += (int)n;
}

static void name_quantities(const rx_lab *lab, rx_scene_id scene, rx_lab_group *g)
{
    if (scene == RX_SCENE_PAIRS) {
        add_quantities(g, sizeof PAIRS / sizeof *PAIRS, PAIRS);
        g->open = 1;
        return;
    }
    rx_quantity q = {
        "ap", "", 3, AP, 0,
        0,    0,  0, 1,  "average precision: area under the steps of the precision-recall curve"};
    add_quantities(g, 1, &q);
    q = (rx_quantity){"", "", 3, SHARE, RX_OBJECT_SNR, 0, -ALL, ALL, 1, ""};
    for (; q.cut < lab->nprecisions; q.cut++) {
        snprintf(q.name, sizeof q.name, "recall_p%g", lab->precision[q.cut]);
        snprintf(q.help, sizeof q.help, "share of the objects found at precision %g", lab->precision[q.cut]);
        add_quantities(g, 1, &q);
    }
    add_quantities(g, sizeof OPEN / sizeof *OPEN, OPEN);
    g->open = g->nquantities;
    add_quantities(g, sizeof FOLDED / sizeof *FOLDED, FOLDED);
    q.cut = lab->nprecisions > 0 ? 0 : WHOLE;
    for (int b = 0; b < SNR_BINS && scene != RX_SCENE_MAGNITUDE; b++) {
        q.low = SNR_EDGE[b];
        q.high = SNR_EDGE[b + 1];
        snprintf(q.name, sizeof q.name, "recall_snr%g", fmax(q.low, lab->config->truth_snr));
        snprintf(q.help, sizeof q.help, "recall at the first precision, objects of S/N %g to %g",
                 fmax(q.low, lab->config->truth_snr), q.high);
        add_quantities(g, 1, &q);
    }
}

/* --- lists --- */

/* Scenes first to last of a condition, but PAIRS, by one run. */
typedef struct list {
    const rx_lab *lab;
    int condition, first, last, run;
} list;

static const rx_lab_table *table_of(const list *l, int scene, int table)
{
    return &rx_lab_tables_of(l->lab, l->condition, scene)[table];
}

/* Of an own column over the rows. */
static double sum_of(const rx_lab_table *table, int column)
{
    double sum = 0;
    for (long i = 0; i < table->n; i++)
        sum += rx_lab_own(table, i)[column];
    return sum;
}

/* *objects of them. rx_pr_free(). */
static rx_status make_curve(const list *l, long *objects, rx_pr *dst, rx_error *err)
{
    size_t room = 1;
    long n = 0;
    for (int s = l->first; s <= l->last; s++)
        room += (size_t)(table_of(l, s, RX_SOURCES_OBJECT)->n + table_of(l, s, RX_SOURCES_FALSE)->n);
    double *score = NULL;
    unsigned char *right = NULL;
    rx_status status;
    *objects = 0;
    RX_TRY_EXIT(RX_MAKE(score, room, err));
    RX_TRY_EXIT(RX_MAKE(right, room, err));
    for (int s = l->first; s <= l->last; s++) {
        const rx_lab_table *object = table_of(l, s, RX_SOURCES_OBJECT),
                           *wrong = table_of(l, s, RX_SOURCES_FALSE);
        if (l->lab->scene[s].id == RX_SCENE_PAIRS)
            continue;
        *objects += object->n;
        for (long i = 0; i < object->n; i++)
            if (!isnan(score[n] = rx_lab_each(object, i, l->run)[RX_FOUND_SCORE]))
                right[n++] = 1;
        for (long i = 0; i < wrong->n; i++)
            if (rx_lab_own(wrong, i)[RX_FALSE_RUN] == l->run) {
                right[n] = 0;
                score[n++] = rx_lab_own(wrong, i)[RX_FALSE_SCORE];
            }
    }
    status = rx_pr_make(n, score, right, *objects, dst, err);
exit:
    free(score);
    free(right);
    return status;
}

/* What has that score or a higher one. */
static rx_pr_point count_from(const rx_pr *pr, double score)
{
    rx_pr_point p = {0};
    for (long k = 0; k < pr->n && pr->point[k].score >= score; k++)
        p = pr->point[k];
    return p;
}

/* A threshold: the lowest score at which precision is at least the one named; +infinity where it never is. No lists (PAIRS
 * alone): everything. */
typedef struct cut {
    double score;
    int whole_list; /* the list ends before precision falls so low: recall is a lower limit */
} cut;

static void choose_cuts(const rx_lab *lab, const rx_pr *pr, long objects, cut *dst)
{
    for (int p = 0; p < lab->nprecisions; p++) {
        dst[p] = (cut){objects > 0 ? ALL : -ALL, 0};
        for (long k = pr->n - 1; k >= 0 && dst[p].score == ALL; k--)
            if (pr->point[k].precision >= lab->precision[p])
                dst[p] = (cut){pr->point[k].score, k == pr->n - 1};
    }
}

/* --- numbers --- */

static double value_of(const double *found, found_value kind)
{
    const double off = found[RX_FOUND_RATIO] - 1;
    switch (kind) {
    case ERROR_PERCENT:
        return 100 * fabs(off);
    case ERROR_CLEAN:
        return found[RX_FOUND_CROWDED] > 0 ? NAN : 100 * fabs(off);
    case SIGNED_PERCENT:
        return 100 * off;
    case SIGNED_MAG:
        return found[RX_FOUND_RATIO] > 0 ? -2.5 * log10(found[RX_FOUND_RATIO]) : NAN;
    case PULL:
        return found[RX_FOUND_PULL];
    }
    return NAN;
}

/* Of the objects found: a statistic of their values. work: [objects]. */
static rx_estimate measure_values(const rx_lab_table *object, int run, const rx_quantity *q, double *work)
{
    rx_estimate median, width;
    long n = 0;
    for (long i = 0; i < object->n; i++) {
        const double *v = rx_lab_each(object, i, run);
        work[n] = isnan(v[RX_FOUND_SCORE]) ? NAN : value_of(v, (found_value)q->part);
        n += isfinite(work[n]) != 0;
    }
    if (q->statistic == MEAN)
        return rx_mean_estimate(n, work, RX_LEVEL);
    rx_robust_estimates(work, n, RX_LEVEL, &median, &width);
    return q->statistic == MEDIAN ? median : width;
}

static rx_estimate measure_share(const rx_lab_table *object, int run, const rx_quantity *q, double score)
{
    long n = 0, found = 0;
    for (long i = 0; i < object->n; i++) {
        const double own = rx_lab_own(object, i)[q->part];
        const int counts = own >= q->low && own < q->high;
        n += counts;
        found +=
            counts && rx_lab_each(object, i, run)[RX_FOUND_SCORE] >= score; /* NAN is below every score */
    }
    return rx_binomial_interval(found, n, RX_LEVEL);
}

/* All quantities of a list of one scene, entry c of the group. */
static rx_status measure_list(const rx_lab_group *g, int c, const list *l, const rx_pr *pr, const cut *cuts,
                              uint64_t seed, rx_error *err)
{
    const rx_lab_table *object = table_of(l, l->first, RX_SOURCES_OBJECT);
    const rx_pr_point all = count_from(pr, -ALL);
    const double mpixels = sum_of(table_of(l, l->first, RX_SOURCES_TILE), RX_TILE_MPIXELS);
    double *work = NULL;
    long crowded = 0;
    RX_TRY(rx_interrupt_check(err));
    rx_status status = RX_MAKE(work, (size_t)object->n + 1, err);
    for (long i = 0; i < object->n; i++)
        crowded += !isnan(rx_lab_each(object, i, l->run)[RX_FOUND_SCORE]) &&
                   rx_lab_each(object, i, l->run)[RX_FOUND_CROWDED] > 0;
    for (int i = 0; i < g->nquantities && status == RX_OK; i++) {
        const rx_quantity *q = &g->quantity[i];
        const int whole = q->cut == WHOLE || l->lab->nprecisions == 0;
        rx_estimate *dst = &rx_lab_group_at(g, i, c, l->run)->value;
        if (q->statistic == AP)
            status = rx_pr_interval(pr, object->n, RX_LEVEL, (rx_resampling){.seed = seed, .nthreads = 1},
                                    dst, err);
        else if (q->statistic == SHARE)
            *dst = measure_share(object, l->run, q, whole ? -ALL : cuts[q->cut].score);
        else if (q->statistic == PRECISION)
            *dst = rx_binomial_interval(all.matched, all.detections, RX_LEVEL);
        else if (q->statistic == RATE)
            *dst = rx_poisson_rate(all.detections - all.matched, mpixels, RX_LEVEL);
        else if (q->statistic == CROWDED)
            *dst = rx_binomial_interval(crowded, all.matched, RX_LEVEL);
        else
            *dst = measure_values(object, l->run, q, work);
    }
    free(work);
    return status;
}

/* The column RL of DETECTION, RL at its best: for ap, the recalls and PAIRS the one of its settings with the highest value,
 * each for itself, chosen on the very tiles of the test, in RL's favour; for everything else `chosen`, that of the highest
 * ap over both lists of the condition together. */
static void fill_best(const rx_lab_group *g, int condition, int chosen)
{
    for (int q = 0; q < g->nquantities; q++) {
        int from = chosen;
        for (int k = 0; k < g->lab->nruns && g->quantity[q].best; k++)
            if (g->lab->run[k].tuned && rx_lab_group_at(g, q, condition, k)->value.value >
                                            rx_lab_group_at(g, q, condition, from)->value.value)
                from = k;
        *rx_lab_group_at(g, q, condition, g->lab->nruns) =
            (rx_finding){rx_lab_group_at(g, q, condition, from)->value, g->lab->run[from].name};
    }
}

/* One condition of the lab: a condition of every group of DETECTION, a group of PHOTOMETRY. Cuts of PHOTOMETRY and of PAIRS
 * are of all scenes together, of the lists of DETECTION of their own. cuts: [nruns][nprecisions] of all scenes. */
static rx_status measure_condition(rx_lab_group *groups, int condition, int fields, uint64_t seed, cut *cuts,
                                   rx_error *err)
{
    const rx_lab *lab = groups->lab;
    double highest = -1;
    int chosen = -1;
    for (int k = 0; k < lab->nruns; k++) {
        cut *all = cuts + k * lab->nprecisions, own[RX_PRECISIONS_MAX];
        rx_pr pr = {0};
        long objects;
        RX_TRY(make_curve(&(list){lab, condition, 0, lab->nscenes - 1, k}, &objects, &pr, err));
        choose_cuts(lab, &pr, objects, all);
        if (lab->run[k].tuned && (chosen < 0 || (objects > 0 && pr.ap.value > highest))) {
            chosen = k;
            highest = objects > 0 ? pr.ap.value : NAN;
        }
        rx_pr_free(&pr);
        for (int s = 0; s < lab->nscenes; s++) {
            const list one = {lab, condition, s, s, k};
            const int together = fields || lab->scene[s].id == RX_SCENE_PAIRS;
            RX_TRY(make_curve(&one, &objects, &pr, err));
            choose_cuts(lab, &pr, objects, own);
            const rx_status status = measure_list(&groups[fields ? 0 : s], fields ? s : condition, &one, &pr,
                                                  together ? all : own, seed, err);
            rx_pr_free(&pr);
            RX_TRY(status);
        }
    }
    for (int s = 0; s < lab->nscenes && chosen >= 0; s++)
        fill_best(&groups[s], condition, chosen);
    return RX_OK;
}

/* --- page --- */

/* P-R curves, as the paper's figure, of six magnitudes, on the first fields only: the page of many conditions stays
 * readable. */
enum { CURVES = 6, POINTS_MAX = 200, FIELDS_WITH_CURVES = 2, FIELDS_DRAWN = 12 };

RX_COLUMNS(SETS, RX_TEXT("scene", "field"), RX_TEXT("condition", "magnitude of the stars"),
           RX_NUMBER("mag", 2, "mag", "of the stars"),
           RX_NUMBER("snr", 1, "", "in a matched filter on the background"), RX_COUNT("tiles", ""),
           RX_COUNT("stars", ""), RX_NUMBER("mpixels", 3, "", ""), RX_TEXT("about", "the field"));

RX_COLUMNS(CUTS, RX_TEXT("scene", "field"), RX_TEXT("run", "restorer"),
           RX_NUMBER("precision_from", 2, "", "at least this precision; nan: the whole list"),
           RX_NUMBER("score", 2, "", "lowest score; inf: the precision is never reached"),
           RX_COUNT("whole_list", "1: the list ends above this precision, recall is a lower limit"),
           RX_ESTIMATE("precision", 4, "", "over all sets of the field"),
           RX_ESTIMATE("recall", 3, "", "over all sets of the field"));

/* Precision over recall of one magnitude, thinned. */
static rx_status draw_curves(rx_lab_page *page, const rx_lab_group *g, int field, int scene, rx_error *err)
{
    static const rx_axes axes = {"recall", "precision", 0, 1.02, 0, 1.02, false, false};
    rx_curves c = {0};
    char id[RX_FIGURE_ID], title[96];
    rx_status status = RX_OK;
    for (int run = 0; run < page->lab->nruns && status == RX_OK; run++) {
        rx_pr pr = {0};
        long objects;
        status = make_curve(&(list){page->lab, field, scene, scene, run}, &objects, &pr, err);
        rx_curves_add(&c, RX_CURVE_LINE, rx_method_color(g->column[run]), g->column[run]);
        for (long j = 0; j < pr.n; j++)
            if (j % (pr.n / POINTS_MAX + 1) == 0 || j + 1 == pr.n)
                rx_curves_put(&c, pr.point[j].recall, pr.point[j].precision, NAN, NAN);
        rx_pr_free(&pr);
    }
    snprintf(id, sizeof id, "field%d-curve%d", field, scene);
    snprintf(title, sizeof title, "Magnitude %s", g->condition[scene]);
    rx_curves_figure(rx_report_figures_of(page->report), id, title, "", &axes, &c);
    return status;
}

/* A field: its sets, its curves, its thresholds over all magnitudes together. */
static rx_status add_field(rx_lab_page *page, const rx_lab_group *g, int field, const cut *cuts,
                           rx_report_table *const tables[2], rx_error *err)
{
    const rx_lab *lab = page->lab;
    const rx_lab_sky *sky = &lab->sky[field];
    for (int k = 0; k < lab->nscenes; k++) {
        const rx_lab_table *table = rx_lab_tables_of(lab, field, k), *tile = &table[RX_SOURCES_TILE];
        rx_report_put(tables[0], g->name, g->condition[k], lab->scene[k].mag,
                      sum_of(tile, RX_TILE_SNR) / (double)tile->n, tile->n, table[RX_SOURCES_OBJECT].n,
                      sum_of(tile, RX_TILE_MPIXELS), sky->about);
        if (field < FIELDS_WITH_CURVES && k >= lab->nscenes - CURVES)
            RX_TRY(draw_curves(page, g, field, k, err));
    }
    for (int p = -1; p < lab->nprecisions; p++)
        for (int run = 0; run < lab->nruns; run++) {
            const cut whole = {-ALL, 1}, *c = p < 0 ? &whole : &cuts[run * lab->nprecisions + p];
            rx_pr pr = {0};
            long objects;
            RX_TRY(make_curve(&(list){lab, field, 0, lab->nscenes - 1, run}, &objects, &pr, err));
            const rx_pr_point at = count_from(&pr, c->score);
            rx_report_put(tables[1], g->name, g->column[run], p < 0 ? NAN : lab->precision[p], c->score,
                          c->whole_list, rx_binomial_interval(at.matched, at.detections, RX_LEVEL),
                          rx_binomial_interval(at.matched, objects, RX_LEVEL));
            rx_pr_free(&pr);
        }
    return RX_OK;
}

const char rx_sources_reading[] =
    "Every restorer restores the same tiles. An object is found when a detection lies on it; a false "
    "detection is neither an object nor anything known to be there, so precision depends on how many objects "
    "a tile holds, the same for all. Stars of PHOTOMETRY are of one magnitude at a time, among other "
    "objects; on a real tile, what was found before the stars were added counts neither as right nor as "
    "false, and all that is found on as many realisations of its noise without sources is false. <b>Equal "
    "precision</b>: each restorer gets the threshold at which its own precision has the value named "
    "(DETECTION: on the scene itself, PAIRS on STARS and GALAXIES together; PHOTOMETRY: over all "
    "magnitudes); then recall is compared. <b>MagErr</b> is a mean of absolute values, which hides the sign "
    "and weighs gross errors. It, bias, scatter and pull are of the objects that a restorer found: one that "
    "finds more has more of the difficult ones. <b>MATCHED</b> is the unrestored image with a Gaussian of "
    "the PSF's width as its detection filter, NONE the same with FILTER_NAME. <b>RL</b> of DETECTION is "
    "Richardson-Lucy at its best: for ap, the recalls and PAIRS the setting of the highest value, each for "
    "itself and chosen on the tiles of the test, in its favour; for everything else that of the highest ap "
    "over STARS and GALAXIES together (rows.ecsv has each). Intervals: Clopper-Pearson, Poisson, order "
    "statistics, Student's t of means, bootstrap of average precision; they take objects of one tile as "
    "independent, and thresholds as given. Figures: where restorers are given the truth.";

void rx_sources_name_set(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96])
{
    const int fields = lab->scene[unit->scene].id == RX_SCENE_MAGNITUDE;
    snprintf(names[!fields], sizeof *names, "%s", lab->sky[unit->condition].name);
    snprintf(names[fields], sizeof *names, "%s", lab->scene[unit->scene].name);
}

/* Of a field, or of a scene of DETECTION. */
static rx_status open_group(rx_lab_group *g, const rx_lab *lab, int fields, int number, rx_error *err)
{
    const int n = fields ? lab->nscenes : lab->nconditions;
    *g = (rx_lab_group){.axis = fields ? "magnitude" : "FWHM of the PSF (pixels)"};
    g->name = fields ? lab->sky[number].name : lab->scene[number].name;
    name_quantities(lab, lab->scene[fields ? 0 : number].id, g);
    for (int k = 0; k < lab->nruns && !fields; k++) {
        g->hidden[k] = lab->run[k].tuned;
        if (lab->run[k].tuned) {
            g->ncolumns = 1;
            g->column[lab->nruns] = "RL";
        }
    }
    RX_TRY(rx_lab_group_open(g, lab, n, err));
    for (int c = 0; c < n; c++) {
        g->condition[c] = fields ? lab->scene[c].name : lab->sky[c].name;
        g->place[c] = fields                               ? lab->scene[c].mag
                      : lab->sky[c].condition.error == 0.0 ? lab->sky[c].fwhm
                                                           : NAN;
    }
    return RX_OK;
}

rx_status rx_sources_report(rx_lab_page *page, rx_error *err)
{
    const rx_lab *lab = page->lab;
    const int fields = lab->scene[0].id == RX_SCENE_MAGNITUDE, n = fields ? lab->nconditions : lab->nscenes;
    rx_report_table *tables[2] = {NULL};
    rx_lab_group *groups = NULL;
    cut *cuts = NULL;
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(groups, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(cuts, (size_t)lab->nruns * (size_t)lab->nprecisions + 1, err));
    rx_report_fact_numbers(page->report, "precisions", lab->nprecisions, lab->precision);
    if (fields) {
        tables[0] = RX_REPORT_TABLE(page->report, "sets", SETS, RX_REPORT_EVERYWHERE);
        tables[1] = RX_REPORT_TABLE(page->report, "cuts", CUTS, RX_REPORT_EVERYWHERE);
    }
    for (int g = 0; g < n; g++)
        RX_TRY_EXIT(open_group(&groups[g], lab, fields, g, err));
    for (int c = 0; c < lab->nconditions; c++) {
        RX_TRY_EXIT(
            measure_condition(&groups[fields ? c : 0], c, fields, (uint64_t)lab->config->seed, cuts, err));
        if (fields)
            RX_TRY_EXIT(add_field(page, &groups[c], c, cuts, tables, err));
    }
    for (int g = 0; g < n; g++) {
        char id[32];
        snprintf(id, sizeof id, fields ? "field%d" : "scene%d", g);
        rx_lab_group_show(page, &groups[g], id, groups[g].name, g < FIELDS_DRAWN,
                          fields ? lab->sky[g].about : lab->scene[g].about);
    }
    if (fields) {
        rx_report_section(page->report, "cuts", "Thresholds of equal precision, and sets");
        rx_report_show(page->report, tables[1], RX_VIEW(.in_brief = 1));
        rx_report_show(page->report, tables[0], RX_VIEW(.from = 0));
    }
exit:
    for (int g = 0; g < n && groups != NULL; g++)
        rx_lab_group_free(&groups[g]);
    free(groups);
    free(cuts);
    return status;
}
