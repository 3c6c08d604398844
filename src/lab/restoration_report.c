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

enum { TEST = 1 }; /* of the scenes of a bin; 0: those that methods are tuned on */
static const double LEVEL = 0.95;
static const char *const KINDS[] = {"FWHM", "noise"}, *const IDS[] = {"fwhm", "sigma"},
                         *const AXES[] = {"FWHM (pixels)", "noise sigma (peak 255)"},
                         *const UPPER[] = {"PSNR", "SSIM"};
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

/* Box and mean of n values. */
static rx_status summarise(long n, const double *values, const double *zero, rx_five_numbers *box,
                           rx_estimate *mean, rx_error *err)
{
    rx_test test = rx_contest_none().test;
    *box = (rx_five_numbers){NAN, NAN, NAN, NAN, NAN, 0, 0, NAN};
    if (n > 0)
        RX_TRY(rx_five_numbers_of(n, values, box, err));
    if (rx_has_spread(n, values, zero))
        RX_TRY(rx_test_paired(n, values, zero, &test, err));
    *mean = (rx_estimate){box->mean, test.difference.low, test.difference.high, n};
    return RX_OK;
}

/* A test that cannot be made (fewer than 2 scenes, or no spread at all) is none. */
static rx_status compare(rx_contest *const dst[RX_TESTS], long n, double *const v[3], uint64_t seed,
                         rx_error *err)
{
    if (!rx_has_spread(n, v[0], v[1]) || !rx_has_spread(n, v[0], v[2])) {
        dst[RX_BY_BOOTSTRAP]->test.difference.n = n;
        return RX_OK;
    }
    RX_TRY(rx_contest_paired(n, v[0], v[1], dst[RX_BY_PAIRED], dst[RX_BY_WILCOXON], err));
    RX_TRY(rx_test_two_sample(n, v[0], n, v[1], &dst[RX_BY_TWO_SAMPLES]->test, err));
    dst[RX_BY_TWO_SAMPLES]->test.difference = rx_contest_none().test.difference;
    return rx_paired_bootstrap(n, v[0], v[1], LEVEL, seed, &dst[RX_BY_BOOTSTRAP]->test.difference, err);
}

/* A quality of two runs on the scenes where both have one. */
static long gather(const rx_lab_table *scene, int quality, const int run[2], double *const v[3])
{
    long n = 0;
    for (long i = 0; i < scene->n; i++) {
        for (int k = 0; k < 2; k++)
            v[k][n] = rx_lab_each(scene, i, run[k])[RX_SCORE_PSNR + quality];
        n += isfinite(v[0][n]) && isfinite(v[1][n]);
    }
    return n;
}

static int is_between(double value, const double range[2])
{
    return range[1] > range[0] && value >= range[0] && value <= range[1];
}

/* v: room for a value of each scene, three times; the last one zeros. */
static rx_status measure_bin(rx_store *s, int g, int c, double *const v[3], rx_error *err)
{
    const rx_lab *lab = s->lab;
    const rx_lab_bin *bin = drawn(s, g, c);
    const rx_lab_table *scene = scenes_of(s, g, c);
    rx_restoration_bin *own = rx_restoration_bin_of(s, g, c);
    rx_estimate unused;
    RX_TRY(rx_interrupt_check(err));
    for (long i = 0; i < scene->n; i++)
        v[0][i] = rx_lab_own(scene, i)[RX_SCENE_LEVEL];
    RX_TRY(summarise(scene->n, v[0], v[2], &own->level, &unused, err));
    own->inside =
        is_between(g == 1 ? 0.5 * (bin->other_low + bin->other_high) : centre(bin), lab->fwhm_trained) &&
        !(own->level.median < lab->level_trained[0]);
    own->fainter = lab->level_trained[1] > 0.0 && own->level.median > lab->level_trained[1];
    for (int q = 0; q < RX_QUALITIES; q++) {
        for (int k = 0; k < lab->nruns; k++) {
            rx_finding *dst = rx_store_at(s, g, q, c, k);
            dst->setting = lab->tuned[number_of(s, g, c) * lab->nruns + k][q].setting;
            RX_TRY(
                summarise(gather(scene, q, (int[]){k, k}, v), v[0], v[2], &own->box[q][k], &dst->value, err));
        }
        for (int p = 0; p < s->npairs; p++) {
            rx_contest *dst[RX_TESTS];
            for (int t = 0; t < RX_TESTS; t++)
                dst[t] = rx_contest_of(s, g, p, RX_TESTS * q + t, c);
            RX_TRY(compare(dst, gather(scene, q, s->pair[p], v), v, s->seed, err));
        }
    }
    return RX_OK;
}

/* Every method against RL, but RL first against what a filter alone does: the untouched image is beaten by any suppression
 * of noise. Then everything against that image. */
static void add_pairs(rx_store *s)
{
    static const char *const first[][2] = {{"NET", "RL"},      {"NET", "RL_FLAT"}, {"NET_FLAT", "RL_FLAT"},
                                           {"RL", "SMOOTHED"}, {"RL", "BLURRED"},  {"NET", "SMOOTHED"}};
    const int blurred = rx_store_column(s, "BLURRED"), smoothed = rx_store_column(s, "SMOOTHED");
    for (size_t i = 0; i < sizeof first / sizeof *first; i++)
        rx_store_add_pair(s, rx_store_column(s, first[i][0]), rx_store_column(s, first[i][1]));
    for (int i = 0; i < s->ncolumns; i++)
        if (i != blurred && i != smoothed)
            rx_store_add_pair(s, i, rx_store_column(s, "RL"));
    for (int i = 0; i < s->ncolumns; i++)
        rx_store_add_pair(s, i, blurred);
}

static rx_status measure(rx_store *s, rx_error *err)
{
    static const rx_about tests[RX_TESTS] = {
        {"", "paired t", 1, 1}, {"", "Wilcoxon", 1, 0}, {"", "two samples", 0, 0}, {"", "bootstrap", 0, 0}};
    const rx_lab *lab = s->lab;
    int nbins[2] = {0};
    size_t room = 1;
    RX_TRY(rx_store_groups(s, 2, err));
    add_pairs(s);
    for (int i = 0; i < RX_QUALITIES * RX_TESTS; i++) {
        s->about[s->nabouts] = tests[i % RX_TESTS];
        memcpy(s->about[s->nabouts++].quantity, QUALITIES[i / RX_TESTS].name, sizeof QUALITIES->name);
    }
    for (int b = 0; b < lab->nconditions; b++) {
        nbins[lab->bin[b].by_sigma]++;
        room += (size_t)rx_lab_set_of(lab, b, TEST)->table[RX_RESTORATION_SCENE].n;
    }
    double *work = RX_NEW(double, 3 * room);
    s->own[0] = RX_NEW(rx_restoration_bin, (size_t)lab->nconditions);
    rx_status status =
        s->own[0] == NULL || work == NULL ? rx_error_memory(err, 3 * room * sizeof *work) : RX_OK;
    for (int g = 0; g < 2 && status == RX_OK; g++) {
        s->group[g].name = KINDS[g];
        s->group[g].nquantities = RX_QUALITIES;
        memcpy(s->group[g].quantity, QUALITIES, sizeof QUALITIES);
        status = rx_group_open(s, g, nbins[g], err);
        for (int c = 0; c < nbins[g] && status == RX_OK; c++) {
            snprintf(s->group[g].condition[c], sizeof *s->group[g].condition, "%g", centre(drawn(s, g, c)));
            status = measure_bin(s, g, c, (double *[]){work, work + room, work + 2 * room}, err);
        }
    }
    free(work);
    return status;
}

/* --- claims --- */

/* Bins that a claim is about. */
enum { ANYWHERE, INSIDE, BEYOND };
static int is_in(const rx_store *s, int group, int condition, int where)
{
    return where == ANYWHERE || (where == INSIDE ? rx_restoration_bin_of(s, group, condition)->inside
                                                 : rx_bin_is_beyond(s, group, condition));
}

/* NET wins in every bin there, by both qualities; group -1: both. */
static int net_wins(const rx_store *s, const char *rival, int group, int where, rx_text *said)
{
    const int net = rx_store_column(s, "NET"), other = rx_store_column(s, rival);
    return rx_contests_won(s, &(rx_contest_place){group, 0, s->nabouts - 1, is_in, where}, net, other, 1,
                           said);
}

static void judge_every_bin(const rx_store *s, rx_claim_verdict *v)
{
    v->state = rx_claim_state_of(net_wins(s, "RL", -1, ANYWHERE, &v->said) > 0);
}

/* The test of NET and RL in the bin of a printed column; NULL: there is none. */
static const rx_contest *paper_contest(const rx_store *s, const rx_paper_table *table, int column, int pair,
                                       int test)
{
    for (int c = 0; c < s->group[table->by_sigma].nconditions && pair >= 0; c++)
        if (fabs(centre(drawn(s, table->by_sigma, c)) - table->bin[column]) < 0.25)
            return rx_contest_of(s, table->by_sigma, pair,
                                 RX_TESTS * (table->ssim ? RX_SSIM : RX_PSNR) + test, c);
    return NULL;
}

static void judge_all_p(const rx_store *s, rx_claim_verdict *v)
{
    const int pair = rx_store_pair(s, rx_store_column(s, "NET"), rx_store_column(s, "RL"));
    int below = 0, tested = 0;
    for (const rx_paper_table *table = rx_paper_tables; table < rx_paper_tables + RX_PAPER_TABLES; table++)
        for (int k = 0; k < table->n; k++) {
            const rx_contest *c = paper_contest(s, table, k, pair, RX_BY_TWO_SAMPLES);
            tested += c != NULL;
            below += c != NULL && c->test.p < 0.05;
        }
    v->state = rx_claim_state_of(tested > 0 && below == tested);
    rx_text_printf(&v->said, "p below 0.05 in %d of the %d printed columns that have a bin here.", below,
                   tested);
}

/* Mean PSNR of the first noise bin less that of the last. */
static double fall_with_noise(const rx_store *s, const char *column)
{
    const int n = s->group[1].nconditions;
    return n == 0 ? NAN
                  : rx_store_value(s, 1, "psnr", 0, rx_store_column(s, column)).value -
                        rx_store_value(s, 1, "psnr", n - 1, rx_store_column(s, column)).value;
}

static void judge_noise(const rx_store *s, rx_claim_verdict *v)
{
    const double net = fall_with_noise(s, "NET"), rl = fall_with_noise(s, "RL");
    v->state = rx_claim_state_of(net_wins(s, "RL", 1, ANYWHERE, &v->said) > 0 && net < rl);
    rx_text_printf(&v->said, "PSNR falls by %.2f dB (NET) and %.2f dB (RL).", net, rl);
}

static void judge_range(const rx_store *s, rx_claim_verdict *v)
{
    const int where = v->claim == RX_CLAIM_INSIDE ? INSIDE : BEYOND;
    const int blurred = net_wins(s, "BLURRED", -1, where, &v->said);
    v->state =
        rx_claim_state_of(blurred > 0 && (where == INSIDE || net_wins(s, "RL", -1, where, &v->said) != 0));
}

/* Above the rival beyond doubt inside the training, and in most bins that are not. */
static void judge_goal(const rx_store *s, rx_claim_verdict *v)
{
    const double beyond_doubt = 0.001;
    const char *rival = v->claim == RX_CLAIM_ABOVE_RL ? "RL" : "RL_FLAT";
    const int pair = rx_store_pair(s, rx_store_column(s, "NET"), rx_store_column(s, rival));
    int sure = 0, inside = 0, wins = 0, beyond = 0;
    for (int g = 0; g < 2; g++)
        for (int i = 0; i < RX_QUALITIES * s->group[g].nconditions; i++) {
            const rx_contest *c = rx_contest_of(s, g, pair, RX_TESTS * (i % RX_QUALITIES), i / RX_QUALITIES);
            const int in = rx_restoration_bin_of(s, g, i / RX_QUALITIES)->inside;
            inside += in;
            beyond += !in;
            sure += in && c->winner > 0 && c->holm < beyond_doubt;
            wins += !in && c->winner > 0;
        }
    if (inside + beyond == 0)
        return;
    v->state = rx_claim_state_of(sure == inside && (beyond == 0 || 2 * wins > beyond));
    rx_text_printf(&v->said,
                   "p below %g in %d of %d bins inside the training, above in %d of %d outside of it. ",
                   beyond_doubt, sure, inside, wins, beyond);
    net_wins(s, rival, -1, ANYWHERE, &v->said);
}

static const rx_claim_judge JUDGES[] = {{RX_CLAIM_EVERY_BIN, 0, judge_every_bin, {"NET", "RL"}},
                                        {RX_CLAIM_ALL_P, 0, judge_all_p, {"NET", "RL"}},
                                        {RX_CLAIM_NOISE, 0, judge_noise, {"NET", "RL"}},
                                        {RX_CLAIM_INSIDE, RX_CLAIM_BEYOND, judge_range, {"NET", "BLURRED"}},
                                        {RX_CLAIM_SPEED, RX_CLAIM_NO_FAKES, NULL, {NULL}},
                                        {RX_CLAIM_ABOVE_RL, 0, judge_goal, {"NET", "RL"}},
                                        {RX_CLAIM_ABOVE_FLAT, 0, judge_goal, {"NET", "RL_FLAT"}}};

/* --- figures --- */

enum { SHOWN_SIDE = 128, PICTURE_WIDTH = 200 };

/* One box per method and bin, as the paper's figure. */
static void plot_boxes(rx_figures *dst, const rx_store *s, int g, int quality)
{
    const size_t nbins = (size_t)s->group[g].nconditions, nmethods = (size_t)s->ncolumns;
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
    rx_figure_add(dst, id, title,
                  "Box: quartiles, bar: median, ring: mean, whiskers: last value within 1.5 box lengths; a "
                  "plus: beyond "
                  "the training range. As the paper's Figure 5: blurred blue, RL red, the network green.",
                  RX_FIGURE_CHART);
    if (!dst->script.failed)
        rx_plot_boxes(dst, &(rx_axes){.xlabel = AXES[g], .ylabel = quality == RX_PSNR ? "PSNR (dB)" : "SSIM"},
                      &(rx_boxes){(int)nbins, s->ncolumns, groups, s->column, colors, box});
    free(box);
    free(label);
    free(groups);
}

/* Mean differences of every pair of the page with their t intervals. */
static void plot_differences(rx_figures *dst, const rx_store *s, int g, int quality)
{
    const int nbins = s->group[g].nconditions;
    const rx_axes axes = {.xlabel = AXES[g],
                          .ylabel = quality == RX_PSNR ? "difference of PSNR (dB)" : "difference of SSIM",
                          .x0 = centre(drawn(s, g, 0)) - 0.7,
                          .x1 = centre(drawn(s, g, nbins - 1)) + 0.7};
    rx_curves curves = {0};
    char id[RX_FIGURE_ID], title[80], name[RX_PAIRS_MAX][2 * RX_METHOD_NAME + 4];
    for (int p = 0; p < s->npairs; p++) {
        const char *first = s->column[s->pair[p][0]];
        snprintf(name[p], sizeof *name, "%s - %s", first, s->column[s->pair[p][1]]);
        rx_curves_add(&curves, RX_CURVE_BARS, rx_method_color(first), name[p]);
        for (int c = 0; c < nbins; c++) {
            const rx_estimate *d = &rx_contest_of(s, g, p, RX_TESTS * quality, c)->test.difference;
            rx_curves_put(&curves, centre(drawn(s, g, c)) + 0.08 * (p - 0.5 * (s->npairs - 1)), d->value,
                          d->low, d->high);
        }
    }
    rx_curves_reference(&curves, axes.x0, 0, axes.x1, 0);
    snprintf(id, sizeof id, "%.5s-difference-%.8s", IDS[g], QUALITIES[quality].name);
    snprintf(title, sizeof title, "Mean difference of %s by %s", UPPER[quality], KINDS[g]);
    rx_curves_figure(dst, id, title,
                     "On the same scenes, with 95 % t intervals: above zero the first of the two is better.",
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
    for (int i = 0; i < shown * shown && pixels != NULL; i++)
        pixels[i] = plane[(size_t)(from + i / shown) * (size_t)side + (size_t)(from + i % shown)];
    snprintf(id, sizeof id, "example%d-%.12s", example, title);
    if (pixels != NULL && dst->n < RX_FIGURES_MAX) {
        rx_figure_add(dst, id, title, "", RX_FIGURE_PICTURE);
        rx_plot_picture(dst, &(rx_grey_image){shown, shown, PICTURE_WIDTH, pixels, -0.06 * peak, 0.7 * peak,
                                              0.06 * peak});
    }
    free(pixels);
}

/* The first scene of a bin through all methods. */
static rx_status add_example(rx_report *report, const rx_lab *lab, int example, int bin, rx_error *err)
{
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    rx_figures *figures = rx_report_figures_of(report);
    rx_trial trial;
    char text[96];
    RX_TRY(rx_trial_make(lab, &(rx_lab_unit){bin, TEST, 0}, &trial, err));
    float *plane = NULL;
    rx_status status = RX_MAKE(plane, n, err);
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

RX_COLUMNS(BINS, RX_TEXT("scene", "binned quantity"), RX_TEXT("condition", "middle of the bin"),
           RX_NUMBER("low", 2, "", ""), RX_NUMBER("high", 2, "", ""),
           RX_NUMBER("other_low", 2, "", "range of the other quantity"),
           RX_NUMBER("other_high", 2, "", "range of the other quantity"), RX_COUNT("scenes", ""),
           RX_NUMBER("level_low", 3, "", "noise level on the scale of models"),
           RX_NUMBER("level_median", 3, "", ""), RX_NUMBER("level_high", 3, "", ""),
           RX_COUNT("inside_training", "1: seeing and median noise level are inside the training"),
           RX_COUNT("fainter_than_fields", "1: that level is above those of all whole fields of it"));

RX_COLUMNS(BOXES, RX_TEXT("scene", ""), RX_TEXT("condition", ""), RX_TEXT("run", ""), RX_TEXT("quantity", ""),
           RX_NUMBER("low", 3, "", "last value within 1.5 box lengths"), RX_NUMBER("q1", 3, "", "quartile"),
           RX_NUMBER("median", 3, "", ""), RX_NUMBER("q3", 3, "", "quartile"), RX_NUMBER("high", 3, "", ""),
           RX_COUNT("outliers", ""));

RX_COLUMNS(SCENES, RX_TEXT("scene", ""), RX_TEXT("condition", ""), RX_COUNT("number", "from 1 in each bin"),
           RX_NUMBER("fwhm", 2, "pix", "of the PSF"), RX_NUMBER("sigma", 2, "adu", "of the noise"),
           RX_NUMBER("noise_level", 3, "", "the noise on the scale of models"), RX_TEXT("run", ""),
           RX_NUMBER("psnr", 2, "dB", "with the settings for PSNR"),
           RX_NUMBER("ssim", 4, "", "with the settings for SSIM"));

RX_COLUMNS(PAPER, RX_COUNT("table", "of the paper"), RX_TEXT("scene", ""), RX_TEXT("quantity", ""),
           RX_NUMBER("bin", 0, "", ""), RX_NUMBER("dof", 0, "", "degrees of freedom that give its p"),
           RX_NUMBER("paper_t", 2, "", "printed: its network against Richardson-Lucy"),
           RX_P("paper_p", "printed"), RX_P("p_from_t", "that follows from the printed t"),
           RX_COUNT("fits", "1: within what rounding allows"),
           RX_NUMBER("t", 2, "", "here, two samples as in the paper"), RX_P("p", "here"),
           RX_NUMBER("paired_t", 2, "", "here, on the same scenes: the fitting test"));

/* Choices of tuning, two for each tuned method and bin; returns how many of them lie at an end of what was tried. */
static int count_ends(const rx_lab *lab, int *choices)
{
    int ends = *choices = 0;
    for (int i = 0; i < 2 * lab->nconditions * lab->nruns; i++) {
        *choices += lab->tuned[i / 2][i % 2].setting[0] != '\0';
        ends += lab->tuned[i / 2][i % 2].at_end;
    }
    return ends;
}

static void facts(const rx_store *s, rx_report *report)
{
    const rx_lab *lab = s->lab;
    int choices;
    const int ends = count_ends(lab, &choices);
    rx_report_fact_number(report, "scene_side", lab->config->scene_side);
    rx_report_fact_number(report, "peak", lab->config->scene_peak);
    rx_report_fact_number(report, "sharp_fwhm", lab->sky[0].simulation->sharp_fwhm);
    rx_report_fact_numbers(report, "fwhm_trained", 2, lab->fwhm_trained);
    rx_report_fact_numbers(report, "noise_level_trained", 2, lab->level_trained);
    rx_report_fact_number(report, "tune_scenes", lab->tunes ? lab->config->tune_scenes : 0);
    rx_report_fact_number(report, "tune_choices", choices);
    rx_report_fact_number(report, "tune_choices_at_end", ends);
}

static void add_bins(rx_report *report, const rx_store *s)
{
    rx_report_table *bins = RX_REPORT_TABLE(report, "bins", BINS, RX_REPORT_EVERYWHERE),
                    *boxes = RX_REPORT_TABLE(report, "boxes", BOXES, RX_REPORT_EVERYWHERE),
                    *scenes = RX_REPORT_TABLE(report, "scenes", SCENES, RX_REPORT_IN_FILE);
    for (int b = 0; b < s->lab->nconditions; b++) {
        const rx_lab_bin *bin = &s->lab->bin[b];
        const int g = bin->by_sigma, c = b - g * s->group[0].nconditions;
        const rx_restoration_bin *own = rx_restoration_bin_of(s, g, c);
        const rx_lab_table *scene = scenes_of(s, g, c);
        const char *name = s->group[g].condition[c];
        rx_report_put(bins, KINDS[g], name, bin->low, bin->high, bin->other_low, bin->other_high, scene->n,
                      own->level.low, own->level.median, own->level.high, own->inside, own->fainter);
        for (int i = 0; i < RX_QUALITIES * s->ncolumns; i++) {
            const rx_five_numbers *box = &own->box[i / s->ncolumns][i % s->ncolumns];
            rx_report_put(boxes, KINDS[g], name, s->column[i % s->ncolumns], QUALITIES[i / s->ncolumns].name,
                          box->low, box->q1, box->median, box->q3, box->high, box->outliers);
        }
        for (long i = 0; i < scene->n; i++)
            for (int k = 0; k < s->ncolumns; k++) {
                const double *v = rx_lab_own(scene, i), *score = rx_lab_each(scene, i, k);
                rx_report_put(scenes, KINDS[g], name, i + 1, v[RX_SCENE_FWHM], v[RX_SCENE_SIGMA],
                              v[RX_SCENE_LEVEL], s->column[k], score[RX_SCORE_PSNR], score[RX_SCORE_SSIM]);
            }
    }
    rx_report_section(report, "bins", "Bins, and where the network's training lies");
    rx_report_show(report, bins,
                   RX_VIEW(.note = "Models know noise on a scale of their own, the noise level: "
                                   "255 times the noise over what the brightest 0.1 % of the "
                                   "blurred scene exceed."));
}

/* The printed numbers of the paper beside ours, of the first pair. */
static void add_paper(rx_report *report, const rx_store *s)
{
    const int chief = s->npairs > 0 ? 0 : -1;
    rx_report_table *t = RX_REPORT_TABLE(report, "paper", PAPER, RX_REPORT_IN_JSON);
    for (const rx_paper_table *table = rx_paper_tables; table < rx_paper_tables + RX_PAPER_TABLES; table++)
        for (int k = 0; k < table->n; k++) {
            const rx_contest none = rx_contest_none(),
                             *two = paper_contest(s, table, k, chief, RX_BY_TWO_SAMPLES),
                             *paired = paper_contest(s, table, k, chief, RX_BY_PAIRED);
            const rx_test *test = two != NULL ? &two->test : &none.test;
            double p, ln_p;
            const int fits = rx_paper_column_fits(table, k, &p, &ln_p);
            rx_report_put(t, table->number, KINDS[table->by_sigma], table->ssim ? "ssim" : "psnr",
                          table->bin[k], table->dof, table->t[k], rx_cell_p(table->p[k], log(table->p[k])),
                          rx_cell_p(p, ln_p), fits, test->statistic, rx_cell_p(test->p, test->ln_p),
                          paired != NULL ? paired->test.statistic : NAN);
        }
    rx_report_section(report, "paper", "Beside the paper's Tables 1 to 4");
    if (chief == 0) {
        char words[128];
        snprintf(words, sizeof words, "The paper's columns are NET against RL, ours %s against %s.",
                 s->column[s->pair[0][0]], s->column[s->pair[0][1]]);
        rx_report_sentence(report, words);
    }
    rx_report_show(report, t, RX_VIEW(.from = 0));
}

static const char READING[] =
    "The reference is the scene without noise at the target PSF; noise and PSNR "
    "are on the scale of its brightest pixel. "
    "RL knows the true PSF; its iterations and the Gaussian filter after it are "
    "the best of TUNE_NITER and TUNE_FILTER, "
    "bin by bin, on scenes that are not in the test, once for PSNR and once for "
    "SSIM. SMOOTHED is the blurred image "
    "through such a filter alone; RL_FLAT is RL, and NET_FLAT NET, with all below a threshold, tuned "
    "too, set to the sky. <b>PSNR</b> = 20 "
    "log<sub>10</sub>(max(reference) / &radic;MSE) dB (the paper prints it without "
    "the square). <b>SSIM</b>: Wang et al. "
    "2004, 11 x 11 Gaussian window of sigma 1.5, K1 = K2 = 0.001 as in the paper: "
    "the noise of empty sky weighs heavily, "
    "which favours smooth pictures. Better and worse: Student's t of the "
    "differences on the same scenes, p adjusted by "
    "Holm for the bins, below 0.05; the two-sample test is the paper's. Pictures: "
    "the middle of the first scene of a bin, "
    "asinh(p / 6 %) of the peak from &minus;6 to 70 % of it.";

static rx_status page(const rx_store *s, rx_findings *f, rx_error *err)
{
    const rx_lab *lab = s->lab;
    rx_report *report = f->report;
    const int n = lab->config->examples < lab->nconditions ? lab->config->examples : lab->nconditions;
    int choices;
    const int ends = count_ends(lab, &choices);
    char text[160];
    for (int g = 0; g < 2; g++) {
        if (s->group[g].nconditions == 0)
            continue;
        for (int q = 0; q < RX_QUALITIES; q++) {
            plot_boxes(rx_report_figures_of(report), s, g, q);
            plot_differences(rx_report_figures_of(report), s, g, q);
        }
        rx_findings_section(f, KINDS[g], g == 1 ? "By noise" : "By FWHM", IDS[g]);
        rx_findings_quantities(f, s, g, RX_QUALITIES);
        rx_findings_contests(f, s, g, "scenes");
    }
    if (n > 0)
        rx_report_section(report, "examples", "Examples");
    for (int e = 0; e < n; e++) /* the first scenes of bins evenly apart */
        RX_TRY(add_example(report, lab, e, (2 * e + 1) * lab->nconditions / (2 * n), err));
    add_bins(report, s);
    add_paper(report, s);
    if (ends > 0) {
        snprintf(text, sizeof text,
                 "Tuning took an end of what was tried in %d of %d choices; longer TUNE_NITER or TUNE_FILTER "
                 "may serve "
                 "the tuned methods better (cells.ecsv).",
                 ends, choices);
        rx_report_sentence(report, text);
        rx_text_printf(rx_report_brief_of(report), "%s\n", text);
    }
    return RX_OK;
}

const rx_lab_results rx_restoration_results = {measure, facts, sizeof JUDGES / sizeof *JUDGES,
                                               JUDGES,  page,  READING};
