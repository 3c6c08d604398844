/* What a campaign of fluxes has found, and its report. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/findings.h"
#include "lab/fluxes.h"
#include "num/stats.h"
#include "report/curves.h"

#define LENGTH(table) ((int)(sizeof(table) / sizeof *(table)))

static const double LEVEL = 0.95, SIGMAS = 1.96;
static const double MEDIAN_ERROR = 1.2533, MAD_ERROR = 1.1664;
static const double MAG = 1.0857362047581296; /* 2.5 / ln 10 */
static const double LEAST_RATIO = 1e-3;       /* of a flux of a pair */
enum { FEWEST = 20 };                         /* fewer objects decide no goal */

enum { PAIR_BINS = 5, PAIR_SAMPLES = RX_SAMPLE_ALL + 1 };
static const double PAIR_EDGE[PAIR_BINS + 1] = {0.5, 0.75, 1, 1.5, 2, 3}; /* FWHM */

static const struct {
    const char *name;
    double low, high;
} SNR[RX_SNR_BINS] = {{"5-10", 5, 10},     {"10-20", 10, 20},       {"20-50", 20, 50},
                      {"50-100", 50, 100}, {"100-1000", 100, 1000}, {"1000+", 1000, HUGE_VAL},
                      {"5-100", 5, 100},   {"10+", 10, HUGE_VAL}};

/* --- places --- */

/* The grids: indices from the outermost on, and those that words of a row name. */
static const struct {
    int width, n, index[RX_OF_ALL], nwords, word[RX_OF_ALL];
} GRIDS[RX_FLUXES_GRIDS] = {
    [RX_FLUXES_CELLS] = {RX_CELL_NUMBERS,
                         8,
                         {RX_OF_SAMPLE, RX_OF_SCENE, RX_OF_CROWD, RX_OF_KIND, RX_OF_CONDITION, RX_OF_SNR,
                          RX_OF_RUN, RX_OF_FLUX},
                         7,
                         {RX_OF_SCENE, RX_OF_KIND, RX_OF_CROWD, RX_OF_CONDITION, RX_OF_SNR, RX_OF_RUN,
                          RX_OF_FLUX}},
    [RX_FLUXES_PAIRS] = {RX_PAIR_NUMBERS,
                         6,
                         {RX_OF_SCENE, RX_OF_SAMPLE, RX_OF_CONDITION, RX_OF_SEPARATION, RX_OF_RUN,
                          RX_OF_FLUX},
                         5,
                         {RX_OF_SAMPLE, RX_OF_CONDITION, RX_OF_SEPARATION, RX_OF_RUN, RX_OF_FLUX}},
    [RX_FLUXES_INVENTED] = {RX_INVENTED_NUMBERS,
                            3,
                            {RX_OF_SCENE, RX_OF_CONDITION, RX_OF_RUN},
                            3,
                            {RX_OF_SCENE, RX_OF_CONDITION, RX_OF_RUN}},
};

static int size_of(const rx_lab *lab, int grid, int index)
{
    const int size[RX_OF_ALL] = {[RX_OF_SAMPLE] = grid == RX_FLUXES_PAIRS ? PAIR_SAMPLES : RX_SAMPLES,
                                 [RX_OF_SCENE] = lab->nscenes,
                                 [RX_OF_CROWD] = RX_CROWDS,
                                 [RX_OF_KIND] = 2,
                                 [RX_OF_CONDITION] = lab->nconditions,
                                 [RX_OF_SNR] = RX_SNR_BINS,
                                 [RX_OF_SEPARATION] = PAIR_BINS,
                                 [RX_OF_RUN] = lab->nruns,
                                 [RX_OF_FLUX] = RX_FLUX_KINDS};
    return size[index];
}

rx_estimate *rx_fluxes_at(const rx_store *s, int grid, rx_fluxes_place place)
{
    size_t at = 0;
    for (int i = 0; i < GRIDS[grid].n; i++)
        at =
            at * (size_t)size_of(s->lab, grid, GRIDS[grid].index[i]) + (size_t)place.at[GRIDS[grid].index[i]];
    return (rx_estimate *)s->own[grid] + at * (size_t)GRIDS[grid].width;
}

/* How many places there are whose first `fixed` indices are given, and number k of them. */
static long count_places(const rx_lab *lab, int grid, int fixed)
{
    long n = 1;
    for (int i = fixed; i < GRIDS[grid].n; i++)
        n *= size_of(lab, grid, GRIDS[grid].index[i]);
    return n;
}

static void set_place(const rx_lab *lab, int grid, int fixed, long k, rx_fluxes_place *place)
{
    for (int i = GRIDS[grid].n - 1; i >= fixed; i--) {
        const int size = size_of(lab, grid, GRIDS[grid].index[i]);
        place->at[GRIDS[grid].index[i]] = (int)(k % size);
        k /= size;
    }
}

static const char *word_of(const rx_store *s, int index, int i)
{
    static const char *const samples[] = {"detected", "all", "common"}, *const kinds[] = {"star", "galaxy"},
                             *const crowds[] = {"isolated", "blended", "told apart", "neither"},
                             *const separations[] = {"0.5 to 0.75", "0.75 to 1", "1 to 1.5", "1.5 to 2",
                                                     "2 to 3"},
                             *const fluxes[] = {"AUTO", "APER", "WIDE", "TEMPLATE"};
    switch (index) {
    case RX_OF_SCENE:
        return s->group[i].name;
    case RX_OF_CONDITION:
        return s->group[0].condition[i];
    case RX_OF_RUN:
        return s->column[i];
    case RX_OF_SNR:
        return SNR[i].name;
    default:
        return (index == RX_OF_SAMPLE  ? samples
                : index == RX_OF_KIND  ? kinds
                : index == RX_OF_CROWD ? crowds
                : index == RX_OF_FLUX  ? fluxes
                                       : separations)[i];
    }
}

/* --- statistics --- */

static rx_estimate around(double value, double error, long n)
{
    return (rx_estimate){value, value - SIGMAS * error, value + SIGMAS * error, n};
}

/* Median and sigma_MAD of n values, which are lost; either may be NULL. */
static void robust(double *v, long n, rx_estimate *median, rx_estimate *width)
{
    double middle = n == 1 ? v[0] : NAN, sigma = NAN;
    if (n >= 2)
        sigma = rx_sigma_mad(v, (size_t)n, &middle);
    if (median != NULL)
        *median = around(middle, MEDIAN_ERROR * sigma / sqrt((double)n), n);
    if (width != NULL)
        *width = around(sigma, MAD_ERROR * sigma / sqrt((double)n), n >= 2 ? n : 0);
}

static rx_estimate mean_of(const double *v, long n)
{
    double sum = 0, square = 0;
    for (long i = 0; i < n; i++)
        sum += v[i];
    if (n < 2)
        return (rx_estimate){n == 1 ? sum : NAN, NAN, NAN, n};
    for (long i = 0; i < n; i++)
        square += (v[i] - sum / (double)n) * (v[i] - sum / (double)n);
    return around(sum / (double)n, sqrt(square / (double)(n - 1) / (double)n), n);
}

static double to_mag(double ratio)
{
    return ratio > 0 ? -2.5 * log10(ratio) : NAN;
}

static const rx_lab_table *objects_of(const rx_lab *lab, rx_fluxes_place p)
{
    return &rx_lab_set_of(lab, p.condition, p.scene)->table[RX_FLUXES_OBJECT];
}

/* --- cells --- */

/* Found by that run, with all its fluxes. */
static int is_measured(const rx_lab_table *set, int run, long i, int sample)
{
    const double *v = rx_lab_each(set, i, run), state = v[RX_FOUND]; /* NAN, not found, fails both */
    int finite = sample == RX_SAMPLE_ALL ? state >= 0 : state < 2;
    for (int k = 0; k < RX_FLUX_KINDS; k++)
        finite = finite && isfinite(v[RX_RATIO + k]);
    return finite;
}

/* Is object i in the sample. */
static int takes_part(const rx_lab *lab, const rx_lab_table *set, rx_fluxes_place p, long i)
{
    static const int company[RX_CROWDS] = {RX_ISOLATED, RX_BLENDED, RX_BLENDED, RX_NEITHER};
    const double *prop = rx_lab_own(set, i);
    if ((int)prop[RX_PROP_GALAXY] != p.kind || (int)prop[RX_PROP_BLEND_STATE] != company[p.crowd] ||
        !(prop[RX_PROP_SNR] >= SNR[p.snr].low) || !(prop[RX_PROP_SNR] < SNR[p.snr].high))
        return 0;
    for (int run = 0; run < lab->nruns; run++)
        if ((p.sample == RX_SAMPLE_COMMON || run == p.run) &&
            (!is_measured(set, run, i, p.sample) ||
             (p.crowd == RX_CROWD_APART && !(rx_lab_each(set, i, run)[RX_BOTH] > 0.5))))
            return 0;
    return 1;
}

/* work[4]: room for all objects of a set each. */
static void fill_cell(const rx_lab *lab, rx_fluxes_place p, double *work[4], rx_estimate *dst)
{
    const rx_lab_table *set = objects_of(lab, p);
    double *ratio = work[0], *bound = work[1], *pull = work[2], *magerr = work[3];
    rx_estimate middle;
    long n = 0, npulls = 0;
    for (long i = 0; i < set->n; i++) {
        if (!takes_part(lab, set, p, i))
            continue;
        const double *v = rx_lab_each(set, i, p.run), error = v[RX_ERROR + p.flux];
        ratio[n] = v[RX_RATIO + p.flux];
        if (error > 0 && isfinite(error))
            pull[npulls++] = (ratio[n] - 1) / error;
        magerr[n] = 100 * fabs(ratio[n] - 1);
        bound[n] = (ratio[n] - 1) / rx_lab_own(set, i)[RX_PROP_BOUND];
        n++;
    }
    dst[RX_CELL_MAGERR] = mean_of(magerr, n);
    robust(bound, p.kind == 0 && p.crowd == RX_CROWD_ISOLATED ? n : 0, NULL, &dst[RX_CELL_BOUND]);
    robust(pull, npulls, &dst[RX_CELL_PULL], &dst[RX_CELL_WIDTH]);
    robust(ratio, n, &middle, &dst[RX_CELL_SCATTER]);
    dst[RX_CELL_BIAS] =
        (rx_estimate){to_mag(middle.value), to_mag(middle.high), to_mag(middle.low), middle.n};
    dst[RX_CELL_SCATTER].value *= MAG;
    dst[RX_CELL_SCATTER].low *= MAG;
    dst[RX_CELL_SCATTER].high *= MAG;
}

/* Pairs of one separation: those of which both are found, each at its place. */
static void fill_pair(const rx_lab *lab, rx_fluxes_place p, double *work[4], rx_estimate *dst)
{
    const rx_lab_table *set = objects_of(lab, p);
    const int run = p.run, flux = RX_RATIO + p.flux, bin = p.separation;
    const int pairs = lab->scene[p.scene].id == RX_SCENE_MIXED_PAIRS;
    long n = 0, all = 0;
    for (long i = 0; i < set->n && pairs; i++) {
        const double *prop = rx_lab_own(set, i), share = pow(10, 0.4 * prop[RX_PROP_MAGS]);
        const long k = i + (long)prop[RX_PROP_PARTNER]; /* of the first member the other one comes later */
        if (k <= i || !(prop[RX_PROP_APART] >= PAIR_EDGE[bin]) || !(prop[RX_PROP_APART] < PAIR_EDGE[bin + 1]))
            continue;
        all++;
        if (!(rx_lab_each(set, i, run)[RX_BOTH] > 0.5) || !is_measured(set, run, i, p.sample) ||
            !is_measured(set, run, k, p.sample))
            continue;
        const double a = rx_lab_each(set, i, run)[flux], b = rx_lab_each(set, k, run)[flux];
        work[0][n] = -2.5 * log10(fmax(b, LEAST_RATIO) / fmax(a, LEAST_RATIO));
        work[1][n] = fabs(work[0][n]);
        work[2][n++] = to_mag(fmax((a + share * b) / (1 + share), LEAST_RATIO));
    }
    robust(work[0], n, &dst[RX_PAIR_RATIO], &dst[RX_PAIR_SCATTER]);
    robust(work[1], n, &dst[RX_PAIR_SIZE], NULL);
    robust(work[2], n, &dst[RX_PAIR_TOTAL], NULL);
    dst[RX_PAIR_BOTH] = rx_binomial_interval(n, all, LEVEL);
}

static void fill_invented(const rx_lab *lab, rx_fluxes_place p, double *work[4], rx_estimate *dst)
{
    const rx_lab_table *set = objects_of(lab, p),
                       *tile = &rx_lab_set_of(lab, p.condition, p.scene)->table[RX_FLUXES_TILE];
    const double mpixels = rx_lab_sum(tile, RX_FLUXES_MPIXELS);
    long t[RX_FLUXES_TALLIES] = {0};
    for (long i = 0; i < tile->n * RX_FLUXES_TALLIES; i++)
        t[i % RX_FLUXES_TALLIES] +=
            (long)rx_lab_each(tile, i / RX_FLUXES_TALLIES, p.run)[i % RX_FLUXES_TALLIES];
    dst[RX_INVENTED_ADDED].value = (double)t[RX_TALLY_ADDED];
    for (int kept = 0; kept < 2; kept++) {
        const long right = t[RX_TALLY_RIGHT + kept], wrong = t[RX_TALLY_FALSE + kept];
        long n = 0;
        dst[kept ? RX_INVENTED_RIGHT_KEPT : RX_INVENTED_RIGHT].value = (double)right;
        dst[kept ? RX_INVENTED_WRONG_KEPT : RX_INVENTED_WRONG].value = (double)wrong;
        dst[RX_INVENTED_PER_MPIXEL + kept] = rx_poisson_rate(wrong, mpixels, LEVEL);
        dst[RX_INVENTED_PRECISION + kept] = rx_binomial_interval(right, right + wrong, LEVEL);
        for (long i = 0; i < set->n && lab->scene[p.scene].id == RX_SCENE_SHREDS; i++)
            if (!isnan(rx_lab_each(set, i, p.run)[RX_FOUND]))
                work[0][n++] = rx_lab_each(set, i, p.run)[RX_PIECES + kept];
        dst[RX_INVENTED_PIECES + kept] = mean_of(work[0], n);
    }
    dst[RX_INVENTED_MARKED_WEAK] =
        rx_binomial_interval(t[RX_TALLY_WEAK] - t[RX_TALLY_WEAK_KEPT], t[RX_TALLY_WEAK], LEVEL);
    dst[RX_INVENTED_MARKED_STRONG] =
        rx_binomial_interval(t[RX_TALLY_STRONG] - t[RX_TALLY_STRONG_KEPT], t[RX_TALLY_STRONG], LEVEL);
}

static rx_status measure(rx_store *s, rx_error *err)
{
    const rx_lab *lab = s->lab;
    static void (*const fill[RX_FLUXES_GRIDS])(const rx_lab *, rx_fluxes_place, double *[4],
                                               rx_estimate *) = {fill_cell, fill_pair, fill_invented};
    size_t most = 1;
    RX_TRY(rx_store_groups(s, lab->nscenes, err));
    for (int k = 0; k < lab->nscenes * lab->nconditions; k++)
        if ((size_t)lab->set[k].table[RX_FLUXES_OBJECT].n > most)
            most = (size_t)lab->set[k].table[RX_FLUXES_OBJECT].n;
    double *work[4] = {RX_NEW(double, most), RX_NEW(double, most), RX_NEW(double, most),
                       RX_NEW(double, most)};
    rx_status status = work[0] == NULL || work[1] == NULL || work[2] == NULL || work[3] == NULL
                           ? rx_error_memory(err, 4 * most * sizeof(double))
                           : RX_OK;
    for (int g = 0; g < s->ngroups && status == RX_OK; g++) {
        s->group[g].name = rx_scene_name(lab->scene[g].id);
        status = rx_group_open(s, g, lab->nconditions, err);
        for (int c = 0; c < lab->nconditions && status == RX_OK; c++)
            rx_lab_condition_name(lab, c, s->group[g].condition[c], sizeof *s->group[g].condition);
    }
    for (int grid = 0; grid < RX_FLUXES_GRIDS && status == RX_OK; grid++) {
        const size_t n = (size_t)count_places(lab, grid, 0);
        rx_fluxes_place place = {0};
        s->own[grid] = RX_NEW(rx_estimate, n * (size_t)GRIDS[grid].width);
        if (s->own[grid] == NULL)
            status = rx_error_memory(err, n * sizeof(rx_estimate));
        for (size_t k = 0; k < n && status == RX_OK; k++) {
            set_place(lab, grid, 0, (long)k, &place);
            fill[grid](lab, place, work, rx_fluxes_at(s, grid, place));
        }
    }
    for (int i = 0; i < 4; i++)
        free(work[i]);
    return status;
}

/* --- goals --- */

/* The population on a tile whose restorers are given the truth. */
static int counts(const rx_lab *lab, rx_fluxes_place p)
{
    const rx_scene_id kind = lab->scene[p.scene].id;
    return rx_condition_true(&lab->sky[p.condition].condition) &&
           (kind == RX_SCENE_FIELD || kind == RX_SCENE_MIXED_PAIRS || kind == RX_SCENE_INJECTED);
}

/* The least number of the other fluxes on the same things: of pairs of AUTO on NONE and on RL; *whose it is. */
static double least_other(const rx_store *s, rx_fluxes_place p, int pairs, char *whose, size_t size)
{
    double best = HUGE_VAL;
    for (int i = 0; i < s->ncolumns * RX_FLUX_TEMPLATE; i++) {
        const char *run = s->column[p.run = i / RX_FLUX_TEMPLATE];
        p.flux = i % RX_FLUX_TEMPLATE;
        if (pairs && (p.flux != RX_FLUX_AUTO || (strcmp(run, "NONE") != 0 && strcmp(run, "RL") != 0)))
            continue;
        const rx_estimate *other = pairs ? &rx_fluxes_at(s, RX_FLUXES_PAIRS, p)[RX_PAIR_SIZE]
                                         : &rx_fluxes_at(s, RX_FLUXES_CELLS, p)[RX_CELL_MAGERR];
        if (other->value < best && (!pairs || other->n >= FEWEST)) {
            best = other->value;
            snprintf(whose, size, ", against %s %s", run, word_of(s, RX_OF_FLUX, p.flux));
        }
    }
    return best;
}

/* What a goal is about: numbers of TEMPLATE of a sample and crowd, in bins of S/N (PAIRS: separations) first to last, of
 * stars alone (1) or of galaxies, too; every scene and seeing. */
static const struct {
    int sample, crowd, first, last, kinds, number;
} GOALS[RX_CLAIM_COUNT] = {
    [RX_GOAL_BIAS_ISOLATED] = {RX_SAMPLE_ALL, RX_CROWD_ISOLATED, RX_SNR_ABOVE_10, RX_SNR_ABOVE_10, 2,
                               RX_CELL_BIAS},
    [RX_GOAL_BIAS_BINS] = {RX_SAMPLE_ALL, RX_CROWD_ISOLATED, 1, RX_SNR_SINGLE - 1, 2, RX_CELL_BIAS},
    [RX_GOAL_BIAS_APART] = {RX_SAMPLE_ALL, RX_CROWD_APART, RX_SNR_ABOVE_10, RX_SNR_ABOVE_10, 2, RX_CELL_BIAS},
    [RX_GOAL_BIAS_BLENDED] = {RX_SAMPLE_ALL, RX_CROWD_BLENDED, RX_SNR_ABOVE_10, RX_SNR_ABOVE_10, 2,
                              RX_CELL_BIAS},
    [RX_GOAL_PULL] = {RX_SAMPLE_ALL, RX_CROWD_ISOLATED, RX_SNR_5_100, RX_SNR_5_100, 1, RX_CELL_PULL},
    [RX_GOAL_WIDTH] = {RX_SAMPLE_ALL, RX_CROWD_ISOLATED, RX_SNR_5_100, RX_SNR_5_100, 1, RX_CELL_WIDTH},
    [RX_GOAL_BOUND] = {RX_SAMPLE_ALL, RX_CROWD_ISOLATED, RX_SNR_ABOVE_10, RX_SNR_ABOVE_10, 1, RX_CELL_BOUND},
    [RX_GOAL_MAGERR] = {RX_SAMPLE_COMMON, RX_CROWD_ISOLATED, 0, RX_SNR_SINGLE - 1, 1, RX_CELL_MAGERR},
    [RX_GOAL_PAIRS] = {RX_SAMPLE_DETECTED, 0, 0, PAIR_BINS - 1, 1, RX_PAIR_SIZE},
};

static void judge(const rx_store *s, rx_claim_verdict *v)
{
    const int pairs = v->claim == RX_GOAL_PAIRS, ratio = pairs || v->claim == RX_GOAL_MAGERR,
              from = GOALS[v->claim].first, bins = GOALS[v->claim].last - from + 1,
              kinds = GOALS[v->claim].kinds;
    const rx_claim *goal = rx_claim_get(v->claim);
    double worst = -HUGE_VAL; /* how far beyond (or within: negative) its limit the worst number is */
    rx_estimate of_worst = {0};
    char where[256] = "";
    int broken = 0; /* numbers beyond a limit by more than their error */
    for (int i = 0; i < bins * kinds * s->ngroups * s->lab->nconditions; i++) {
        const rx_fluxes_place p = {.sample = GOALS[v->claim].sample,
                                   .crowd = GOALS[v->claim].crowd,
                                   .run = v->run,
                                   .flux = RX_FLUX_TEMPLATE,
                                   .kind = i / bins % kinds,
                                   .scene = i / bins / kinds % s->ngroups,
                                   .condition = i / bins / kinds / s->ngroups,
                                   .snr = pairs ? 0 : from + i % bins,
                                   .separation = pairs ? i % bins : 0};
        char whose[64] = "";
        const double over = ratio ? least_other(s, p, pairs, whose, sizeof whose) : 1;
        rx_estimate e = rx_fluxes_at(s, pairs ? RX_FLUXES_PAIRS : RX_FLUXES_CELLS, p)[GOALS[v->claim].number];
        e = (rx_estimate){e.value / over, e.low / over, e.high / over, e.n};
        if (!counts(s->lab, p) || !isfinite(over) || e.n < FEWEST || !isfinite(e.value))
            continue;
        const double beyond = fmax(e.value - goal->high, goal->low - e.value);
        v->all++;
        v->held += beyond <= 0;
        broken += e.low > goal->high || e.high < goal->low;
        if (beyond <= worst)
            continue;
        worst = beyond;
        of_worst = e;
        snprintf(where, sizeof where, "%s of %s, %s, %s %s%s", p.kind ? "galaxies" : "stars",
                 s->group[p.scene].name, s->group[0].condition[p.condition], pairs ? "FWHM" : "S/N",
                 pairs ? word_of(s, RX_OF_SEPARATION, p.separation) : SNR[p.snr].name, whose);
    }
    v->state = v->all == 0         ? RX_GOAL_NOT_MEASURED
               : v->held == v->all ? RX_GOAL_HELD
               : broken > 0        ? RX_GOAL_NOT_HELD
                                   : RX_GOAL_UNDECIDED;
    if (v->all > 0)
        rx_text_printf(&v->said, "%d of %d numbers held; the worst is %.4g [%.4g, %.4g] (%ld objects): %s",
                       v->held, v->all, of_worst.value, of_worst.low, of_worst.high, of_worst.n, where);
}

static const rx_claim_judge JUDGES[] = {{RX_GOAL_BIAS_ISOLATED, RX_GOAL_PAIRS, judge, {NULL}}};

/* --- tables --- */

RX_COLUMNS(
    CELLS, RX_TEXT("scene", "what is on the tiles"), RX_TEXT("kind", "star or galaxy"),
    RX_TEXT("company", "isolated, blended, told apart, neither"),
    RX_TEXT("condition", "seeing, and what restorers were given wrong"),
    {.name = "snr", .help = "bin of true S/N", .heading = "S/N"}, RX_TEXT("run", "restorer"),
    RX_TEXT("flux", "what was measured"),
    RX_ESTIMATE("bias", 4, "mag", "median error of the magnitude, measured less true"),
    RX_ESTIMATE("scatter", 4, "mag", "robust scatter of that error"),
    RX_ESTIMATE("bound", 3, "",
                "scatter over the error of a matched filter with noise of sky and photons; isolated stars"),
    RX_ESTIMATE("pull", 3, "", "median of (F - F0) / error"),
    RX_ESTIMATE("width", 3, "", "robust width of (F - F0) / error"),
    RX_ESTIMATE("magerr", 2, "%", "mean of 100 |F - F0| / F0"));

RX_COLUMNS(PAIRS, RX_TEXT("sample", "all: found by the run; detected: on its image"),
           RX_TEXT("condition", ""),
           {.name = "separation", .help = "from and to, FWHM", .heading = "separation [FWHM]"},
           RX_TEXT("run", "restorer"), RX_TEXT("flux", "what was measured"),
           RX_ESTIMATE("both", 3, "", "share of the pairs of which both are found"),
           RX_ESTIMATE("size", 3, "mag", "median |error| of their flux ratio"),
           RX_ESTIMATE("ratio", 3, "mag", "median error of their flux ratio, fainter less first"),
           RX_ESTIMATE("scatter", 3, "mag", "scatter of that error"),
           RX_ESTIMATE("total", 3, "mag", "median error of the total flux"));

RX_COLUMNS(INVENTED, RX_TEXT("scene", ""), RX_TEXT("condition", ""), RX_TEXT("run", "restorer"),
           RX_COUNT("right", "detections of objects"), RX_COUNT("wrong", "invented detections"),
           RX_COUNT("right_unmarked", "the same without marked detections"),
           RX_COUNT("wrong_unmarked", "the same without marked detections"),
           RX_COUNT("added", "true ones that only the residual showed"),
           RX_ESTIMATE("false_per_mpixel", 1, "", ""), RX_ESTIMATE("false_per_mpixel_unmarked", 1, "", ""),
           RX_ESTIMATE("precision", 4, "", ""), RX_ESTIMATE("precision_unmarked", 4, "", ""),
           RX_ESTIMATE("marked_5_7", 4, "", "share of the true ones that are marked, S/N 5 to 7"),
           RX_ESTIMATE("marked_above_7", 4, "", "the same above 7"),
           RX_ESTIMATE("pieces", 2, "", "pieces per galaxy that was found"),
           RX_ESTIMATE("pieces_unmarked", 2, "", ""));

RX_COLUMNS(SETS, RX_TEXT("condition", ""), RX_TEXT("scene", ""), RX_NUMBER("fwhm", 2, "pix", "of the PSF"),
           RX_COUNT("tiles", ""), RX_COUNT("objects", ""), RX_NUMBER("mpixels", 3, "", ""));

static const rx_report_column *const COLUMNS[RX_FLUXES_GRIDS] = {CELLS, PAIRS, INVENTED};

/* Rows of all places whose first `fixed` indices are given; cells without objects are left out. Returns the first row. */
static long add_rows(rx_report_table *t, const rx_store *s, int grid, rx_fluxes_place p, int fixed)
{
    const long from = rx_report_rows(t), n = count_places(s->lab, grid, fixed);
    const int nwords = GRIDS[grid].nwords;
    rx_cell row[16];
    for (long k = 0; k < n; k++) {
        set_place(s->lab, grid, fixed, k, &p);
        const rx_estimate *v = rx_fluxes_at(s, grid, p);
        if (grid == RX_FLUXES_CELLS && v->n == 0)
            continue;
        for (int i = 0; i < nwords; i++)
            row[i] = rx_cell_words(word_of(s, GRIDS[grid].word[i], p.at[GRIDS[grid].word[i]]));
        for (int i = 0; i < GRIDS[grid].width; i++)
            row[nwords + i] = COLUMNS[grid][nwords + i].kind == RX_REPORT_ESTIMATE
                                  ? rx_cell_estimate(v[i])
                                  : rx_cell_number(v[i].value);
        rx_report_row(t, row);
    }
    return from;
}

static void show(rx_report *report, const rx_report_table *t, long from, const rx_report_column *c,
                 const char *row)
{
    rx_report_show(report, t,
                   RX_VIEW(.from = from, .title = c->name, .unit = c->unit, .note = c->help,
                           .rows = {"condition", row}, .across = {"run", "flux"}, .value = c->name,
                           .digits = c->digits));
}

/* The bias of isolated objects lies open, the rest is folded away; all samples are in the files. */
static void add_crowd(rx_report *report, rx_report_table *const cells[RX_SAMPLES], const rx_store *s,
                      rx_fluxes_place p)
{
    const int isolated = p.crowd == RX_CROWD_ISOLATED;
    char title[96];
    for (int sample = 0; sample < RX_SAMPLES; sample++) {
        p.sample = sample;
        const long from = add_rows(cells[sample], s, RX_FLUXES_CELLS, p, 4);
        if (sample != RX_SAMPLE_DETECTED || rx_report_rows(cells[sample]) == from)
            continue;
        snprintf(title, sizeof title, "%s, %s", p.kind ? "Galaxies" : "Stars",
                 word_of(s, RX_OF_CROWD, p.crowd));
        if (isolated)
            rx_report_heading(report, title, NULL);
        for (int q = GRIDS[RX_FLUXES_CELLS].nwords, n = 0; q < LENGTH(CELLS); q++, n++) {
            if (n == isolated)
                rx_report_fold(report, isolated ? "Scatter, pulls, MagErr" : title);
            if (n != RX_CELL_BOUND || (p.kind == 0 && isolated))
                show(report, cells[sample], from, &CELLS[q], "snr");
        }
        rx_report_unfold(report);
    }
}

/* Bias over S/N: TEMPLATE of every restorer, AUTO of the first (dashed). */
static void plot(rx_figures *dst, const rx_store *s, rx_fluxes_place p)
{
    static const double middle[RX_SNR_SINGLE] = {7.1, 14, 32, 71, 320, 2000};
    static const rx_axes axes = {"S/N", "median error (mag)", 5, 4000, -0.1, 0.1, true, false};
    rx_curves curves = {0};
    char names[1 + RX_FLUXES_RUNS][64], id[RX_FIGURE_ID], title[160];
    for (int k = 0; k <= s->ncolumns; k++) {
        const char *run = s->column[p.run = k % s->ncolumns];
        p.flux = k < s->ncolumns ? RX_FLUX_TEMPLATE : RX_FLUX_AUTO;
        snprintf(names[k], sizeof *names, "%s %s", run, word_of(s, RX_OF_FLUX, p.flux));
        rx_curves_add(&curves, RX_CURVE_BARS, rx_method_color(run), names[k]);
        for (p.snr = 0; p.snr < RX_SNR_SINGLE; p.snr++) {
            const rx_estimate *e = &rx_fluxes_at(s, RX_FLUXES_CELLS, p)[RX_CELL_BIAS];
            rx_curves_put(&curves, middle[p.snr] * (1 + 0.03 * k), e->n >= 5 ? e->value : NAN, e->low,
                          e->high);
        }
    }
    snprintf(title, sizeof title, "%s, %s, %s", p.kind ? "Galaxies" : "Stars",
             word_of(s, RX_OF_CROWD, p.crowd), word_of(s, RX_OF_CONDITION, p.condition));
    snprintf(id, sizeof id, "%s-%d-%d-%d", word_of(s, RX_OF_SCENE, p.scene), p.kind, p.crowd, p.condition);
    rx_curves_figure(dst, id, title, "", &axes, &curves);
}

static const char READING[] = "Tables here are of the objects that were detected on the image of the "
                              "restorer of the column; all of its fluxes are "
                              "of the same objects. Sources that only the residual of the templates showed "
                              "(added) are left out, as AUTO and "
                              "apertures know nothing of them; goals are compared with all (cells.ecsv, "
                              "summary.json); cells_common.ecsv has those "
                              "that every restorer has detected. S/N is the true one, in a matched filter on "
                              "the bare sky. <b>APER</b> is the first "
                              "of STAGE.PHOT_APERTURES, <b>WIDE</b> an aperture of 2 FWHM radius, both as "
                              "they are. <b>Isolated</b>: no other object "
                              "of more than 1 % of the flux within (3 + log10 f) FWHM and twice both "
                              "half-light radii, f how many times brighter it "
                              "is. <b>Blended</b>: another one within 1.5 FWHM and 2 mag; <b>told apart</b>: "
                              "both were found, each nearer to its "
                              "place than half the separation. <b>Marked</b>: FLAGS_RESTORE calls the source "
                              "spurious. <b>Goals</b> are compared "
                              "with FIELD, PAIRS and INJECTED where restorers are given the truth; "
                              "undecided: beyond the limit by less than the "
                              "error of the number.";

/* The part of a page that is one scene's. */
static void add_scene(rx_findings *f, const rx_store *s, int g, rx_report_table *const cells[RX_SAMPLES],
                      rx_report_table *pairs)
{
    const rx_lab *lab = s->lab;
    const rx_scene_id scene = lab->scene[g].id;
    rx_fluxes_place p = {.sample = RX_SAMPLE_DETECTED, .scene = g};
    for (int i = 0; i < lab->nconditions * 4 && scene != RX_SCENE_BLANK; i++) {
        p.condition = i / 4;
        p.kind = i / 2 % 2;
        p.crowd = i % 2 ? RX_CROWD_APART : RX_CROWD_ISOLATED;
        if (rx_report_figures_of(f->report)->n < RX_FIGURES_MAX)
            plot(rx_report_figures_of(f->report), s, p);
    }
    rx_findings_section(f, s->group[g].name, s->group[g].name,
                        scene != RX_SCENE_BLANK ? s->group[g].name : NULL);
    rx_report_paragraph(f->report, rx_scene_about(scene));
    for (int sample = 0; sample < PAIR_SAMPLES && scene == RX_SCENE_MIXED_PAIRS; sample++) {
        p.sample = sample;
        const long from = add_rows(pairs, s, RX_FLUXES_PAIRS, p, 2);
        rx_report_fold(f->report,
                       sample == RX_SAMPLE_DETECTED
                           ? "Pairs of which both are detected, each at its place"
                           : "The same with sources that only the residual of the templates shows");
        for (int q = GRIDS[RX_FLUXES_PAIRS].nwords; q < LENGTH(PAIRS); q++)
            show(f->report, pairs, from, &PAIRS[q], "separation");
        rx_report_unfold(f->report);
    }
    for (int i = 0; i < 2 * RX_CROWDS && scene != RX_SCENE_BLANK; i++) {
        p.crowd = i / 2;
        p.kind = i % 2;
        add_crowd(f->report, cells, s, p);
    }
}

static rx_status page(const rx_store *s, rx_findings *f, rx_error *err)
{
    static const char *const brief[] = {"condition",      "run",           "right", "wrong",
                                        "right_unmarked", "wrong_unmarked"};
    const rx_lab *lab = s->lab;
    rx_report_table *sets = RX_REPORT_TABLE(f->report, "sets", SETS, RX_REPORT_IN_JSON),
                    *cells[RX_SAMPLES] = {[RX_SAMPLE_DETECTED] = RX_REPORT_TABLE(f->report, "cells_detected",
                                                                                 CELLS, RX_REPORT_IN_FILE),
                                          [RX_SAMPLE_ALL] = RX_REPORT_TABLE(f->report, "cells", CELLS,
                                                                            RX_REPORT_EVERYWHERE),
                                          [RX_SAMPLE_COMMON] = RX_REPORT_TABLE(f->report, "cells_common",
                                                                               CELLS, RX_REPORT_IN_FILE)},
                    *pairs = RX_REPORT_TABLE(f->report, "pairs", PAIRS, RX_REPORT_EVERYWHERE),
                    *invented = RX_REPORT_TABLE(f->report, "invented", INVENTED, RX_REPORT_EVERYWHERE);
    (void)err;
    for (int g = 0; g < s->ngroups; g++) {
        for (int c = 0; c < lab->nconditions; c++) {
            const rx_lab_set *set = rx_lab_set_of(lab, c, g);
            rx_report_put(sets, s->group[g].condition[c], s->group[g].name, lab->sky[c].fwhm, set->ntiles,
                          set->table[RX_FLUXES_OBJECT].n,
                          rx_lab_sum(&set->table[RX_FLUXES_TILE], RX_FLUXES_MPIXELS));
        }
        add_scene(f, s, g, cells, pairs);
        const long from = add_rows(invented, s, RX_FLUXES_INVENTED, (rx_fluxes_place){.scene = g}, 1);
        rx_report_show(f->report, invented, RX_VIEW(.from = from, .title = "Invented sources"));
        rx_text_printf(rx_report_brief_of(f->report), "%s\n", s->group[g].name);
        rx_report_show_brief(f->report, invented,
                             RX_VIEW(.from = from, .ncolumns = LENGTH(brief), .columns = brief));
    }
    return RX_OK;
}

const rx_lab_results rx_fluxes_results = {measure, NULL, LENGTH(JUDGES), JUDGES, page, READING};
