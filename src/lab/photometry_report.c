/* What a photometry campaign has found, and its report. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "lab/findings.h"
#include "lab/photometry.h"
#include "quality/completeness.h"
#include "quality/evaluate.h"
#include "report/curves.h"

static const double LEVEL = 0.95;
static const double LOW_SNR = 10;

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
enum { WHOLE = -1 };

typedef enum star_value { ERROR_PERCENT, ERROR_CLEAN, SIGNED_PERCENT, SIGNED_MAG, PULL } star_value;

/* After those at equal precision. The first of these lies open with them. */
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

/* Of the values of the stars found; work [2 stars]. */
static rx_status measure_values(const rx_lab_table *star, int run, const rx_quantity *q, uint64_t seed,
                                double *work, rx_estimate *dst, rx_error *err)
{
    rx_estimate unused;
    long n = 0;
    for (long i = 0; i < star->n; i++) {
        const double *v = rx_lab_each(star, i, run);
        work[n] = isnan(v[RX_STAR_SCORE]) ? NAN : value_of(v, (star_value)q->part);
        n += isfinite(work[n]) != 0;
    }
    *dst = (rx_estimate){NAN, NAN, NAN, 0};
    if (q->statistic != MEAN)
        rx_robust_estimates(work, n, LEVEL, q->statistic == MEDIAN ? dst : &unused,
                            q->statistic == MEDIAN ? &unused : dst);
    else if (n > 0) {
        double *zero = memset(work + star->n, 0, (size_t)star->n * sizeof *work);
        return rx_paired_bootstrap(n, work, zero, LEVEL, seed, dst, err);
    }
    return RX_OK;
}

static rx_status measure_set(rx_store *s, int f, int k, int run, double *work, rx_error *err)
{
    const rx_lab_table *star = stars_of(s->lab, f, k);
    const rx_list list = rx_list_of(s->lab, f, k);
    const long found = rx_list_found(&list, run, -INFINITY),
               wrong = rx_list_wrong(&list, run, -INFINITY, -1, 0, 0);
    long objects, crowded = 0;
    rx_pr pr = {0};
    rx_status status = rx_interrupt_check(err);
    if (status == RX_OK)
        status = rx_list_curve(&list, run, &objects, &pr, err);
    for (long i = 0; i < star->n; i++)
        crowded += !isnan(rx_lab_each(star, i, run)[RX_STAR_SCORE]) &&
                   rx_lab_each(star, i, run)[RX_STAR_CROWDED] > 0;
    for (int i = 0; i < s->group[f].nquantities && status == RX_OK; i++) {
        const rx_quantity *q = &s->group[f].quantity[i];
        rx_estimate *dst = &rx_store_at(s, f, i, k, run)->value;
        switch ((statistic)q->statistic) {
        case RECALL:
            *dst = rx_list_share(&list, run, rx_photometry_cut_of(s, f, run, q->cut)->score, -1, 0, 0);
            break;
        case PRECISION:
            *dst = rx_binomial_interval(found, found + wrong, LEVEL);
            break;
        case AP:
            status = rx_pr_interval(&pr, star->n, LEVEL, (rx_resampling){.seed = s->seed, .nthreads = 1}, dst,
                                    err);
            break;
        case CROWDED:
            *dst = rx_binomial_interval(crowded, found, LEVEL);
            break;
        default:
            status = measure_values(star, run, q, s->seed, work, dst, err);
        }
    }
    rx_pr_free(&pr);
    return status;
}

/* --- thresholds of a field --- */

rx_photometry_cut *rx_photometry_cut_of(const rx_store *s, int field, int run, int precision)
{
    const size_t n = (size_t)s->lab->nprecisions + 1;
    return (rx_photometry_cut *)s->own[0] + ((size_t)field * (size_t)s->lab->nruns + (size_t)run) * n +
           (size_t)(precision + 1);
}

/* Magnitudes of 50 and 90 % completeness for stars found at the cut. The bin goes from half a step above the brightest
 * set to half a step below the faintest, completeness only asks for its range; sets go from bright to faint in equal
 * steps. */
static rx_status depth(const rx_lab *lab, int f, int run, double *mag, rx_photometry_cut *cut, rx_error *err,
                       rx_resampling by)
{
    const int last = lab->nscenes - 1;
    const double step = last > 0 ? lab->scene[1].mag - lab->scene[0].mag : 1;
    rx_bins bins = {.n = 1, .edge = {0, 1}};
    long n = 0, all = 1;
    for (int k = 0; k <= last; k++)
        all += stars_of(lab, f, k)->n;
    unsigned char *found = NULL;
    RX_TRY(RX_MAKE(found, (size_t)all, err));
    if (last >= 0) {
        bins.edge[0] = lab->scene[0].mag - 0.5 * step;
        bins.edge[1] = lab->scene[0].mag + (last + 0.5) * step;
    }
    for (int k = 0; k <= last; k++)
        for (long i = 0; i < stars_of(lab, f, k)->n; i++) {
            found[n] = rx_lab_each(stars_of(lab, f, k), i, run)[RX_STAR_SCORE] >= cut->score;
            mag[n++] = lab->scene[k].mag;
        }
    rx_status status = rx_completeness(&bins, &(rx_found){n, mag, found}, 0.5, LEVEL, by, &cut->mag50, err);
    if (status == RX_OK)
        status = rx_completeness(&bins, &(rx_found){n, mag, found}, 0.9, LEVEL, by, &cut->mag90, err);
    free(found);
    return status;
}

/* The whole list, and the lowest score at which precision is at least each of those named. */
static rx_status choose_cuts(rx_store *s, int f, int run, double *work, rx_error *err)
{
    const rx_lab *lab = s->lab;
    const rx_list list = rx_list_of_all(lab, f);
    const rx_estimate none = {NAN, NAN, NAN, 0};
    long stars = 0, found = 0, wrong = 0;
    double mpixels = 0;
    rx_pr pr = {0};
    rx_status status = rx_list_curve(&list, run, &stars, &pr, err);
    for (int k = 0; k < lab->nscenes; k++) {
        const rx_list one = rx_list_of(lab, f, k);
        found += rx_list_found(&one, run, -INFINITY);
        wrong += rx_list_wrong(&one, run, -INFINITY, -1, 0, 0);
        mpixels += mpixels_of(lab, f, k);
    }
    for (int p = -1; p < lab->nprecisions && status == RX_OK; p++) {
        rx_photometry_cut *cut = rx_photometry_cut_of(s, f, run, p);
        const rx_pr_point *point = p < 0 ? NULL : rx_pr_cut(&pr, lab->precision[p]);
        *cut = (rx_photometry_cut){.score = INFINITY, .precision = none, .false_per_mpixel = none};
        cut->recall = rx_binomial_interval(point != NULL ? point->matched : p < 0 ? found : 0, stars, LEVEL);
        if (p < 0) {
            cut->score = -INFINITY;
            cut->whole_list = 1;
            cut->precision = rx_binomial_interval(found, found + wrong, LEVEL);
            cut->false_per_mpixel = rx_poisson_rate(wrong, mpixels, LEVEL);
        } else if (point != NULL) {
            cut->score = point->score;
            cut->whole_list = point == &pr.point[pr.n - 1];
            cut->precision = rx_binomial_interval(point->matched, point->detections, LEVEL);
        }
        status = depth(lab, f, run, work, cut, err, (rx_resampling){.seed = s->seed, .nthreads = 1});
    }
    rx_pr_free(&pr);
    return status;
}

/* --- contests --- */

static rx_status compare(rx_store *s, int f, int k, int pair, double *work, rx_error *err)
{
    const rx_list list = rx_list_of(s->lab, f, k);
    const rx_lab_table *star = stars_of(s->lab, f, k);
    const int *run = s->pair[pair], np = s->lab->nprecisions;
    double *a = work, *b = work + star->n;
    long n = 0, only[2];
    for (int p = -1; p < np; p++) {
        rx_list_compare(&list, run,
                        (double[]){rx_photometry_cut_of(s, f, run[0], p)->score,
                                   rx_photometry_cut_of(s, f, run[1], p)->score},
                        only);
        *rx_contest_of(s, f, pair, p + 1, k) = rx_contest_found(only[0], only[1]);
    }
    for (long i = 0; i < star->n; i++) {
        a[n] = value_of(rx_lab_each(star, i, run[0]), ERROR_PERCENT);
        b[n] = value_of(rx_lab_each(star, i, run[1]), ERROR_PERCENT);
        n += isfinite(a[n]) && isfinite(b[n]);
    }
    return rx_contest_paired(n, a, b, rx_contest_of(s, f, pair, np + 1, k),
                             rx_contest_of(s, f, pair, np + 2, k), err);
}

static rx_status measure_field(rx_store *s, int f, rx_error *err)
{
    const rx_lab *lab = s->lab;
    rx_store_group *g = &s->group[f];
    size_t most = 1;
    g->name = lab->sky[f].name;
    for (int p = 0; p < lab->nprecisions; p++) {
        rx_quantity *q = &g->quantity[g->nquantities++];
        *q = (rx_quantity){"", "", 3, RECALL, 0, p, 0, 0, 0, ""};
        snprintf(q->name, sizeof q->name, "recall_p%g", lab->precision[p]);
        snprintf(q->help, sizeof q->help, "share of the stars found at precision %g", lab->precision[p]);
    }
    memcpy(&g->quantity[g->nquantities], QUANTITIES, sizeof QUANTITIES);
    g->nquantities += (int)(sizeof QUANTITIES / sizeof *QUANTITIES);
    RX_TRY(rx_group_open(s, f, lab->nscenes, err));
    for (int k = 0; k < lab->nscenes; k++) {
        snprintf(g->condition[k], sizeof *g->condition, "%g", lab->scene[k].mag);
        most += 2 * (size_t)stars_of(lab, f, k)->n;
    }
    double *work = NULL;
    rx_status status = RX_MAKE(work, most, err);
    for (int run = 0; run < lab->nruns && status == RX_OK; run++)
        status = choose_cuts(s, f, run, work, err);
    for (int k = 0; k < lab->nscenes; k++) {
        for (int run = 0; run < lab->nruns && status == RX_OK; run++)
            status = measure_set(s, f, k, run, work, err);
        for (int pair = 0; pair < s->npairs && status == RX_OK; pair++)
            status = compare(s, f, k, pair, work, err);
    }
    free(work);
    return status;
}

static rx_status measure(rx_store *s, rx_error *err)
{
    const rx_lab *lab = s->lab;
    const size_t cuts = (size_t)lab->nconditions * (size_t)lab->nruns * ((size_t)lab->nprecisions + 1);
    RX_TRY(rx_store_groups(s, lab->nconditions, err));
    for (int i = 0; i < lab->nruns; i++)
        for (int j = 0; j < i; j++)
            rx_store_add_pair(s, i, j);
    s->about[s->nabouts++] = (rx_about){"found", "McNemar", 1, 1};
    for (int p = 0; p < lab->nprecisions; p++) {
        s->about[s->nabouts] = (rx_about){"", "McNemar", 1, 1};
        snprintf(s->about[s->nabouts++].quantity, sizeof s->about->quantity, "found at precision %g",
                 lab->precision[p]);
    }
    s->about[s->nabouts++] = (rx_about){"100 |F - F0| / F0", "paired t", 1, -1};
    s->about[s->nabouts++] = (rx_about){"100 |F - F0| / F0", "Wilcoxon", 1, 0};
    s->own[0] = RX_NEW(rx_photometry_cut, cuts);
    rx_status status = s->own[0] == NULL ? rx_error_memory(err, cuts * sizeof(rx_photometry_cut)) : RX_OK;
    for (int f = 0; f < lab->nconditions && status == RX_OK; f++)
        status = measure_field(s, f, err);
    return status;
}

/* --- claims --- */

static int is_true(const rx_store *s, int field)
{
    return rx_condition_true(&s->lab->sky[field].condition);
}

static int is_judged(const rx_store *s, int field, int k, int low)
{
    return is_true(s, field) && (!low || snr_of(s->lab, field, k) < LOW_SNR);
}

/* a beats b at some magnitude and loses at none (low: of those of low S/N), on every field whose restorers are given the
 * truth, and at every precision; or its errors do. */
static int beats(const rx_store *s, int a, int b, int errors, int low, rx_text *said)
{
    const int np = s->lab->nprecisions, first = errors ? np + 1 : 1;
    const rx_contest_place place = {-1, first, errors ? first : np, is_judged, low};
    return rx_contests_won(s, &place, a, b, 0, said) > 0;
}

/* NET against NONE and against every other restorer; RESTORED_BETTER: every one against NONE. */
static void judge_pairs(const rx_store *s, rx_claim_verdict *v)
{
    const int net = rx_store_column(s, "NET"), none = rx_store_column(s, "NONE"),
              every = v->claim == RX_CLAIM_RESTORED_BETTER, errors = v->claim == RX_CLAIM_ACCURACY;
    int holds = 1, rivals = 0;
    for (int run = 0; run < s->lab->nruns; run++) {
        const int a = every ? run : net, b = every ? none : run;
        if (a == b || (errors && b != none) || s->lab->run[run].templates) /* the same list */
            continue;
        rivals++;
        holds &= beats(s, a, b, errors, v->claim == RX_CLAIM_LOW_SNR, &v->said);
    }
    if (rivals > 0)
        v->state = rx_claim_state_of(holds);
}

/* MagErr against RL, bias and scatter against the unrestored image; what fails is said. */
static void judge_fluxes(const rx_store *s, rx_claim_verdict *v)
{
    const double sure_snr = 12, most_bias = 1, most_scatter = 1.5;
    const int net = rx_store_column(s, "NET"), none = rx_store_column(s, "NONE"),
              rl = rx_store_column(s, "RL");
    int held = 0, all = 0;
    for (int i = 0; i < s->ngroups * s->lab->nscenes; i++) {
        const int f = i / s->lab->nscenes, k = i % s->lab->nscenes;
        const double magerr = rx_store_value(s, f, "magerr", k, net).value,
                     rl_magerr = rx_store_value(s, f, "magerr", k, rl).value,
                     bias = rx_store_value(s, f, "bias_percent", k, net).value,
                     scatter = rx_store_value(s, f, "scatter_percent", k, net).value /
                               rx_store_value(s, f, "scatter_percent", k, none).value;
        const int sure = snr_of(s->lab, f, k) > sure_snr,
                  holds =
                      !(magerr > rl_magerr) && (!sure || (fabs(bias) < most_bias && scatter <= most_scatter));
        if (!is_true(s, f))
            continue;
        all++;
        held += holds;
        if (!holds)
            rx_text_printf(&v->said,
                           "Field %s, magnitude %g: MagErr %.2f %% (RL %.2f %%), bias %.2f %%, scatter %.2f "
                           "times NONE's. ",
                           s->group[f].name, s->lab->scene[k].mag, magerr, rl_magerr, bias, scatter);
    }
    if (all > 0)
        v->state = rx_claim_state_of(held == all);
}

/* MagErr of a run less that of another one on the stars that all runs found, and the error of that. */
static double errs_more(const rx_lab *lab, const rx_lab_table *star, int run, int other, double *error,
                        double *magerr, long *n)
{
    double sum = 0, square = 0;
    *n = 0;
    *magerr = 0;
    for (long i = 0; i < star->n; i++) {
        int all = 1;
        for (int k = 0; k < lab->nruns; k++)
            all = all && isfinite(rx_lab_each(star, i, k)[RX_STAR_RATIO]);
        if (!all)
            continue;
        const double a = value_of(rx_lab_each(star, i, run), ERROR_PERCENT);
        const double d = a - value_of(rx_lab_each(star, i, other), ERROR_PERCENT);
        *magerr += a;
        sum += d;
        square += d * d;
        ++*n;
    }
    const double count = (double)*n, mean = sum / count;
    *magerr /= count;
    *error = sqrt(fmax(square / count - mean * mean, 0) / (count - 1));
    return mean;
}

/* Of every run with templates against every other one, magnitude by magnitude; what is lost is said. */
static void judge_templates(const rx_store *s, rx_claim_verdict *v)
{
    const rx_lab *lab = s->lab;
    int held = 0, all = 0;
    for (int i = 0; i < lab->nruns * lab->nconditions * lab->nscenes; i++) {
        const int k = i % lab->nscenes, f = i / lab->nscenes % lab->nconditions,
                  run = i / lab->nscenes / lab->nconditions;
        int holds = 1;
        if (!lab->run[run].templates || !is_true(s, f))
            continue;
        for (int other = 0; other < lab->nruns; other++) {
            double error, magerr;
            long n;
            if (lab->run[other].templates)
                continue;
            const double more = errs_more(lab, stars_of(lab, f, k), run, other, &error, &magerr, &n);
            if (n < 2 || !(more > 1.96 * error))
                continue;
            holds = 0;
            rx_text_printf(&v->said, "Field %s, magnitude %g: %s %.2f %%, %s %.2f %%. ", s->group[f].name,
                           lab->scene[k].mag, lab->run[run].name, magerr, lab->run[other].name,
                           magerr - more);
        }
        all++;
        held += holds;
    }
    if (all > 0)
        v->state = rx_claim_state_of(held == all);
    if (all > 0)
        rx_text_printf(&v->said, "Held in %d of %d sets of stars. ", held, all);
    else
        rx_text_add(&v->said, "No run had the fluxes of template photometry. ");
}

static const rx_claim_judge JUDGES[] = {{RX_CLAIM_RESTORED_BETTER, 0, judge_pairs, {"NONE"}},
                                        {RX_CLAIM_NET_BEST, RX_CLAIM_ACCURACY, judge_pairs, {"NET"}},
                                        {RX_CLAIM_SPEED, 0, NULL, {NULL}},
                                        {RX_CLAIM_FLUXES, 0, judge_fluxes, {"NET", "RL", "NONE"}},
                                        {RX_CLAIM_TEMPLATES, 0, judge_templates, {NULL}}};

/* --- figures --- */

/* FIGURE_FIELDS: the first ones; the page of a long list of conditions stays readable. */
enum { CURVES = 6, POINTS_MAX = 250, FEW = 5, FIELDS_WITH_CURVES = 2, FIGURE_FIELDS = 12 };

/* One quantity over the magnitudes of a field; bias with its scatter as a band, everything else with its interval. */
static void plot(rx_figures *dst, const rx_store *s, int f, const char *quantity, const char *title,
                 const char *reading)
{
    const rx_lab *lab = s->lab;
    const int band = strcmp(quantity, "bias_mag") == 0, errors = strcmp(quantity, "magerr") == 0;
    const double step = lab->nscenes > 1 ? lab->scene[1].mag - lab->scene[0].mag : 1;
    const rx_axes axes = {.xlabel = "magnitude",
                          .ylabel = title,
                          .x0 = lab->scene[0].mag - 0.5 * step,
                          .x1 = lab->scene[lab->nscenes - 1].mag + 0.5 * step,
                          .y1 = band || errors ? 0 : 1.02,
                          .log_y = errors};
    rx_curves c = {0};
    char id[RX_FIGURE_ID];
    for (int run = 0; run < lab->nruns; run++) {
        rx_curves_add(&c, band ? RX_CURVE_BAND : RX_CURVE_BARS, rx_method_color(s->column[run]),
                      s->column[run]);
        for (int k = 0; k < lab->nscenes; k++) {
            const rx_estimate e = rx_store_value(s, f, quantity, k, run);
            const double scatter = rx_store_value(s, f, "scatter_mag", k, run).value,
                         x = lab->scene[k].mag + (band ? 0 : 0.06 * step * (run - 0.5 * (lab->nruns - 1)));
            rx_curves_put(&c, x, e.n < FEW ? NAN : e.value, band ? e.value - scatter : e.low,
                          band ? e.value + scatter : e.high);
        }
    }
    if (band)
        rx_curves_reference(&c, axes.x0, 0, axes.x1, 0);
    snprintf(id, sizeof id, "field%d-%s", f, quantity);
    rx_curves_figure(dst, id, title, reading, &axes, &c);
}

/* Precision over recall, thinned: first, last and POINTS_MAX between. */
static void plot_curve(rx_figures *dst, const rx_store *s, int f, int set)
{
    static const rx_axes axes = {"recall", "precision", 0, 1.02, 0, 1.02, false, false};
    const rx_list list = rx_list_of(s->lab, f, set);
    rx_curves c = {0};
    char id[RX_FIGURE_ID], title[96];
    for (int run = 0; run < s->lab->nruns; run++) {
        rx_pr pr = {0};
        long objects;
        c.failed |= rx_list_curve(&list, run, &objects, &pr, NULL) != RX_OK;
        rx_curves_add(&c, RX_CURVE_LINE, rx_method_color(s->column[run]), s->column[run]);
        for (long k = 0; k < pr.n; k++)
            if (k % (pr.n / POINTS_MAX + 1) == 0 || k + 1 == pr.n)
                rx_curves_put(&c, pr.point[k].recall, pr.point[k].precision, NAN, NAN);
        rx_pr_free(&pr);
    }
    snprintf(id, sizeof id, "curve%d-%d", f, set);
    snprintf(title, sizeof title, "Magnitude %g (S/N %.3g)", s->lab->scene[set].mag, snr_of(s->lab, f, set));
    rx_curves_figure(dst, id, title, "", &axes, &c);
}

static void plot_field(rx_figures *dst, const rx_store *s, int f)
{
    static const char *const plans[][3] = {
        {"magerr", "MagErr (%)",
         "Mean of 100 |F - F0| / F0 over the stars found, as the top of the paper's Figure 9."},
        {"bias_mag", "m - m0 (mag)",
         "Median, and as a band one sigma_MAD either side; faint stars are found when noise "
         "lifts them."},
        {"recall", "Recall, whole lists", "At the detection settings of the campaign, the same for all."},
        {"precision", "Precision, whole lists", "False detections of the tiles count at every magnitude."},
        {"ap", "Average precision", "Area under the steps of the precision-recall curve of each magnitude."},
    };
    const double nearly_all = 0.95;
    const int nsets = s->lab->nscenes;
    int lost = nsets;
    for (size_t i = 0; i < sizeof plans / sizeof *plans; i++)
        plot(dst, s, f, plans[i][0], plans[i][1], plans[i][2]);
    for (int p = 0; p < s->lab->nprecisions; p++) {
        char title[64];
        snprintf(title, sizeof title, "Completeness at precision %g", s->lab->precision[p]);
        plot(dst, s, f, s->group[f].quantity[p].name, title,
             "Each restorer at the threshold of that precision.");
    }
    /* as the paper's figure six magnitudes, around those where stars begin to be lost */
    for (int k = nsets - 1; k >= 0; k--)
        for (int run = 0; run < s->lab->nruns; run++)
            if (rx_store_value(s, f, "recall", k, run).value < nearly_all)
                lost = k;
    const int first = rx_max_int(rx_min_int(lost - 2, nsets - CURVES), 0);
    for (int k = first; k < nsets && k < first + CURVES && s->ngroups <= FIELDS_WITH_CURVES; k++)
        plot_curve(dst, s, f, k);
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

RX_COLUMNS(PR, RX_TEXT("scene", "field"), RX_TEXT("condition", "magnitude of the stars"),
           RX_TEXT("run", "restorer"), RX_NUMBER("score", 2, "", "S/N of the detection"),
           RX_NUMBER("recall", 4, "", "of the stars with this score or a higher one"),
           RX_NUMBER("precision", 4, "", "the same"));

enum { CURVE_POINTS = 200 };

/* Thresholds of a field; on the page without what its other tables have. */
static void add_cuts(rx_report *report, const rx_store *s, int f, rx_report_table *t)
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
    for (int p = -1; p < s->lab->nprecisions; p++)
        for (int run = 0; run < s->lab->nruns; run++) {
            const rx_photometry_cut *c = rx_photometry_cut_of(s, f, run, p);
            rx_report_put(t, s->group[f].name, s->column[run], p < 0 ? NAN : s->lab->precision[p], c->score,
                          c->whole_list, c->precision, c->recall, c->mag50, c->mag90, c->false_per_mpixel);
        }
    rx_report_show(report, t, &view);
}

static rx_status add_curves(const rx_store *s, int f, rx_report_table *t, rx_error *err)
{
    for (int i = 0; i < s->lab->nscenes * s->lab->nruns; i++) {
        const int k = i / s->lab->nruns, run = i % s->lab->nruns;
        const rx_list list = rx_list_of(s->lab, f, k);
        rx_pr pr = {0};
        long objects;
        RX_TRY(rx_list_curve(&list, run, &objects, &pr, err));
        for (long j = 0; j < pr.n; j++)
            if (j % (pr.n / CURVE_POINTS + 1) == 0 || j + 1 == pr.n)
                rx_report_put(t, s->group[f].name, s->group[f].condition[k], s->column[run],
                              pr.point[j].score, pr.point[j].recall, pr.point[j].precision);
        rx_pr_free(&pr);
    }
    return RX_OK;
}

static const char READING[] =
    "Stars of one magnitude at a time are put onto tiles with other objects and noise; every restorer "
    "restores the same "
    "tiles. A star is found when a detection lies on it; a false detection is neither a star nor any object "
    "known to be "
    "there, so precision depends on how many stars a tile holds, the same for all. On a real tile, what was "
    "found before "
    "the stars were added counts neither as right nor as false; all that is found on as many realisations of "
    "its noise "
    "without sources is false. <b>Equal precision</b>: each restorer gets the threshold at which its own "
    "precision has "
    "the value named; then completeness is compared. <b>MagErr</b> is a mean of absolute values, which hides "
    "the sign and "
    "weighs gross errors. It, bias, scatter and pull are of the stars that a restorer found: one that finds "
    "more has more "
    "of the difficult ones; only the contests compare the same stars. Intervals: Clopper-Pearson, order "
    "statistics, "
    "bootstrap; they take stars of one tile as independent, and thresholds as given.";

static void facts(const rx_store *s, rx_report *report)
{
    rx_report_fact_numbers(report, "precisions", s->lab->nprecisions, s->lab->precision);
}

static rx_status page(const rx_store *s, rx_findings *findings, rx_error *err)
{
    const rx_lab *lab = s->lab;
    rx_report *report = findings->report;
    rx_report_table *runs = RX_REPORT_TABLE(report, "runs", RUNS, RX_REPORT_IN_JSON),
                    *sets = RX_REPORT_TABLE(report, "sets", SETS, RX_REPORT_EVERYWHERE),
                    *cuts = RX_REPORT_TABLE(report, "cuts", CUTS, RX_REPORT_EVERYWHERE),
                    *curves = RX_REPORT_TABLE(report, "curves", PR, RX_REPORT_IN_FILE);
    for (int f = 0; f < s->ngroups; f++) {
        const long from = rx_report_rows(sets);
        char name[48];
        if (f < FIGURE_FIELDS && lab->nscenes > 0)
            plot_field(rx_report_figures_of(report), s, f);
        snprintf(name, sizeof name, "field%d", f);
        rx_findings_section(findings, name, s->group[f].name, name);
        snprintf(name, sizeof name, "curve%d-", f);
        rx_report_place(report, name);
        rx_report_sentence(report, lab->sky[f].about);
        add_cuts(report, s, f, cuts);
        for (int k = 0; k < lab->nscenes; k++)
            rx_report_put(sets, s->group[f].name, s->group[f].condition[k], lab->scene[k].mag,
                          snr_of(lab, f, k), rx_lab_set_of(lab, f, k)->table[RX_PHOTOMETRY_TILE].n,
                          stars_of(lab, f, k)->n, mpixels_of(lab, f, k), lab->sky[f].about);
        rx_findings_quantities(findings, s, f, lab->nprecisions + 1);
        rx_report_fold(report, "Tiles");
        rx_report_show(report, sets, RX_VIEW(.from = from));
        rx_report_unfold(report);
        rx_findings_contests(findings, s, f, "stars");
        RX_TRY(add_curves(s, f, curves, err));
    }
    rx_report_section(report, "runs", "Restorers");
    for (int run = 0; run < lab->nruns; run++)
        rx_report_put(runs, lab->run[run].name, lab->run[run].settings);
    rx_report_show(report, runs, RX_VIEW(.from = 0));
    return RX_OK;
}

const rx_lab_results rx_photometry_results = {measure, facts, sizeof JUDGES / sizeof *JUDGES,
                                              JUDGES,  page,  READING};
