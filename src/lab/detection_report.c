/* What a detection campaign has found, and its report. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/detection.h"
#include "lab/findings.h"
#include "report/curves.h"

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

static void name_quantities(const rx_lab *lab, rx_scene_id scene, rx_store_group *g)
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

/* Mean of the measured over the mean of the true flux, bootstrap over galaxies. */
static rx_status stacked(const rx_lab_table *growth, int run, const rx_quantity *q, uint64_t seed,
                         rx_estimate *dst, rx_error *err)
{
    double truth = 0, *work = RX_NEW(double, 2 * (size_t)growth->n + 1);
    long n = 0;
    *dst = (rx_estimate){NAN, NAN, NAN, 0};
    if (work == NULL)
        return rx_error_memory(err, 2 * (size_t)growth->n * sizeof *work);
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
    const rx_status status =
        n > 0 ? rx_paired_bootstrap(n, work, work + growth->n, LEVEL, seed, dst, err) : RX_OK;
    free(work);
    return status;
}

static double cut_of(const rx_pr *pr, double precision)
{
    const rx_pr_point *point = rx_pr_cut(pr, precision);
    return point != NULL ? point->score : HUGE_VAL;
}

/* All quantities of a run; all: the curve of both lists, of nall objects. */
static rx_status measure_run(rx_store *s, const rx_list *list, int run, const rx_pr *all, long nall,
                             rx_error *err)
{
    const rx_lab *lab = s->lab;
    const int scene = list->first;
    const rx_lab_table *table = rx_lab_set_of(lab, list->condition, scene)->table;
    const rx_lab_table *own = &table[rx_detection_table(lab->scene[scene].id)];
    const double mpixels = rx_lab_sum(&table[RX_DETECTION_TILE], RX_TILE_MPIXELS),
                 fwhm = lab->sky[list->condition].fwhm;
    rx_pr pr = {0};
    long objects = 0;
    rx_status status = rx_list_curve(list, run, &objects, &pr, err);
    for (int k = 0; k < s->group[scene].nquantities && status == RX_OK; k++) {
        const rx_quantity *q = &s->group[scene].quantity[k];
        rx_estimate *dst = &rx_store_at(s, scene, k, list->condition, run)->value;
        const int of_all = q->cut == LAST ? lab->nprecisions - 1 : 0;
        const double cut = lab->nprecisions == 0 || q->cut == WHOLE ? -HUGE_VAL
                           : q->cut >= 0                            ? cut_of(&pr, lab->precision[q->cut])
                           : nall == 0                              ? -HUGE_VAL
                                                                    : cut_of(all, lab->precision[of_all]);
        const long found = rx_list_found(list, run, cut);
        switch ((statistic)q->statistic) {
        case AP:
            status = rx_pr_interval(&pr, objects, LEVEL, (rx_resampling){.seed = s->seed, .nthreads = 1}, dst,
                                    err);
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
            status = stacked(own, run, q, s->seed, dst, err);
        }
    }
    rx_pr_free(&pr);
    return status;
}

/* The column of RL at its best; `chosen`: the setting of the highest ap over the condition's lists. */
static void fill_best(rx_store *s, int condition, int chosen)
{
    for (int g = 0; g < s->ngroups; g++)
        for (int q = 0; q < s->group[g].nquantities; q++) {
            int from = chosen;
            for (int k = 0; k < s->lab->nruns && s->group[g].quantity[q].best; k++)
                if (s->lab->run[k].tuned && rx_store_at(s, g, q, condition, k)->value.value >
                                                rx_store_at(s, g, q, condition, from)->value.value)
                    from = k;
            rx_finding *best = rx_store_at(s, g, q, condition, s->lab->nruns);
            best->value = rx_store_at(s, g, q, condition, from)->value;
            best->setting = s->lab->run[from].name;
        }
}

/* Objects that only one of a pair has found on a list; RL at its best: with the setting for the recall there. */
static rx_status contest(rx_store *s, const rx_list *list, int pair, rx_error *err)
{
    int run[2];
    double cut[2] = {0};
    long only[2], objects;
    for (int i = 0; i < 2; i++) {
        const int column = s->pair[pair][i];
        rx_pr pr = {0};
        run[i] = column < s->lab->nruns
                     ? column
                     : rx_store_column(s, rx_store_at(s, list->first, 1, list->condition, column)->setting);
        RX_TRY(rx_list_curve(list, run[i], &objects, &pr, err));
        cut[i] = cut_of(&pr, s->lab->precision[0]);
        rx_pr_free(&pr);
    }
    rx_list_compare(list, run, cut, only);
    *rx_contest_of(s, list->first, pair, 0, list->condition) = rx_contest_found(only[0], only[1]);
    return RX_OK;
}

static rx_status measure_condition(rx_store *s, int condition, rx_error *err)
{
    const rx_lab *lab = s->lab;
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
        for (int g = 0; g < s->ngroups && status == RX_OK; g++) {
            const rx_list list = rx_list_of(lab, condition, g);
            status = measure_run(s, &list, k, &pr, objects, err);
        }
        rx_pr_free(&pr);
    }
    if (status == RX_OK && s->ncolumns > lab->nruns)
        fill_best(s, condition, chosen);
    for (int g = 0; g < s->ngroups; g++)
        for (int p = 0; p < s->npairs && status == RX_OK; p++)
            if (lab->nprecisions > 0 && rx_scene_is_list(lab->scene[g].id)) {
                const rx_list list = rx_list_of(lab, condition, g);
                status = contest(s, &list, p, err);
            }
    return status;
}

static rx_status measure(rx_store *s, rx_error *err)
{
    const rx_lab *lab = s->lab;
    RX_TRY(rx_store_groups(s, lab->nscenes, err));
    for (int k = 0; k < lab->nruns; k++) {
        s->hidden[k] = lab->run[k].tuned;
        if (lab->run[k].tuned)
            s->ncolumns = lab->nruns + 1;
    }
    if (s->ncolumns > lab->nruns)
        s->column[lab->nruns] = "RL";
    const int net = rx_store_column(s, "NET"), best = rx_store_column(s, "RL"), hero = net >= 0 ? net : best;
    rx_store_add_pair(s, hero, rx_store_column(s, "NONE"));
    rx_store_add_pair(s, hero, rx_store_column(s, "MATCHED"));
    rx_store_add_pair(s, hero, best);
    s->about[s->nabouts++] = (rx_about){"found at the first precision", "McNemar", 0, 0};
    rx_status status = RX_OK;
    for (int g = 0; g < s->ngroups && status == RX_OK; g++) {
        s->group[g].name = rx_scene_name(lab->scene[g].id);
        name_quantities(lab, lab->scene[g].id, &s->group[g]);
        status = rx_group_open(s, g, lab->nconditions, err);
        for (int c = 0; c < lab->nconditions && status == RX_OK; c++)
            rx_lab_condition_name(lab, c, s->group[g].condition[c], sizeof *s->group[g].condition);
    }
    for (int c = 0; c < lab->nconditions && status == RX_OK; c++)
        status = measure_condition(s, c, err);
    return status;
}

/* --- goals --- */

/* Where restorers are given the truth. */
static int counts(const rx_store *s, int condition, int g, rx_scene_id kind)
{
    return rx_condition_true(&s->lab->sky[condition].condition) && s->lab->scene[g].id == kind;
}

/* ap and the recall at the first precision of both lists, of one pair. */
static int above(const rx_store *s, int pair, rx_claim_verdict *v)
{
    static const char *const names[] = {"ap", "recall"};
    int wins = 0, all = 0, sure = 0, fights = 0;
    rx_text lost = {0};
    for (int c = 0; c < s->lab->nconditions; c++)
        for (int g = 0; g < s->ngroups; g++) {
            if (!counts(s, c, g, RX_SCENE_STARS) && !counts(s, c, g, RX_SCENE_GALAXIES))
                continue;
            for (int q = 0; q < 1 + (s->lab->nprecisions > 0); q++) {
                const double own = rx_store_at(s, g, q, c, s->pair[pair][0])->value.value;
                const double other = rx_store_at(s, g, q, c, s->pair[pair][1])->value.value;
                all++;
                wins += own > other;
                if (!(own > other))
                    rx_text_printf(&lost, "%s%s of %s at FWHM %g (%.3f against %.3f)",
                                   lost.length > 0 ? ", " : "", names[q], s->group[g].name,
                                   s->lab->sky[c].fwhm, own, other);
            }
            const rx_contest *contest = rx_contest_of(s, g, pair, 0, c);
            fights++;
            sure += contest->only_first > contest->only_second && contest->test.p < 0.05;
        }
    rx_text_printf(
        &v->said,
        "NET against %s: above in %d of %d numbers; more objects found, McNemar's p below 0.05, in %d of %d "
        "lists",
        s->column[s->pair[pair][1]], wins, all, sure, fights);
    if (lost.length > 0)
        rx_text_printf(&v->said, "; not above: %s", lost.data);
    rx_text_add(&v->said, ". ");
    v->said.failed |= lost.failed;
    rx_text_free(&lost);
    return all > 0 ? wins == all : -1;
}

static void judge_lists(const rx_store *s, rx_claim_verdict *v)
{
    int holds = 1, judged = 0;
    for (int pair = 0; pair < s->npairs; pair++) {
        const int one = above(s, pair, v);
        judged |= one >= 0;
        holds = holds && one != 0;
    }
    if (judged)
        v->state = rx_claim_state_of(holds);
}

/* Numbers of NET on one scene, every seeing: pairs against the better one of the unrestored images, or phases. */
static void judge_scene(const rx_store *s, rx_claim_verdict *v)
{
    const int net = rx_store_column(s, "NET"), pairs = v->claim == RX_CLAIM_PAIRS;
    const double limit = 0.01;
    int holds = 1, judged = 0;
    for (int c = 0; c < s->lab->nconditions; c++)
        for (int g = 0; g < s->ngroups; g++) {
            if (!counts(s, c, g, pairs ? RX_SCENE_PAIRS : RX_SCENE_PLATEAU))
                continue;
            const double
                own = rx_store_at(s, g, 0, c, net)->value.value,
                other = pairs ? fmax(rx_store_value(s, g, "resolved", c, rx_store_column(s, "MATCHED")).value,
                                     rx_store_value(s, g, "resolved", c, rx_store_column(s, "NONE")).value)
                              : rx_store_at(s, g, 1, c, net)->value.value;
            judged = 1;
            holds = holds && (pairs ? own > 0 && own >= 2 * other : own < limit && other < limit);
            rx_text_printf(&v->said,
                           pairs ? "FWHM %g: %.3f against %.3f. " : "FWHM %g: %.2g (2 x 2), %.2g (4 x 4). ",
                           s->lab->sky[c].fwhm, own, other);
        }
    if (judged)
        v->state = rx_claim_state_of(holds);
}

/* --- page --- */

static const char READING[] =
    "Shares have Clopper-Pearson intervals, counts Poisson ones, ap and flux ratios bootstrap intervals, of "
    "objects taken "
    "as independent; PLATEAU: the interval holds all tiles. <b>MATCHED</b> is the unrestored image with a "
    "Gaussian of the "
    "PSF's width as its detection filter, NONE the same with FILTER_NAME. <b>RL</b> is Richardson-Lucy at "
    "its best: for "
    "ap, the recalls and PAIRS the setting of the highest value, each for itself and chosen on the tiles of "
    "the test, in "
    "its favour; for everything else that of the highest ap over STARS and GALAXIES together (cells.ecsv has "
    "each). "
    "<b>Thresholds</b>: recall at a precision is at the lowest score with that precision on the scene "
    "itself; PAIRS, "
    "BLANK and RINGS use those of STARS and GALAXIES together; contests are at the first precision.";

/* ap and recall over the seeing, where restorers are given the truth. */
static void plot(rx_figures *dst, const rx_store *s, int g, int q)
{
    const rx_quantity *quantity = &s->group[g].quantity[q];
    rx_axes axes = {"FWHM of the PSF (pixels)", quantity->name, HUGE_VAL, 0, 0, 1.02, false, false};
    rx_curves curves = {0};
    char id[RX_FIGURE_ID];
    for (int k = 0; k < s->ncolumns; k++) {
        if (s->hidden[k])
            continue;
        rx_curves_add(&curves, RX_CURVE_BARS, rx_method_color(s->column[k]), s->column[k]);
        for (int c = 0; c < s->lab->nconditions; c++) {
            const rx_estimate *e = &rx_store_at(s, g, q, c, k)->value;
            const double x = s->lab->sky[c].fwhm + 0.03 * (curves.n - 1);
            if (!rx_condition_true(&s->lab->sky[c].condition))
                continue;
            rx_curves_put(&curves, x, e->value, e->low, e->high);
            axes.x0 = fmin(axes.x0, x - 0.5);
            axes.x1 = fmax(axes.x1, x + 0.5);
        }
    }
    snprintf(id, sizeof id, "%s-%d", s->group[g].name, q);
    rx_curves_figure(dst, id, quantity->name, quantity->help, &axes, &curves);
}

static rx_status page(const rx_store *s, rx_findings *f, rx_error *err)
{
    (void)err;
    for (int k = 0; k < RX_SCENE_IDS * s->ngroups; k++) { /* the scenes in the order of their ids */
        const int g = k % s->ngroups, list = rx_scene_is_list(s->lab->scene[g].id);
        const char *name = s->group[g].name;
        if ((int)s->lab->scene[g].id != k / s->ngroups)
            continue;
        for (int q = 0; q < OPEN && list; q++)
            plot(rx_report_figures_of(f->report), s, g, q);
        rx_findings_section(f, name, name, list ? name : NULL);
        rx_report_paragraph(f->report, rx_scene_about(s->lab->scene[g].id));
        rx_findings_quantities(f, s, g, OPEN);
        if (list && s->lab->nprecisions > 0)
            rx_findings_contests(f, s, g, "objects");
    }
    return RX_OK;
}

static const rx_claim_judge JUDGES[] = {{RX_CLAIM_LISTS, 0, judge_lists, {"NET"}},
                                        {RX_CLAIM_PAIRS, 0, judge_scene, {"NET", "NONE"}},
                                        {RX_CLAIM_PLATEAU, 0, judge_scene, {"NET"}}};

const rx_lab_results rx_detection_results = {measure, NULL, sizeof JUDGES / sizeof *JUDGES,
                                             JUDGES,  page, READING};
