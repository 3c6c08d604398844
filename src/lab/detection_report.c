/* The report of a detection campaign: a group for each scene. A method's cut for a precision: the lowest score at which
 * precision over STARS and GALAXIES of the condition together is at least that (no such scenes: the whole list). The
 * column RL is RL at its best: for ap and the recalls of STARS and GALAXIES and for PAIRS the one of its settings with the
 * highest value, each for itself, chosen on the very tiles of the test, in RL's favour; for everything else the setting of
 * the highest ap over both scenes of the condition together. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/detection.h"
#include "lab/report.h"
#include "quality/hypothesis.h"

#define ALL HUGE_VAL

static const double LEVEL = 0.95;

/* --- quantities --- */

typedef enum statistic {
    AP,
    SHARE,     /* of the objects whose own column `part` is in low..high, found above the cut */
    PRECISION, /* of the whole list */
    WRONG,     /* false detections in low..high (FWHM from an object) above the cut, per Mpixel */
    WORST,     /* `part` of a plateau, the largest of the tiles */
    STACKED    /* `part` of the growth of galaxies of S/N low..high */
} statistic;

/* Cuts: number 0.. of the precisions on the scene itself, or */
enum {
    WHOLE = -1,
    FIRST = -2,
    LAST = -3
}; /* the whole list; the first or the last precision on both lists */

enum { SNR_BINS = 4, FAINT_BINS = 3, OPEN = 2 }; /* OPEN: quantities of a scene that are not folded away */
static const double SNR_EDGE[SNR_BINS + 1] = {0, 10, 20, 50, HUGE_VAL};
static const double FAINT_EDGE[FAINT_BINS + 1] = {0, 10, 20, HUGE_VAL}; /* S/N of galaxies */

/* STARS: of every list. */
enum { FIXED_MOST = 5 };
static const rx_quantity FIXED[RX_SCENE_IDS][FIXED_MOST] = {
    [RX_SCENE_STARS] = {{"recall_whole", "", 3, SHARE, RX_OBJECT_SNR, WHOLE, 0, ALL, 0,
                         "share of the objects found, whole list"},
                        {"precision_whole", "", 3, PRECISION, 0, WHOLE, 0, 0, 0,
                         "right detections / all that count, whole list"},
                        {"false_whole", "per Mpixel", 3, WRONG, 0, WHOLE, -ALL, ALL, 0,
                         "false detections, whole list"}},
    [RX_SCENE_PAIRS] = {{"resolved", "", 3, SHARE, RX_OBJECT_APART, FIRST, 0, ALL, 1,
                         "share of the pairs resolved, at the first precision's cut"},
                        {"resolved_close", "", 3, SHARE, RX_OBJECT_APART, FIRST, 0, 0.75, 1,
                         "the same, separations below 0.75 FWHM"},
                        {"resolved_wide", "", 3, SHARE, RX_OBJECT_APART, FIRST, 0.75, ALL, 1,
                         "the same, separations from 0.75 FWHM"},
                        {"resolved_whole", "", 3, SHARE, RX_OBJECT_APART, WHOLE, 0, ALL, 1,
                         "share of the pairs resolved, whole list"}},
    [RX_SCENE_BLANK] = {{"false_cut", "per Mpixel", 2, WRONG, 0, LAST, -ALL, ALL, 0,
                         "false detections at the last precision's cut"},
                        {"false_whole", "per Mpixel", 2, WRONG, 0, WHOLE, -ALL, ALL, 0,
                         "false detections, whole list"}},
    [RX_SCENE_RINGS] = {{"false_0_2", "per Mpixel", 1, WRONG, 0, LAST, 0, 2, 0,
                         "false detections within 2 FWHM of a bright star, at the last precision's cut"},
                        {"false_2_4", "per Mpixel", 1, WRONG, 0, LAST, 2, 4, 0, "the same, 2 to 4 FWHM"},
                        {"false_4_6", "per Mpixel", 1, WRONG, 0, LAST, 4, 6, 0, "the same, 4 to 6 FWHM"},
                        {"false_whole", "per Mpixel", 1, WRONG, 0, WHOLE, 0, 6, 0,
                         "within 6 FWHM, whole list"},
                        {"recall", "", 3, SHARE, RX_OBJECT_SNR, WHOLE, 0, ALL, 0,
                         "share of the bright stars found"}},
    [RX_SCENE_PLATEAU] = {{"phases2", "sigma", 4, WORST, RX_PHASES_2, 0, 0, 0, 0,
                           "rms of the means of the 2 x 2 phases, the worst tile"},
                          {"phases4", "sigma", 4, WORST, RX_PHASES_4, 0, 0, 0, 0,
                           "rms of the means of the 4 x 4 phases, the worst tile"},
                          {"range4", "sigma", 4, WORST, RX_PHASES_RANGE, 0, 0, 0, 0,
                           "range of the means of the 4 x 4 phases, the worst tile"}},
};

static void name_quantities(const rx_lab *lab, rx_scene_id scene, rx_lab_group *g)
{
    static const char *const growth[][2] = {{"r1", "within r50"},
                                            {"r2", "within 2 r50"},
                                            {"r4", "within 4 r50"},
                                            {"r2_4", "between 2 and 4 r50"}};
    const int list = rx_scene_is_list(scene);
    rx_quantity *q = g->quantity;
    if (list)
        *q++ = (rx_quantity){"ap", "", 3, AP, 0, 0, 0, 0, 1, "average precision"};
    for (int p = 0; p < lab->nprecisions && list; p++, q++) {
        *q = (rx_quantity){"", "", 3, SHARE, RX_OBJECT_SNR, p, 0, ALL, 1, ""};
        snprintf(q->name, sizeof q->name, "recall_p%g", lab->precision[p]);
        snprintf(q->help, sizeof q->help,
                 "share of the objects found at the threshold of precision %g on this scene",
                 lab->precision[p]);
    }
    const rx_quantity *fixed = FIXED[list ? RX_SCENE_STARS : scene];
    for (int i = 0; i < FIXED_MOST && fixed[i].name[0] != '\0'; i++)
        *q++ = fixed[i];
    for (int b = 0; b < SNR_BINS && list; b++, q++) {
        const double from = fmax(SNR_EDGE[b], lab->truth_snr);
        *q = (rx_quantity){
            "", "", 3, SHARE, RX_OBJECT_SNR, lab->nprecisions > 0 ? 0 : WHOLE, SNR_EDGE[b], SNR_EDGE[b + 1],
            1,  ""};
        snprintf(q->name, sizeof q->name, "recall_snr%g", from);
        snprintf(q->help, sizeof q->help, "recall at the first precision, objects of S/N %g to %g", from,
                 SNR_EDGE[b + 1]);
    }
    for (int i = 0; i < 4 * FAINT_BINS && scene == RX_SCENE_OUTSKIRTS; i++, q++) {
        const double from = FAINT_EDGE[i / 4], to = FAINT_EDGE[i / 4 + 1];
        *q = (rx_quantity){"", "", 3, STACKED, i % 4, 0, from, to, 0, ""};
        snprintf(q->name, sizeof q->name, "%s_snr%g", growth[i % 4][0], from);
        snprintf(q->help, sizeof q->help,
                 "flux %s over the true one there, galaxies of S/N %g to %g, all together", growth[i % 4][1],
                 from, to);
    }
    g->nquantities = (int)(q - g->quantity);
}

/* --- statistics --- */

static rx_estimate worst(const rx_lab_table *plateau, int run, int part)
{
    rx_estimate e = {-HUGE_VAL, HUGE_VAL, -HUGE_VAL, plateau->n};
    for (long i = 0; i < plateau->n; i++) {
        const double v = rx_lab_each(plateau, i, run)[part];
        e.low = fmin(e.low, v);
        e.value = e.high = fmax(e.high, v);
    }
    return e;
}

/* Mean of the measured over the mean of the true flux; the interval is that of the mean of the measured. */
static rx_status stacked(const rx_lab_table *growth, int run, const rx_quantity *q, rx_estimate *dst,
                         rx_error *err)
{
    double truth = 0, *work = NULL;
    long n = 0;
    RX_TRY(RX_MAKE(work, (size_t)growth->n + 1, err));
    for (long i = 0; i < growth->n; i++) {
        const double *v = rx_lab_each(growth, i, run), *t = v + RX_OUTSKIRT_RADII;
        const double snr = rx_lab_own(growth, i)[RX_GALAXY_SNR];
        if (snr < q->low || snr >= q->high)
            continue;
        work[n++] = q->part < RX_OUTSKIRT_RADII ? v[q->part] : (double)((float)v[2] - (float)v[1]);
        truth += q->part < RX_OUTSKIRT_RADII ? t[q->part] : (double)((float)t[2] - (float)t[1]);
    }
    for (long i = 0; i < n; i++)
        work[i] *= (double)n / truth;
    *dst = rx_mean_estimate(n, work, LEVEL);
    free(work);
    return RX_OK;
}

static double cut_of(const rx_pr *pr, double precision)
{
    const rx_pr_point *point = rx_pr_cut(pr, precision);
    return point != NULL ? point->score : HUGE_VAL;
}

/* All quantities of a run on a scene; all: the curve of both lists, of nall objects. */
static rx_status measure_run(const rx_lab_group *g, uint64_t seed, const rx_list *list, int run,
                             const rx_pr *all, long nall, rx_error *err)
{
    const rx_lab *lab = g->lab;
    const rx_lab_table *table = rx_lab_set_of(lab, list->condition, list->first)->table;
    const rx_lab_table *own = &table[rx_detection_table(lab->scene[list->first].id)];
    const double mpixels = rx_lab_sum(&table[RX_DETECTION_TILE], RX_TILE_MPIXELS),
                 fwhm = lab->sky[list->condition].fwhm;
    rx_pr pr = {0};
    long objects = 0;
    rx_status status = rx_list_curve(list, run, &objects, &pr, err);
    for (int k = 0; k < g->nquantities && status == RX_OK; k++) {
        const rx_quantity *q = &g->quantity[k];
        rx_estimate *dst = &rx_lab_group_at(g, k, list->condition, run)->value;
        const int of_all = q->cut == LAST ? lab->nprecisions - 1 : 0;
        const double cut = lab->nprecisions == 0 || q->cut == WHOLE ? -HUGE_VAL
                           : q->cut >= 0                            ? cut_of(&pr, lab->precision[q->cut])
                           : nall == 0                              ? -HUGE_VAL
                                                                    : cut_of(all, lab->precision[of_all]);
        const long found = rx_list_found(list, run, cut);
        switch ((statistic)q->statistic) {
        case AP:
            status =
                rx_pr_interval(&pr, objects, LEVEL, (rx_resampling){.seed = seed, .nthreads = 1}, dst, err);
            break;
        case SHARE:
            *dst = rx_list_share(list, run, cut, q->part, q->low, q->high);
            break;
        case PRECISION:
            *dst = rx_binomial_interval(
                found, found + rx_list_wrong(list, run, cut, RX_WRONG_DISTANCE, -HUGE_VAL, HUGE_VAL), LEVEL);
            break;
        case WRONG:
            *dst = rx_poisson_rate(rx_list_wrong(list, run, cut, RX_WRONG_DISTANCE, q->low, q->high),
                                   isinf(q->high) ? mpixels
                                                  : 1e-6 * M_PI * fwhm * fwhm * (double)own->n *
                                                        (q->high * q->high - q->low * q->low),
                                   LEVEL);
            break;
        case WORST:
            *dst = worst(own, run, q->part);
            break;
        case STACKED:
            status = stacked(own, run, q, dst, err);
        }
    }
    rx_pr_free(&pr);
    return status;
}

/* The column of RL at its best; `chosen`: the setting of the highest ap over the condition's lists. */
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

static rx_status measure_condition(rx_lab_group *groups, uint64_t seed, int condition, rx_error *err)
{
    const rx_lab *lab = groups->lab;
    double highest = -1;
    int chosen = -1;
    rx_status status = RX_OK;
    for (int k = 0; k < lab->nruns && status == RX_OK; k++) {
        const rx_list both = rx_list_of_all(lab, condition);
        rx_pr pr = {0};
        long objects = 0;
        status = rx_list_curve(&both, k, &objects, &pr, err);
        const double ap = objects > 0 ? pr.ap.value : NAN;
        if (lab->run[k].tuned && (chosen < 0 || ap > highest)) {
            chosen = k;
            highest = ap;
        }
        for (int g = 0; g < lab->nscenes && status == RX_OK; g++) {
            const rx_list list = rx_list_of(lab, condition, g);
            status = measure_run(&groups[g], seed, &list, k, &pr, objects, err);
        }
        rx_pr_free(&pr);
    }
    for (int g = 0; g < lab->nscenes && status == RX_OK && chosen >= 0; g++)
        fill_best(&groups[g], condition, chosen);
    return status;
}

static rx_status open_group(rx_lab_group *g, const rx_lab *lab, int scene, rx_error *err)
{
    *g = (rx_lab_group){.name = rx_scene_name(lab->scene[scene].id), .axis = "FWHM of the PSF (pixels)"};
    name_quantities(lab, lab->scene[scene].id, g);
    for (int k = 0; k < lab->nruns; k++) {
        g->hidden[k] = lab->run[k].tuned;
        if (lab->run[k].tuned) {
            g->ncolumns = 1;
            g->column[lab->nruns] = "RL";
        }
    }
    RX_TRY(rx_lab_group_open(g, lab, lab->nconditions, err));
    for (int c = 0; c < lab->nconditions; c++) {
        rx_lab_condition_name(lab, c, g->condition[c], sizeof *g->condition);
        g->place[c] = rx_condition_true(&lab->sky[c].condition) ? lab->sky[c].fwhm : NAN;
    }
    return RX_OK;
}

/* --- page --- */

const char rx_detection_reading[] = "Shares have Clopper-Pearson intervals, counts Poisson ones, ap "
                                    "bootstrap and flux ratios t intervals, of "
                                    "objects taken as independent; PLATEAU: the interval holds all tiles. "
                                    "<b>MATCHED</b> is the unrestored image "
                                    "with a Gaussian of the PSF's width as its detection filter, NONE the "
                                    "same with FILTER_NAME. <b>RL</b> is "
                                    "Richardson-Lucy at its best: for ap, the recalls and PAIRS the setting "
                                    "of the highest value, each for itself "
                                    "and chosen on the tiles of the test, in its favour; for everything else "
                                    "that of the highest ap over STARS and "
                                    "GALAXIES together (rows.ecsv has each). <b>Thresholds</b>: recall at a "
                                    "precision is at the lowest score with "
                                    "that precision on the scene itself; PAIRS, BLANK and RINGS use those of "
                                    "STARS and GALAXIES together. Figures: "
                                    "where restorers are given the truth.";

void rx_detection_name_set(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96])
{
    snprintf(names[0], sizeof *names, "%s", rx_scene_name(lab->scene[unit->scene].id));
    rx_lab_condition_name(lab, unit->condition, names[1], sizeof *names);
}

rx_status rx_detection_report(const rx_lab *lab, rx_lab_page *page, rx_error *err)
{
    rx_lab_group *groups = NULL;
    RX_TRY(RX_MAKE(groups, (size_t)lab->nscenes, err));
    rx_status status = RX_OK;
    for (int g = 0; g < lab->nscenes && status == RX_OK; g++)
        status = open_group(&groups[g], lab, g, err);
    for (int c = 0; c < lab->nconditions && status == RX_OK; c++)
        status = measure_condition(groups, page->seed, c, err);
    for (int k = 0; k < RX_SCENE_IDS * lab->nscenes && status == RX_OK; k++) { /* in the order of their ids */
        const rx_scene_id id = lab->scene[k % lab->nscenes].id;
        const rx_lab_group *g = &groups[k % lab->nscenes];
        if ((int)id == k / lab->nscenes)
            rx_lab_group_show(page, g, g->name, g->name, rx_scene_is_list(id) ? OPEN : 0, OPEN,
                              rx_scene_about(id));
    }
    for (int g = 0; g < lab->nscenes; g++)
        rx_lab_group_free(&groups[g]);
    free(groups);
    return status;
}
