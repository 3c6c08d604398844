/* What a restoration campaign has found, and its report. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "lab/findings.h"
#include "lab/restoration.h"
#include "report/curves.h"
#include "report/escape.h"
#include "report/page.h"

#define LENGTH(table) ((int)(sizeof(table) / sizeof *(table)))

enum { TEST = 1 }; /* of the scenes of a bin; 0: those that methods are tuned on */
static const double LEVEL = 0.95;
static const char *const KINDS[] = {"FWHM", "noise"}, *const IDS[] = {"fwhm", "sigma"};
static const char *const UPPER[] = {"PSNR", "SSIM"};
static const rx_quantity QUALITIES[RX_QUALITIES] = {
    [RX_PSNR] = {.name = "psnr", .unit = "dB", .digits = 2, .help = "mean over the scenes, t interval"},
    [RX_SSIM] = {.name = "ssim", .unit = "", .digits = 4, .help = "mean over the scenes, t interval"}};

/* --- numbers --- */

/* The bins of FWHM come first among the conditions of the lab. */
static int number_of(const rx_store *s, int group, int condition)
{
    return group == 0 ? condition : s->group[0].nconditions + condition;
}

static const rx_lab_bin *drawn(const rx_store *s, int group, int condition)
{
    return &s->lab->bin[number_of(s, group, condition)];
}

static double centre(const rx_lab_bin *bin)
{
    return 0.5 * (bin->low + bin->high);
}

static const rx_lab_table *scenes_of(const rx_store *s, int group, int condition)
{
    return &rx_lab_set_of(s->lab, number_of(s, group, condition), TEST)->table[RX_RESTORATION_SCENE];
}

rx_restoration_bin *rx_restoration_bin_of(const rx_store *s, int group, int condition)
{
    return (rx_restoration_bin *)s->own[0] + number_of(s, group, condition);
}

int rx_bin_is_beyond(const rx_store *s, int group, int condition)
{
    const rx_restoration_bin *bin = rx_restoration_bin_of(s, group, condition);
    return !bin->inside || bin->fainter;
}

static int is_between(double value, const double range[2])
{
    return range[1] > range[0] && value >= range[0] && value <= range[1];
}

/* Box and mean of n values. */
static rx_status summarise(long n, const double *values, const double *zero, rx_five_numbers *box,
                           rx_estimate *mean, rx_error *err)
{
    rx_test test;
    *box = (rx_five_numbers){NAN, NAN, NAN, NAN, NAN, 0, 0, NAN};
    *mean = (rx_estimate){NAN, NAN, NAN, n};
    if (n == 0)
        return RX_OK;
    RX_TRY(rx_five_numbers_of(n, values, box, err));
    mean->value = box->mean;
    if (!rx_has_spread(n, values, zero))
        return RX_OK;
    RX_TRY(rx_test_paired(n, values, zero, &test, err));
    mean->low = test.difference.low;
    mean->high = test.difference.high;
    return RX_OK;
}

/* A test that cannot be made (fewer than 2 scenes, or no spread at all) is none. */
static rx_status compare(rx_contest *const dst[RX_TESTS], long n, const double *a, const double *b,
                         const double *zero, uint64_t seed, rx_error *err)
{
    if (!rx_has_spread(n, a, b) || !rx_has_spread(n, a, zero)) {
        dst[RX_BY_BOOTSTRAP]->test.difference.n = n;
        return RX_OK;
    }
    RX_TRY(rx_contest_paired(n, a, b, dst[RX_BY_PAIRED], dst[RX_BY_WILCOXON], err));
    RX_TRY(rx_test_two_sample(n, a, n, b, &dst[RX_BY_TWO_SAMPLES]->test, err));
    dst[RX_BY_TWO_SAMPLES]->test.difference = rx_contest_none().test.difference;
    return rx_paired_bootstrap(n, a, b, LEVEL, seed, &dst[RX_BY_BOOTSTRAP]->test.difference, err);
}

static rx_status measure_bin(rx_store *s, int g, int c, rx_error *err)
{
    const rx_lab *lab = s->lab;
    const rx_lab_bin *bin = drawn(s, g, c);
    const rx_lab_table *scene = scenes_of(s, g, c);
    rx_restoration_bin *own = rx_restoration_bin_of(s, g, c);
    const size_t room = (size_t)scene->n + 1;
    double *a = RX_NEW(double, room), *b = RX_NEW(double, room), *zero = RX_NEW(double, room);
    rx_estimate unused;
    rx_status status = a == NULL || b == NULL || zero == NULL ? rx_error_memory(err, 3 * room * sizeof *a)
                                                              : rx_interrupt_check(err);
    for (long i = 0; i < scene->n && status == RX_OK; i++)
        a[i] = rx_lab_own(scene, i)[RX_SCENE_LEVEL];
    if (status == RX_OK)
        status = summarise(scene->n, a, zero, &own->level, &unused, err);
    const double fwhm = g == 1 ? 0.5 * (bin->other_low + bin->other_high) : centre(bin);
    own->inside = is_between(fwhm, lab->fwhm_trained) && !(own->level.median < lab->level_trained[0]);
    own->fainter = lab->level_trained[1] > 0.0 && own->level.median > lab->level_trained[1];
    for (int q = 0; q < RX_QUALITIES; q++) {
        for (int k = 0; k < lab->nruns && status == RX_OK; k++) {
            rx_finding *dst = rx_store_at(s, g, q, c, k);
            long n = 0;
            for (long i = 0; i < scene->n; i++) {
                a[n] = rx_lab_each(scene, i, k)[RX_SCORE_PSNR + q];
                n += isfinite(a[n]) != 0;
            }
            dst->setting = lab->tuned[number_of(s, g, c) * lab->nruns + k][q].setting;
            status = summarise(n, a, zero, &own->box[q][k], &dst->value, err);
        }
        for (int p = 0; p < s->npairs && status == RX_OK; p++) {
            rx_contest *dst[RX_TESTS];
            long n = 0;
            for (long i = 0; i < scene->n; i++) {
                a[n] = rx_lab_each(scene, i, s->pair[p][0])[RX_SCORE_PSNR + q];
                b[n] = rx_lab_each(scene, i, s->pair[p][1])[RX_SCORE_PSNR + q];
                n += isfinite(a[n]) && isfinite(b[n]);
            }
            for (int t = 0; t < RX_TESTS; t++)
                dst[t] = rx_contest_of(s, g, p, RX_TESTS * q + t, c);
            status = compare(dst, n, a, b, zero, s->seed, err);
        }
    }
    free(a);
    free(b);
    free(zero);
    return status;
}

static rx_status measure(rx_store *s, rx_error *err)
{
    const rx_lab *lab = s->lab;
    static const rx_about tests[RX_TESTS] = {
        {"", "paired t", 1, 1}, {"", "Wilcoxon", 1, 0}, {"", "two samples", 0, 0}, {"", "bootstrap", 0, 0}};
    int nbins[2] = {0};
    RX_TRY(rx_store_groups(s, 2, err));
    const int blurred = rx_store_column(s, "BLURRED"), smoothed = rx_store_column(s, "SMOOTHED"),
              rl = rx_store_column(s, "RL"), net = rx_store_column(s, "NET");
    /* Every method against RL, but RL first against what a filter alone does: the untouched image is beaten by any
     * suppression of noise. Then everything against that image. */
    rx_store_add_pair(s, net, rl);
    rx_store_add_pair(s, net, rx_store_column(s, "RL_FLAT"));
    rx_store_add_pair(s, rl, smoothed);
    rx_store_add_pair(s, rl, blurred);
    rx_store_add_pair(s, net, smoothed);
    for (int i = 0; i < s->ncolumns; i++)
        if (i != blurred && i != smoothed)
            rx_store_add_pair(s, i, rl);
    for (int i = 0; i < s->ncolumns; i++)
        rx_store_add_pair(s, i, blurred);
    for (int i = 0; i < RX_QUALITIES * RX_TESTS; i++) {
        s->about[s->nabouts] = tests[i % RX_TESTS];
        memcpy(s->about[s->nabouts++].quantity, QUALITIES[i / RX_TESTS].name, sizeof QUALITIES->name);
    }
    for (int b = 0; b < lab->nconditions; b++)
        nbins[lab->bin[b].by_sigma]++;
    s->own[0] = RX_NEW(rx_restoration_bin, (size_t)lab->nconditions);
    rx_status status = s->own[0] == NULL
                           ? rx_error_memory(err, (size_t)lab->nconditions * sizeof(rx_restoration_bin))
                           : RX_OK;
    for (int g = 0; g < 2 && status == RX_OK; g++) {
        s->group[g].name = KINDS[g];
        s->group[g].nquantities = RX_QUALITIES;
        memcpy(s->group[g].quantity, QUALITIES, sizeof QUALITIES);
        status = rx_group_open(s, g, nbins[g], err);
        for (int c = 0; c < nbins[g] && status == RX_OK; c++) {
            snprintf(s->group[g].condition[c], sizeof *s->group[g].condition, "%g", centre(drawn(s, g, c)));
            status = measure_bin(s, g, c, err);
        }
    }
    return status;
}

/* --- words --- */

/* Bins that a sentence is about. */
typedef enum region { ANYWHERE, INSIDE, BEYOND } region;

static int is_in(const rx_store *s, int group, int condition, int where)
{
    return where == ANYWHERE || (where == INSIDE ? rx_restoration_bin_of(s, group, condition)->inside
                                                 : rx_bin_is_beyond(s, group, condition));
}

/* One sentence for one quality and one kind of bin. */
static void sentence(rx_text *dst, const rx_store *s, int g, int quality, region where, int pair)
{
    static const struct {
        int winner;
        const char *words;
    } outcomes[] = {{1, "above"}, {-1, "below"}, {0, "no clear difference"}};
    const rx_contest_place place = {g, pair, RX_TESTS * quality, is_in, where};
    const int all = rx_contests_count(s, &place, 2);
    int any = 0;
    if (all == 0)
        return;
    rx_text_printf(dst, "%s by %s, %s against %s: ", UPPER[quality], KINDS[g], s->column[s->pair[pair][0]],
                   s->column[s->pair[pair][1]]);
    for (int i = 0; i < LENGTH(outcomes); i++) {
        const int n = rx_contests_count(s, &place, outcomes[i].winner);
        double least = INFINITY, most = 0;
        if (n == 0)
            continue;
        rx_text_printf(dst, "%s%s in %d of %d bins (", any++ ? "; " : "", outcomes[i].words, n, all);
        rx_contests_words(dst, s, &place, outcomes[i].winner);
        rx_text_add(dst, g == 1 ? "" : " px");
        for (int c = 0; c < s->group[g].nconditions && outcomes[i].winner != 0; c++) {
            const rx_contest *contest = rx_contest_of(s, g, pair, place.about, c);
            if (!is_in(s, g, c, where) || contest->winner != outcomes[i].winner)
                continue;
            least = fmin(least, fabs(contest->test.difference.value));
            most = fmax(most, fabs(contest->test.difference.value));
        }
        if (outcomes[i].winner != 0)
            rx_text_printf(dst, ", by %.2g", least);
        if (most > least)
            rx_text_printf(dst, " to %.2g", most);
        if (outcomes[i].winner != 0 && quality == RX_PSNR)
            rx_text_add(dst, " dB");
        rx_text_add(dst, ")");
    }
    rx_text_add(dst, ". ");
}

/* group -1: both. */
static void sentences(rx_text *dst, const rx_store *s, int pair, int group, region where)
{
    for (int i = 0; i < 2 * RX_QUALITIES && pair >= 0; i++)
        if (group < 0 || group == i % 2)
            sentence(dst, s, i % 2, i / 2, where, pair);
}

void rx_restoration_words(rx_text *dst, const rx_store *s, int pair)
{
    sentences(dst, s, pair, -1, ANYWHERE);
}

/* --- claims --- */

static const char ABSENT[] = "NET did not take part. ";

static rx_claim_state state_of(int holds)
{
    return holds ? RX_REPRODUCED : RX_NOT_REPRODUCED;
}

/* NET and a method of that name; -1: one of them is absent. */
static int net_against(const rx_store *s, const char *rival)
{
    return rx_store_pair(s, rx_store_column(s, "NET"), rx_store_column(s, rival));
}

/* The first of a pair wins wherever one looks. */
static int wins_all(const rx_store *s, int pair, int group, region where)
{
    int wins = 0, all = 0;
    for (int i = 0; i < 2 * RX_QUALITIES && pair >= 0; i++) {
        const rx_contest_place place = {i % 2, pair, RX_TESTS * (i / 2), is_in, where};
        if (group >= 0 && group != i % 2)
            continue;
        wins += rx_contests_count(s, &place, 1);
        all += rx_contests_count(s, &place, 2);
    }
    return all > 0 && wins == all;
}

/* The printed columns: which of them are not significant by their own t, and whether p follows from t. */
static void paper_itself(rx_text *dst)
{
    int fits = 0, all = 0;
    rx_text other = {0};
    for (const rx_paper_table *table = rx_paper_tables; table < rx_paper_tables + RX_PAPER_TABLES; table++)
        for (int k = 0; k < table->n; k++, all++) {
            double p, ln_p;
            if (rx_paper_column_fits(table, k, &p, &ln_p))
                fits++;
            else
                rx_text_printf(&other, "; Table %d at %s %g prints p = %.3g, but t = %.2f gives %.2g%s",
                               table->number, table->by_sigma ? "sigma" : "FWHM", table->bin[k], table->p[k],
                               table->t[k], p, p < 0.05 ? "" : ", which is not significant");
        }
    rx_text_printf(dst, "The paper's own tables: p follows from t in %d of %d columns%s.", fits, all,
                   other.data != NULL ? other.data : "");
    dst->failed = dst->failed || other.failed;
    rx_text_free(&other);
}

/* The test of a pair in the bin of a printed column; NULL: there is none. */
static const rx_contest *paper_contest(const rx_store *s, const rx_paper_table *table, int column, int pair,
                                       int test)
{
    for (int c = 0; c < s->group[table->by_sigma].nconditions && pair >= 0; c++)
        if (fabs(centre(drawn(s, table->by_sigma, c)) - table->bin[column]) < 0.25)
            return rx_contest_of(s, table->by_sigma, pair,
                                 RX_TESTS * (table->ssim ? RX_SSIM : RX_PSNR) + test, c);
    return NULL;
}

static void judge_every_bin(const rx_store *s, rx_claim_verdict *v)
{
    const int pair = net_against(s, "RL");
    if (pair < 0) {
        rx_text_add(&v->said, ABSENT);
        return;
    }
    v->state = state_of(wins_all(s, pair, -1, ANYWHERE));
    sentences(&v->said, s, pair, -1, ANYWHERE);
}

static void judge_all_p(const rx_store *s, rx_claim_verdict *v)
{
    const int pair = net_against(s, "RL"), shown = pair >= 0 ? pair : s->npairs > 0 ? 0 : -1;
    int below = 0, tested = 0;
    for (const rx_paper_table *table = rx_paper_tables; table < rx_paper_tables + RX_PAPER_TABLES; table++)
        for (int k = 0; k < table->n; k++) {
            const rx_contest *c = paper_contest(s, table, k, shown, RX_BY_TWO_SAMPLES);
            tested += c != NULL;
            below += c != NULL && c->test.p < 0.05;
        }
    if (pair < 0)
        rx_text_add(&v->said, ABSENT);
    else
        v->state = state_of(tested > 0 && below == tested);
    if (shown >= 0)
        rx_text_printf(&v->said,
                       "%s against %s: p below 0.05 in %d of the %d printed columns that have a bin here. ",
                       s->column[s->pair[shown][0]], s->column[s->pair[shown][1]], below, tested);
    paper_itself(&v->said);
}

/* Mean PSNR of the first noise bin less that of the last. */
static double fall_with_noise(const rx_store *s, int column)
{
    const int n = s->group[1].nconditions;
    return n == 0 || column < 0 ? NAN
                                : rx_store_at(s, 1, RX_PSNR, 0, column)->value.value -
                                      rx_store_at(s, 1, RX_PSNR, n - 1, column)->value.value;
}

static void judge_noise(const rx_store *s, rx_claim_verdict *v)
{
    const int pair = net_against(s, "RL");
    if (pair >= 0) {
        v->state = state_of(wins_all(s, pair, 1, ANYWHERE) &&
                            fall_with_noise(s, s->pair[pair][0]) < fall_with_noise(s, s->pair[pair][1]));
        sentences(&v->said, s, pair, 1, ANYWHERE);
    } else {
        rx_text_add(&v->said, ABSENT);
    }
    rx_text_add(&v->said, "Mean PSNR from the first noise bin to the last falls by");
    for (int k = 0, any = 0; k < s->ncolumns; k++)
        if (isfinite(fall_with_noise(s, k)))
            rx_text_printf(&v->said, "%s %.2f dB (%s)", any++ ? "," : "", fall_with_noise(s, k),
                           s->column[k]);
    rx_text_add(&v->said, ".");
}

static void judge_range(const rx_store *s, rx_claim_verdict *v)
{
    const region where = v->claim == RX_CLAIM_INSIDE ? INSIDE : BEYOND;
    const int blurred = net_against(s, "BLURRED"), net_rl = net_against(s, "RL"),
              rl = rx_store_column(s, "RL");
    if (blurred < 0) { /* what RL alone shows there */
        rx_text_add(&v->said, ABSENT);
        sentences(&v->said, s, rx_store_pair(s, rl, rx_store_column(s, "BLURRED")), -1, where);
        sentences(&v->said, s, rx_store_pair(s, rl, rx_store_column(s, "SMOOTHED")), -1, where);
        return;
    }
    v->state = state_of(wins_all(s, blurred, -1, where) &&
                        (where == INSIDE || net_rl < 0 || wins_all(s, net_rl, -1, where)));
    sentences(&v->said, s, blurred, -1, where);
    sentences(&v->said, s, net_against(s, "SMOOTHED"), -1, where);
    if (where == BEYOND)
        sentences(&v->said, s, net_rl, -1, where);
}

/* Above the rival beyond doubt inside the training, and in most bins that are not. */
static void judge_goal(const rx_store *s, rx_claim_verdict *v)
{
    const double beyond_doubt = 0.001;
    const int pair = net_against(s, v->claim == RX_CLAIM_ABOVE_RL ? "RL" : "RL_FLAT");
    int sure = 0, inside = 0, wins = 0, beyond = 0;
    if (rx_store_column(s, "NET") < 0)
        rx_text_add(&v->said, ABSENT);
    for (int g = 0; g < 2; g++)
        for (int i = 0; i < RX_QUALITIES * s->group[g].nconditions && pair >= 0; i++) {
            const rx_contest *c = rx_contest_of(s, g, pair, RX_TESTS * (i % RX_QUALITIES), i / RX_QUALITIES);
            const int in = rx_restoration_bin_of(s, g, i / RX_QUALITIES)->inside;
            inside += in;
            beyond += !in;
            sure += in && c->winner > 0 && c->holm < beyond_doubt;
            wins += !in && c->winner > 0;
        }
    if (inside + beyond == 0)
        return;
    v->state = state_of(sure == inside && (beyond == 0 || 2 * wins > beyond));
    rx_text_printf(&v->said,
                   "Above with p below %g in %d of %d bins inside the training, above in %d of %d outside "
                   "of it (each bin once for PSNR, once for SSIM). ",
                   beyond_doubt, sure, inside, wins, beyond);
    sentences(&v->said, s, pair, -1, ANYWHERE);
}

static const rx_claim_judge JUDGES[] = {{RX_CLAIM_EVERY_BIN, judge_every_bin},
                                        {RX_CLAIM_ALL_P, judge_all_p},
                                        {RX_CLAIM_NOISE, judge_noise},
                                        {RX_CLAIM_INSIDE, judge_range},
                                        {RX_CLAIM_BEYOND, judge_range},
                                        {RX_CLAIM_SPEED, NULL},
                                        {RX_CLAIM_NO_FAKES, NULL},
                                        {RX_CLAIM_ABOVE_RL, judge_goal},
                                        {RX_CLAIM_ABOVE_FLAT, judge_goal}};

/* --- figures --- */

enum { SHOWN_SIDE = 128, PICTURE_WIDTH = 200 };

static const char *axis_of(int g)
{
    return g == 1 ? "noise sigma (peak 255)" : "FWHM (pixels)";
}

/* One box per method and bin, as the paper's figure. */
static void plot_boxes(rx_figures *dst, const rx_store *s, int g, int quality)
{
    const size_t nbins = (size_t)s->group[g].nconditions, nmethods = (size_t)s->ncolumns;
    const rx_axes axes = {.xlabel = axis_of(g), .ylabel = quality == RX_PSNR ? "PSNR (dB)" : "SSIM"};
    char id[RX_FIGURE_ID], title[80], (*label)[100] = rx_alloc(nbins, sizeof *label);
    int colors[RX_METHODS_MAX];
    rx_five_numbers *box = RX_NEW(rx_five_numbers, nbins * nmethods);
    const char **groups = RX_NEW(const char *, nbins);
    dst->script.failed |= label == NULL || box == NULL || groups == NULL;
    for (size_t b = 0; b < nbins && !dst->script.failed; b++) {
        memcpy(&box[b * nmethods], rx_restoration_bin_of(s, g, (int)b)->box[quality], nmethods * sizeof *box);
        snprintf(label[b], sizeof *label, "%s%s", s->group[g].condition[b],
                 rx_bin_is_beyond(s, g, (int)b) ? "+" : "");
        groups[b] = label[b];
    }
    for (size_t k = 0; k < nmethods; k++)
        colors[k] = rx_method_color(s->column[k]);
    snprintf(id, sizeof id, "%.5s-box-%.8s", IDS[g], QUALITIES[quality].name);
    snprintf(title, sizeof title, "%s by %s", UPPER[quality], KINDS[g]);
    if (!dst->script.failed) {
        rx_figure_add(
            dst, id, title,
            "Box: quartiles, bar: median, ring: mean, whiskers: last value within 1.5 box lengths; a plus: "
            "beyond the training range. As the paper's Figure 5: blurred blue, RL red, the network green.",
            RX_FIGURE_CHART);
        rx_plot_boxes(dst, &axes, &(rx_boxes){(int)nbins, s->ncolumns, groups, s->column, colors, box});
    }
    free(box);
    free(label);
    free(groups);
}

/* Mean differences of every pair of the page with their t intervals. */
static void plot_differences(rx_figures *dst, const rx_store *s, int g, int quality)
{
    const int nbins = s->group[g].nconditions;
    rx_axes axes = {.xlabel = axis_of(g),
                    .ylabel = quality == RX_PSNR ? "difference of PSNR (dB)" : "difference of SSIM"};
    rx_curves curves = {0};
    double limit = NAN; /* upper end of the last bin inside the training range */
    char id[RX_FIGURE_ID], title[80], name[RX_PAIRS_MAX][2 * RX_METHOD_NAME + 4];
    axes.x0 = centre(drawn(s, g, 0)) - 0.7;
    axes.x1 = centre(drawn(s, g, nbins - 1)) + 0.7;
    for (int p = 0; p < s->npairs; p++) {
        const char *first = s->column[s->pair[p][0]];
        snprintf(name[p], sizeof *name, "%s - %s", first, s->column[s->pair[p][1]]);
        rx_curves_add(&curves, RX_CURVE_BARS, rx_method_color(first), name[p]);
        for (int k = 0; k < p && !curves.failed; k++) /* the first duel of a method is drawn through */
            curves.curve[p].dashed |= s->pair[k][0] == s->pair[p][0];
        for (int c = 0; c < nbins; c++) {
            const rx_estimate *d = &rx_contest_of(s, g, p, RX_TESTS * quality, c)->test.difference;
            rx_curves_put(&curves, centre(drawn(s, g, c)) + 0.08 * (p - 0.5 * (s->npairs - 1)), d->value,
                          d->low, d->high);
            if (isfinite(d->value) && isfinite(d->low) && isfinite(d->high)) {
                axes.y0 = fmin(axes.y0, d->low);
                axes.y1 = fmax(axes.y1, d->high);
            }
        }
    }
    const double margin = 0.05 * (axes.y1 - axes.y0) + 1e-3;
    axes.y0 -= margin;
    axes.y1 += margin;
    for (int c = 0; c < nbins; c++)
        limit = rx_bin_is_beyond(s, g, c) ? limit : drawn(s, g, c)->high;
    rx_curves_add(&curves, RX_CURVE_LINE, -1, NULL);
    rx_curves_put(&curves, axes.x0, 0, NAN, NAN);
    rx_curves_put(&curves, axes.x1, 0, NAN, NAN);
    if (limit > axes.x0 && limit < axes.x1) {
        rx_curves_add(&curves, RX_CURVE_LINE, -1, NULL);
        rx_curves_put(&curves, limit, axes.y0, NAN, NAN);
        rx_curves_put(&curves, limit, axes.y1, NAN, NAN);
    }
    snprintf(id, sizeof id, "%.5s-difference-%.8s", IDS[g], QUALITIES[quality].name);
    snprintf(title, sizeof title, "Mean difference of %s by %s", UPPER[quality], KINDS[g]);
    rx_curves_figure(
        dst, id, title,
        "On the same scenes, with 95 % t intervals: above zero the first of the two is better. Right of the "
        "upright line: beyond the training range.",
        &axes, &curves);
}

/* The middle of a plane, SHOWN_SIDE pixels at most; the same grey scale for all: noise shows as noise, and faint parts are
 * seen. */
static void plot_plane(rx_figures *dst, const rx_lab *lab, int example, const char *title, const float *plane)
{
    const int side = lab->config->scene_side, shown = side < SHOWN_SIDE ? side : SHOWN_SIDE,
              from = (side - shown) / 2;
    const double peak = lab->config->scene_peak;
    float *pixels = RX_NEW(float, (size_t)shown *(size_t)shown);
    char id[RX_FIGURE_ID];
    dst->script.failed |= pixels == NULL;
    if (pixels == NULL || dst->n == RX_FIGURES_MAX) {
        free(pixels);
        return;
    }
    for (int i = 0; i < shown * shown; i++)
        pixels[i] = plane[(size_t)(from + i / shown) * (size_t)side + (size_t)(from + i % shown)];
    snprintf(id, sizeof id, "example%d-%.12s", example, title);
    rx_figure_add(dst, id, title, "", RX_FIGURE_PICTURE);
    rx_plot_picture(
        dst, &(rx_grey_image){shown, shown, PICTURE_WIDTH, pixels, -0.06 * peak, 0.7 * peak, 0.06 * peak});
    free(pixels);
}

/* The first scene of a bin through all methods. */
static rx_status add_example(rx_report *report, const rx_lab *lab, int example, int bin, rx_error *err)
{
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    const rx_lab_unit unit = {bin, TEST, 0};
    rx_figures *figures = rx_report_figures_of(report);
    rx_trial trial;
    char text[96];
    RX_TRY(rx_trial_make(lab, &unit, &trial, err));
    float *plane = RX_NEW(float, n);
    rx_status status = plane == NULL ? rx_error_memory(err, n * sizeof *plane) : RX_OK;
    snprintf(text, sizeof text, "FWHM %.2f pixels, noise %.1f", trial.fwhm, trial.sigma);
    rx_report_heading(report, text, NULL);
    plot_plane(figures, lab, example, "BLURRED", trial.image);
    for (int m = 0; status == RX_OK && m < lab->nruns; m++) {
        if (strcmp(lab->run[m].name, "BLURRED") == 0)
            continue;
        status =
            rx_restoration_picture(lab, &(rx_picture){bin, &trial, &lab->run[m], 0, lab->values}, plane, err);
        if (status == RX_OK)
            plot_plane(figures, lab, example, lab->run[m].name, plane);
    }
    plot_plane(figures, lab, example, "SHARP", trial.sharp);
    snprintf(text, sizeof text, "example%d-", example);
    rx_report_place(report, text);
    free(plane);
    rx_trial_free(&trial);
    return status;
}

/* --- page --- */

static const rx_report_column BINS[] = {
    {.name = "scene", .help = "binned quantity"},
    {.name = "condition", .help = "middle of the bin"},
    {"low", RX_REPORT_NUMBER, 2, "", "", NULL},
    {"high", RX_REPORT_NUMBER, 2, "", "", NULL},
    {"other_low", RX_REPORT_NUMBER, 2, "", "range of the other quantity", NULL},
    {"other_high", RX_REPORT_NUMBER, 2, "", "range of the other quantity", NULL},
    {"scenes", RX_REPORT_COUNT, 0, "", "", NULL},
    {"level_low", RX_REPORT_NUMBER, 3, "", "noise level on the scale of models", NULL},
    {"level_median", RX_REPORT_NUMBER, 3, "", "", NULL},
    {"level_high", RX_REPORT_NUMBER, 3, "", "", NULL},
    {"inside_training", RX_REPORT_COUNT, 0, "", "1: seeing and median noise level are inside the training",
     NULL},
    {"fainter_than_fields", RX_REPORT_COUNT, 0, "", "1: that level is above those of all whole fields of it",
     NULL},
};

static const rx_report_column BOXES[] = {
    {.name = "scene"},
    {.name = "condition"},
    {.name = "run"},
    {.name = "quantity"},
    {"low", RX_REPORT_NUMBER, 3, "", "last value within 1.5 box lengths", NULL},
    {"q1", RX_REPORT_NUMBER, 3, "", "quartile", NULL},
    {"median", RX_REPORT_NUMBER, 3, "", "", NULL},
    {"q3", RX_REPORT_NUMBER, 3, "", "quartile", NULL},
    {"high", RX_REPORT_NUMBER, 3, "", "", NULL},
    {"outliers", RX_REPORT_COUNT, 0, "", "", NULL},
};

static const rx_report_column SCENES[] = {
    {.name = "scene"},
    {.name = "condition"},
    {"number", RX_REPORT_COUNT, 0, "", "from 1 in each bin", NULL},
    {"fwhm", RX_REPORT_NUMBER, 2, "pix", "of the PSF", NULL},
    {"sigma", RX_REPORT_NUMBER, 2, "adu", "of the noise", NULL},
    {"noise_level", RX_REPORT_NUMBER, 3, "", "the noise on the scale of models", NULL},
    {.name = "run"},
    {"psnr", RX_REPORT_NUMBER, 2, "dB", "with the settings for PSNR", NULL},
    {"ssim", RX_REPORT_NUMBER, 4, "", "with the settings for SSIM", NULL},
};

static const rx_report_column PAPER[] = {
    {"table", RX_REPORT_COUNT, 0, "", "of the paper", NULL},
    {.name = "scene"},
    {.name = "quantity"},
    {"bin", RX_REPORT_NUMBER, 0, "", "", NULL},
    {"dof", RX_REPORT_NUMBER, 0, "", "degrees of freedom that give its p", NULL},
    {"paper_t", RX_REPORT_NUMBER, 2, "", "printed: its network against Richardson-Lucy", NULL},
    {"paper_p", RX_REPORT_P, 0, "", "printed", NULL},
    {"p_from_t", RX_REPORT_P, 0, "", "that follows from the printed t", NULL},
    {"fits", RX_REPORT_COUNT, 0, "", "1: within what rounding allows", NULL},
    {"t", RX_REPORT_NUMBER, 2, "", "here, two samples as in the paper", NULL},
    {"p", RX_REPORT_P, 0, "", "here", NULL},
    {"paired_t", RX_REPORT_NUMBER, 2, "", "here, on the same scenes: the fitting test", NULL},
};

/* Choices of tuning, two for each tuned method and bin, and how many of them lie at an end of what was tried. */
static void count_ends(const rx_lab *lab, int *ends, int *choices)
{
    *ends = *choices = 0;
    for (int i = 0; i < 2 * lab->nconditions * lab->nruns; i++) {
        *choices += lab->tuned[i / 2][i % 2].setting[0] != '\0';
        *ends += lab->tuned[i / 2][i % 2].at_end;
    }
}

static void facts(const rx_store *s, rx_report *report)
{
    const rx_lab *lab = s->lab;
    int ends, choices;
    count_ends(lab, &ends, &choices);
    rx_report_fact_number(report, "scene_side", lab->config->scene_side);
    rx_report_fact_number(report, "peak", lab->config->scene_peak);
    rx_report_fact_number(report, "sharp_fwhm", lab->sky[0].simulation->sharp_fwhm);
    rx_report_fact_numbers(report, "fwhm_trained", 2, lab->fwhm_trained);
    rx_report_fact_numbers(report, "noise_level_trained", 2, lab->level_trained);
    rx_report_fact_number(report, "tune_scenes", lab->tunes ? lab->config->tune_scenes : 0);
    rx_report_fact_number(report, "tune_choices", choices);
    rx_report_fact_number(report, "tune_choices_at_end", ends);
}

/* Bins and scenes as tables; where they lie beside the training is said. */
static void add_bins(rx_report *report, const rx_store *s)
{
    const rx_lab *lab = s->lab;
    rx_report_table *bins = rx_report_table_add(report, "bins", LENGTH(BINS), BINS, RX_REPORT_EVERYWHERE);
    rx_report_table *boxes = rx_report_table_add(report, "boxes", LENGTH(BOXES), BOXES, RX_REPORT_EVERYWHERE);
    rx_report_table *scenes =
        rx_report_table_add(report, "scenes", LENGTH(SCENES), SCENES, RX_REPORT_IN_FILE);
    double low = INFINITY, high = 0;
    long all = 0, inside = 0, fields = 0;
    rx_text html = {0};
    for (int g = 0; g < 2; g++)
        for (int i = 0; i < RX_QUALITIES * s->group[g].nconditions * s->ncolumns; i++) {
            const int k = i % s->ncolumns, c = i / s->ncolumns % s->group[g].nconditions,
                      q = i / s->ncolumns / s->group[g].nconditions;
            const rx_five_numbers *box = &rx_restoration_bin_of(s, g, c)->box[q][k];
            rx_report_row(boxes,
                          (rx_cell[]){rx_cell_words(KINDS[g]), rx_cell_words(s->group[g].condition[c]),
                                      rx_cell_words(s->column[k]), rx_cell_words(QUALITIES[q].name),
                                      rx_cell_number(box->low), rx_cell_number(box->q1),
                                      rx_cell_number(box->median), rx_cell_number(box->q3),
                                      rx_cell_number(box->high), rx_cell_number((double)box->outliers)});
        }
    for (int b = 0; b < lab->nconditions; b++) {
        const int g = lab->bin[b].by_sigma, c = b - g * s->group[0].nconditions;
        const rx_restoration_bin *own = rx_restoration_bin_of(s, g, c);
        const rx_lab_bin *bin = &lab->bin[b];
        const rx_lab_table *scene = scenes_of(s, g, c);
        const char *name = s->group[g].condition[c];
        low = fmin(low, own->level.median);
        high = fmax(high, own->level.median);
        rx_report_row(bins, (rx_cell[]){rx_cell_words(KINDS[g]), rx_cell_words(name),
                                        rx_cell_number(bin->low), rx_cell_number(bin->high),
                                        rx_cell_number(bin->other_low), rx_cell_number(bin->other_high),
                                        rx_cell_number((double)scene->n), rx_cell_number(own->level.low),
                                        rx_cell_number(own->level.median), rx_cell_number(own->level.high),
                                        rx_cell_number(own->inside), rx_cell_number(own->fainter)});
        for (long i = 0; i < scene->n; i++, all++) {
            const double *v = rx_lab_own(scene, i);
            const int in = v[RX_SCENE_FWHM] >= lab->fwhm_trained[0] &&
                           v[RX_SCENE_FWHM] <= lab->fwhm_trained[1] &&
                           v[RX_SCENE_LEVEL] >= lab->level_trained[0];
            inside += in;
            fields += in && v[RX_SCENE_LEVEL] <= lab->level_trained[1];
            for (int k = 0; k < lab->nruns; k++)
                rx_report_row(scenes,
                              (rx_cell[]){rx_cell_words(KINDS[g]), rx_cell_words(name),
                                          rx_cell_number((double)i + 1), rx_cell_number(v[RX_SCENE_FWHM]),
                                          rx_cell_number(v[RX_SCENE_SIGMA]),
                                          rx_cell_number(v[RX_SCENE_LEVEL]), rx_cell_words(s->column[k]),
                                          rx_cell_number(rx_lab_each(scene, i, k)[RX_SCORE_PSNR]),
                                          rx_cell_number(rx_lab_each(scene, i, k)[RX_SCORE_SSIM])});
        }
    }
    if (all > 0)
        rx_text_printf(
            &html,
            "Models know noise on another scale, the noise level: 255 times the noise over what the "
            "brightest 0.1 %% of the blurred scene exceed (at least 1/40 of its brightest pixel). On it the "
            "medians of the bins go from %.3g to %.3g. ",
            low, high);
    if (all > 0 && lab->level_trained[1] > 0)
        rx_text_printf(
            &html,
            "The network was trained on fields of FWHM %.3g to %.3g pixels and levels of %.3g to %.3g, whose "
            "patches go down to empty sky: %ld of %ld scenes are inside the training, %ld of them at levels "
            "of whole fields of it.",
            lab->fwhm_trained[0], lab->fwhm_trained[1], lab->level_trained[0], lab->level_trained[1], inside,
            all, fields);
    rx_report_sentence(report, html.data);
    rx_text_free(&html);
}

static void add_words(rx_report *report, const rx_store *s)
{
    rx_text words = {0};
    rx_report_section(report, "words", "Which is better where");
    for (int p = 0; p < s->npairs; p++) {
        const size_t before = words.length;
        rx_restoration_words(&words, s, p);
        rx_report_sentence(report, words.data != NULL ? words.data + before : "");
        if (p == 1 || p + 1 == s->npairs)
            rx_text_printf(rx_report_brief_of(report), "%s\n", words.data != NULL && p < 2 ? words.data : "");
    }
    rx_report_brief_of(report)->failed |= words.failed;
    rx_text_free(&words);
    rx_report_note(
        report, "Above and below: Student's t of the differences on the same scenes, p adjusted by Holm for "
                "the number of bins, below 0.05.");
}

/* The printed numbers of the paper beside ours. */
static void add_paper(rx_report *report, const rx_store *s)
{
    const rx_contest none = rx_contest_none();
    rx_report_table *t = rx_report_table_add(report, "paper", LENGTH(PAPER), PAPER, RX_REPORT_IN_JSON);
    for (const rx_paper_table *table = rx_paper_tables; table < rx_paper_tables + RX_PAPER_TABLES; table++)
        for (int k = 0; k < table->n; k++) {
            const int chief = s->npairs > 0 ? 0 : -1;
            const rx_contest *two = paper_contest(s, table, k, chief, RX_BY_TWO_SAMPLES),
                             *paired = paper_contest(s, table, k, chief, RX_BY_PAIRED);
            const rx_test *test = two != NULL ? &two->test : &none.test;
            double p, ln_p;
            const int fits = rx_paper_column_fits(table, k, &p, &ln_p);
            rx_report_row(t,
                          (rx_cell[]){rx_cell_number(table->number), rx_cell_words(KINDS[table->by_sigma]),
                                      rx_cell_words(table->ssim ? "ssim" : "psnr"),
                                      rx_cell_number(table->bin[k]), rx_cell_number(table->dof),
                                      rx_cell_number(table->t[k]), rx_cell_p(table->p[k], log(table->p[k])),
                                      rx_cell_p(p, ln_p), rx_cell_number(fits),
                                      rx_cell_number(test->statistic), rx_cell_p(test->p, test->ln_p),
                                      rx_cell_number(paired != NULL ? paired->test.statistic : NAN)});
        }
    rx_report_section(report, "paper", "Beside the paper's Tables 1 to 4");
    if (s->npairs > 0 && net_against(s, "RL") != 0) {
        rx_text words = {0};
        rx_text_printf(&words,
                       "The two sides compare different things: the paper's columns are NET against RL; NET "
                       "did not take part here, so ours are %s against %s.",
                       s->column[s->pair[0][0]], s->column[s->pair[0][1]]);
        rx_report_sentence(report, words.data);
        rx_text_free(&words);
    }
    rx_report_show(report, t, &(rx_report_view){.to = rx_report_rows(t)});
}

static const char READING[] = "Simulated scenes are blurred by a Moffat PSF (integrated over the pixel), get "
                              "Gaussian noise, and are restored by every method; the reference is the scene "
                              "without noise at the target PSF. Noise and PSNR are on the scale of its "
                              "brightest pixel. RL knows the true PSF; its number of iterations and the "
                              "Gaussian filter after it are the best of those tried (TUNE_NITER, "
                              "TUNE_FILTER), bin by bin, on further scenes that are not in the test, once "
                              "for PSNR and once for SSIM. SMOOTHED is the blurred image through such a "
                              "filter, tuned as well, and nothing else: what RL gains over it is gained by "
                              "deconvolution. RL_FLAT is RL with all below a threshold, tuned too, set to "
                              "the sky. <b>PSNR</b> = 20 log<sub>10</sub>(max(reference) / &radic;MSE) in "
                              "dB, MSE the mean of the squared differences (the paper prints it without the "
                              "square). <b>SSIM</b>: Wang et al. 2004, 11 x 11 Gaussian window of sigma 1.5, "
                              "K1 = K2 = 0.001 as in the paper, range of the reference. With so small K the "
                              "noise of empty sky weighs heavily in it, which favours smooth pictures. Both "
                              "are better when larger. Bootstrap intervals: 1000 draws, none for fewer than "
                              "20 scenes. The paired test takes out what the scenes differ in, the "
                              "two-sample test, which is the paper's, does not. scenes.ecsv holds every "
                              "scene, bins.ecsv the bins.";
_Static_assert(RX_BOOTSTRAP_ROUNDS == 1000 && RX_BOOTSTRAP_FEWEST == 20, "the reading says so");

static rx_status page(const rx_store *s, rx_findings *f, rx_error *err)
{
    const rx_lab *lab = s->lab;
    rx_report *report = f->report;
    rx_figures *figures = rx_report_figures_of(report);
    const int n = lab->config->examples < lab->nconditions ? lab->config->examples : lab->nconditions;
    int ends, choices;
    char prefix[16], text[160];
    for (int g = 0; g < 2; g++) {
        if (s->group[g].nconditions == 0)
            continue;
        for (int q = 0; q < RX_QUALITIES; q++) {
            plot_boxes(figures, s, g, q);
            plot_differences(figures, s, g, q);
        }
        snprintf(prefix, sizeof prefix, "%s-", IDS[g]);
        rx_report_section(report, KINDS[g], g == 1 ? "By noise" : "By FWHM");
        rx_report_place(report, prefix);
        rx_findings_quantities(f, s, g, RX_QUALITIES);
        rx_findings_contests(f, s, g, "scenes");
    }
    if (n > 0)
        rx_report_section(report, "examples", "Examples");
    for (int e = 0; e < n; e++) /* the first scenes of bins evenly apart */
        RX_TRY(add_example(report, lab, e, (2 * e + 1) * lab->nconditions / (2 * n), err));
    if (n > 0)
        rx_report_note(
            report,
            "The middle of the scene, the same grey scale for all pictures: asinh(p / 6 %) of the peak, "
            "black at &minus;6 %, white at 70 % of it.");
    add_words(report, s);
    add_paper(report, s);
    rx_report_section(report, "reading", "How to read this");
    rx_report_paragraph(report, READING);
    add_bins(report, s);
    count_ends(lab, &ends, &choices);
    if (ends > 0) {
        snprintf(text, sizeof text,
                 "Tuning took an end of what was tried in %d of %d choices; longer TUNE_NITER or TUNE_FILTER "
                 "may serve the tuned methods better (cells.ecsv).",
                 ends, choices);
        rx_report_sentence(report, text);
        rx_text_printf(rx_report_brief_of(report), "%s\n", text);
    }
    return RX_OK;
}

const rx_lab_results rx_restoration_results = {measure, facts, LENGTH(JUDGES), JUDGES, page};
