/* A tile small enough to work out by hand: roles, shares, differences, zero point, chance; curves, runs compared. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "quality/qa_numbers.h"

enum { SIDE = 100 };

/* References: found, found, missed, under the mask, outside, of unknown magnitude (out of the count). */
static double tx[] = {10, 20, 30, 50, 200, 40}, ty[] = {10, 20, 30, 50, 10, 40};
static double tmag[] = {18, 19, 20, 18, 18, 99};
/* Detections: of 0, of 1, of the masked one, false, of the one of unknown magnitude, on masked pixels. */
static double dx[] = {10.3, 20, 50.2, 70, 40, 52}, dy[] = {10, 19.5, 50, 70, 40.1, 52};
static double dmag[] = {18.1, 18.9, 18, 19.5, 22, 21}, derror[] = {0.01, 0.2, 0.01, 0.1, 0.1, 0.1};
static double dscore[] = {50, 40, 60, 5, 10, 1};

/* The same with 11 x 11 pixels under a mask. */
typedef struct scene {
    unsigned char mask[SIDE * SIDE];
    rx_qa_input input;
    rx_qa_run run;
} scene;

static int make_scene(void **state)
{
    scene *s = *state = calloc(1, sizeof *s);
    if (s == NULL)
        return -1;
    for (int y = 45; y < 56; y++)
        memset(s->mask + y * SIDE + 45, 1, 11);
    s->run = (rx_qa_run){.name = "NONE", .law_scale = 1, .law_power = 0.5};
    s->run.list = (rx_qa_list){.n = 6, .x = dx, .y = dy, .mag = dmag, .mag_error = derror, .score = dscore};
    s->input = (rx_qa_input){
        .width = SIDE, .height = SIDE, .mask = s->mask, .pixel_scale = 0.5, .nruns = 1, .runs = &s->run};
    s->input.truth = (rx_qa_list){.n = 6, .x = tx, .y = ty, .mag = tmag};
    return 0;
}

static int free_scene(void **state)
{
    free(*state);
    return 0;
}

static const rx_qa_params params = {
    .match_radius = 1, .mag_low = 18, .mag_high = 21, .mag_step = 1, .by = {.seed = 1, .nthreads = 2}};

static void evaluate(const rx_qa_params *par, const rx_qa_input *input, rx_evaluation *e)
{
    rx_bins bins;
    assert_int_equal(rx_evaluate_bins(par, input, &bins, NULL), RX_OK);
    assert_int_equal(rx_evaluate(par, input, 0, &bins, 0.95, e, NULL), RX_OK);
}

static void measure(const rx_evaluation *e, rx_mag_range mags, double level, rx_metric only, rx_estimate *m)
{
    assert_int_equal(
        rx_metrics_measure(e, mags, level, (rx_resampling){.seed = 1, .nthreads = 2}, only, m, NULL), RX_OK);
}

static void roles(void **state)
{
    static const unsigned char truth[] = {RX_ROLE_MATCHED, RX_ROLE_MATCHED, RX_ROLE_UNMATCHED,
                                          RX_ROLE_IGNORED, RX_ROLE_IGNORED, RX_ROLE_IGNORED};
    static const unsigned char found[] = {RX_ROLE_MATCHED,   RX_ROLE_MATCHED, RX_ROLE_IGNORED,
                                          RX_ROLE_UNMATCHED, RX_ROLE_IGNORED, RX_ROLE_IGNORED};
    scene *s = *state;
    rx_evaluation e;
    evaluate(&params, &s->input, &e);
    assert_memory_equal(e.truth_role, truth, sizeof truth);
    assert_memory_equal(e.run_role, found, sizeof found);
    assert_int_equal(e.references, 3);
    assert_int_equal(e.references_ignored, 3);
    assert_int_equal(e.detections, 3);
    assert_int_equal(e.detections_ignored, 3);
    assert_int_equal(e.matched, 2);
    /* falling score: 50 hit, 40 hit, 5 false */
    assert_near(e.pr.ap.value, 2.0 / 3.0, 1e-15);
    rx_evaluation_free(&e);
}

static void shares_and_differences(void **state)
{
    static const struct {
        rx_mag_range mags;
        rx_metric metric;
        double value;
        long n;
    } expected[] = {
        {{.whole = 1}, RX_METRIC_RECALL, 2.0 / 3.0, 3},
        {{.whole = 1}, RX_METRIC_PRECISION, 2.0 / 3.0, 3},
        {{.whole = 1}, RX_METRIC_BIAS_MAG, 0, 2},
        {{.whole = 1}, RX_METRIC_SCATTER_MAG, 0.14826, 2},
        {{.whole = 1}, RX_METRIC_MAGERR, 9.2233678, 2},       /* 50 (10^0.04 - 10^-0.04) */
        {{.whole = 1}, RX_METRIC_BIAS_PERCENT, 0.4244518, 2}, /* 50 (10^0.04 + 10^-0.04 - 2) */
        {{.whole = 1}, RX_METRIC_DX, 0.15, 2},                /* of 0.3 and 0 */
        {{.whole = 1}, RX_METRIC_DY, -0.25, 2},               /* of 0 and -0.5 */
        {{.whole = 1}, RX_METRIC_SCATTER_Y, 1.4826 * 0.25, 2},
        {{.whole = 1}, RX_METRIC_SCATTER_Y_ARCSEC, 1.4826 * 0.125, 2},
        {{.whole = 1}, RX_METRIC_PULL_MEDIAN, 0.5 * (0.1 / 0.01 - 0.1 / 0.2), 2},
        {{.whole = 1}, RX_METRIC_ZP_OFFSET, 0.1, 1}, /* the second is too uncertain to count */
        {{0, 18, 19}, RX_METRIC_RECALL, 1, 1},
        {{0, 18, 19}, RX_METRIC_PRECISION, 1, 2}, /* 18.1 and 18.9 as measured */
        {{0, 18, 19}, RX_METRIC_BIAS_MAG, 0.1, 1},
        {{0, 19, 20}, RX_METRIC_PRECISION, 0, 1},
        {{0, 19, 20}, RX_METRIC_RECALL, 1, 1},
    };
    scene *s = *state;
    rx_evaluation e;
    rx_estimate m[RX_METRIC_COUNT];
    evaluate(&params, &s->input, &e);
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        measure(&e, expected[i].mags, 0.95, RX_METRIC_COUNT, m);
        assert_near(m[expected[i].metric].value, expected[i].value, 1e-6);
        assert_int_equal(m[expected[i].metric].n, expected[i].n);
    }
    assert_int_equal(m[RX_METRIC_AP].n, 0); /* exists for all only */
    rx_evaluation_free(&e);
}

/* What needs no reference: intervals are Student's, and gates decide by them. */
static void flux_scale(void **state)
{
    static const struct {
        double wide;
        rx_verdict verdict;
    } cases[] = {{1.0080, RX_VERDICT_PASS}, {1.0095, RX_VERDICT_INSUFFICIENT}, {1.0120, RX_VERDICT_FAIL}};
    const double t = 2.2281388519649385; /* of 10 at 0.975 */
    const rx_psf psf = {.quality = {.how = RX_PSF_BY_PIXELS,
                                    .reserved = 11,
                                    .trace = {0.004, 0.001},
                                    .shape = {{-0.002, 0.0005}, {0.001, 0.0005}},
                                    .growth = -0.012,
                                    .growth_error = 0.002}};
    const rx_gate gate = {.op = RX_GATE_IN, .value = 0.99, .value_high = 1.01};
    scene *s = *state;
    rx_evaluation e;
    rx_estimate m[RX_METRIC_COUNT];
    evaluate(&params, &s->input, &e);
    measure(&e, (rx_mag_range){.whole = 1}, 0.95, RX_METRIC_COUNT, m);
    assert_int_equal(m[RX_METRIC_PSF_DT].n, 0);
    assert_int_equal(rx_gate_judge(&gate, &m[RX_METRIC_FLUX_SCALE]), RX_VERDICT_INSUFFICIENT);
    s->input.psf = (rx_qa_psf){.psf = &psf, .zeropoint = 25};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        s->run.flux = (rx_qa_flux){.n = 11, .wide = cases[i].wide, .wide_error = 0.0005};
        measure(&e, (rx_mag_range){.whole = 1}, 0.95, RX_METRIC_COUNT, m);
        assert_near(m[RX_METRIC_FLUX_SCALE].value, cases[i].wide, 1e-15);
        assert_near(m[RX_METRIC_FLUX_SCALE].high - cases[i].wide, t * 0.0005, 1e-9);
        assert_near(cases[i].wide - m[RX_METRIC_FLUX_SCALE].low, t * 0.0005, 1e-9);
        assert_int_equal(rx_gate_judge(&gate, &m[RX_METRIC_FLUX_SCALE]), cases[i].verdict);
    }
    assert_near(m[RX_METRIC_PSF_DT].high - 0.004, t * 0.001, 1e-9);
    assert_near(m[RX_METRIC_PSF_DE1].low + 0.002, -t * 0.0005, 1e-9);
    assert_near(m[RX_METRIC_PSF_DE2].value, 0.001, 0);
    assert_near(m[RX_METRIC_PSF_GROWTH].value, -0.012, 0);
    assert_int_equal(m[RX_METRIC_PSF_GROWTH].n, 11);
    rx_evaluation_free(&e);
}

/* Marked: one that is right, the false one, and one that does not count. */
static void marked_detections(void **state)
{
    static const struct {
        unsigned char made_up[6];
        long marked, matched;
        double without; /* them: matched / detections */
    } cases[] = {{{0, 0, 0, 0, 0, 0}, 0, 0, 2.0 / 3.0},
                 {{1, 0, 0, 1, 1, 0}, 2, 1, 1.0},
                 {{0, 0, 1, 1, 1, 1}, 1, 0, 1.0},
                 {{1, 1, 0, 0, 0, 0}, 2, 2, 0.0},
                 {{1, 1, 0, 1, 0, 0}, 3, 2, NAN}};
    scene *s = *state;
    rx_evaluation e;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        unsigned char made_up[6];
        memcpy(made_up, cases[i].made_up, sizeof made_up);
        s->run.list.made_up = made_up;
        evaluate(&params, &s->input, &e);
        assert_int_equal(e.detections, 3); /* marks take nobody out of the count */
        assert_int_equal(e.matched, 2);
        assert_int_equal(e.made_up, cases[i].marked);
        assert_int_equal(e.made_up_matched, cases[i].matched);
        const double without = rx_evaluation_precision_without(&e);
        assert_true(isnan(cases[i].without) ? isnan(without) : fabs(without - cases[i].without) < 1e-15);
        rx_evaluation_free(&e);
    }
}

/* Asked for one metric, the answer is that of all, and nothing else. */
static void one_metric_alone(void **state)
{
    scene *s = *state;
    rx_evaluation e;
    rx_estimate all[RX_METRIC_COUNT], one[RX_METRIC_COUNT];
    evaluate(&params, &s->input, &e);
    measure(&e, (rx_mag_range){.whole = 1}, 0.9, RX_METRIC_COUNT, all);
    for (int k = 0; k < RX_METRIC_COUNT; k++) {
        measure(&e, (rx_mag_range){.whole = 1}, 0.9, (rx_metric)k, one);
        for (int i = 0; i < RX_METRIC_COUNT; i++)
            if (i == k)
                assert_memory_equal(&one[i], &all[i], sizeof one[i]);
            else
                assert_int_equal(one[i].n, 0);
    }
    rx_evaluation_free(&e);
}

/* With fluxes a negative one, which has no magnitude, still counts in the flux error. */
static void negative_flux_counts(void **state)
{
    double flux[6], error[6], mag[6];
    scene *s = *state;
    rx_evaluation e;
    for (int i = 0; i < 6; i++) {
        flux[i] = pow(10, -0.4 * (dmag[i] - 25));
        error[i] = 2;
        mag[i] = dmag[i];
    }
    double truth0 = pow(10, -0.4 * (18 - 25.0)), truth1 = pow(10, -0.4 * (19 - 25.0));
    flux[1] = -truth1;
    mag[1] = 99;
    s->run.list.flux = flux;
    s->run.list.flux_error = error;
    s->run.list.mag = mag;
    evaluate(&params, &s->input, &e);
    assert_near(e.ratio[0], flux[0] / truth0, 1e-9);
    assert_near(e.ratio[1], -1, 1e-9);
    assert_true(isnan(e.dmag[1]));
    assert_near(e.pull[1], -2 * truth1 / 2, 1e-6);
    assert_true(e.pull_in_flux);
    rx_evaluation_free(&e);
}

/* Everything 0.2 mag too faint: magerr says so as it stands, magerr_shifted is free of it. */
static void zero_point_is_told_not_hidden(void **state)
{
    enum { N = 50 };
    double x[N], y[N], mag[N], shifted[N];
    rx_estimate m[RX_METRIC_COUNT];
    rx_evaluation e;
    for (int i = 0; i < N; i++) {
        x[i] = 5 + 10 * (i % 10);
        y[i] = 5 + 10 * (i / 10); /* five rows */
        mag[i] = 18 + 0.05 * i;
        shifted[i] = mag[i] + 0.2;
    }
    rx_qa_run run = {.name = "A", .list = {.n = N, .x = x, .y = y, .mag = shifted}};
    rx_qa_input input = {.width = SIDE, .height = SIDE, .truth = {.n = N, .x = x, .y = y, .mag = mag}};
    input.nruns = 1;
    input.runs = &run;
    evaluate(&params, &input, &e);
    measure(&e, (rx_mag_range){.whole = 1}, 0.95, RX_METRIC_COUNT, m);
    assert_near(m[RX_METRIC_ZP_OFFSET].value, 0.2, 1e-9);
    assert_near(m[RX_METRIC_MAGERR].value, 100 * (1 - pow(10, -0.08)), 1e-9);
    assert_near(m[RX_METRIC_MAGERR_SHIFTED].value, 0, 1e-9);
    assert_near(m[RX_METRIC_RECALL].low, pow(0.025, 1.0 / N), 1e-9); /* all of N found */
    rx_evaluation_free(&e);
}

/* Unrelated lists: Poisson expectation, a little less because each source can be used once. */
static void chance_matches(void **state)
{
    enum { N = 2000 };
    static double x[2][N], y[2][N], mag[N];
    rx_evaluation e;
    for (int i = 0; i < N; i++)
        for (int k = 0; k < 2; k++) {
            x[k][i] = 500 * rx_random_uniform(8, (uint64_t)k, (uint64_t)(2 * i));
            y[k][i] = 500 * rx_random_uniform(8, (uint64_t)k, (uint64_t)(2 * i + 1));
        }
    rx_qa_run run = {.name = "A", .list = {.n = N, .x = x[0], .y = y[0], .mag = mag}};
    rx_qa_input input = {.width = 500, .height = 500, .truth = {.n = N, .x = x[1], .y = y[1], .mag = mag}};
    rx_qa_params par = {.match_radius = 2, .mag_low = -1, .mag_high = 1};
    input.nruns = 1;
    input.runs = &run;
    evaluate(&par, &input, &e);
    double expected = N * (1 - exp(-N * acos(-1.0) * 4 / 250000.0));
    assert_true(e.chance < expected);
    assert_true(e.chance > 0.88 * expected);
    rx_evaluation_free(&e);
}

static void bins_from_data_and_keys(void **state)
{
    scene *s = *state;
    rx_bins bins;
    rx_error err = RX_ERROR_NONE;
    rx_qa_params par = {.match_radius = 1};
    assert_int_equal(rx_evaluate_bins(&par, &s->input, &bins, NULL), RX_OK);
    assert_int_equal(bins.n, 6); /* 18 to 21 by 0.5: masked, outside and unknown ones do not count */
    assert_near(bins.edge[0], 18, 0);
    assert_near(bins.edge[6], 21, 0);
    par = (rx_qa_params){.mag_low = 18, .mag_high = 19.2, .mag_step = 0.5};
    assert_int_equal(rx_evaluate_bins(&par, &s->input, &bins, NULL), RX_OK);
    assert_int_equal(bins.n, 3);
    assert_near(bins.edge[3], 19.2, 0);
    par = (rx_qa_params){.mag_low = 0, .mag_high = 30, .mag_step = 0.1};
    assert_int_equal(rx_evaluate_bins(&par, &s->input, &bins, &err), RX_USAGE);
    s->input.truth.n = 0;
    par = (rx_qa_params){.match_radius = 1};
    assert_int_equal(rx_evaluate_bins(&par, &s->input, &bins, NULL), RX_OK);
    assert_true(bins.n >= 1);
    tmag[0] = -40; /* a wild value widens the bins, never breaks them */
    s->input.truth.n = 6;
    assert_int_equal(rx_evaluate_bins(&par, &s->input, &bins, NULL), RX_OK);
    assert_true(bins.n <= RX_MAX_BINS);
    assert_true(bins.edge[0] <= -40);
    assert_true(bins.edge[bins.n] > 20);
    tmag[0] = 18;
}

static void curve_by_hand(void **state)
{
    /* in no order; 9 references; thresholds and sums worked out by hand */
    const double score[] = {0.1, 0.9, 0.5, 0.8, 0.7, 0.5, 0.8, 0.6, 0.5, 0.3};
    const unsigned char matched[] = {1, 1, 0, 1, 1, 1, 0, 0, 1, 0};
    const double recall[] = {1 / 9.0, 2 / 9.0, 3 / 9.0, 3 / 9.0, 5 / 9.0, 5 / 9.0, 6 / 9.0};
    const double precision[] = {1, 2 / 3.0, 3 / 4.0, 3 / 5.0, 5 / 8.0, 5 / 9.0, 6 / 10.0};
    rx_estimate e;
    rx_pr pr;
    assert_int_equal(rx_pr_make(10, score, matched, 9, &pr, NULL), RX_OK);
    assert_int_equal(pr.n, 7);
    for (int i = 0; i < 7; i++) {
        assert_near(pr.point[i].recall, recall[i], 1e-15);
        assert_near(pr.point[i].precision, precision[i], 1e-15);
    }
    assert_near(pr.ap.value, 0.474074074074074, 1e-14);
    assert_int_equal(rx_pr_interval(&pr, 9, 0.95, (rx_resampling){.seed = 5}, &e, NULL), RX_OK);
    assert_near(e.low, 0, 0); /* too few references to resample: no bound at all */
    assert_near(e.high, 1, 0);
    assert_int_equal(rx_pr_interval(&pr, 40, 0.95, (rx_resampling){.seed = 5}, &e, NULL), RX_OK);
    assert_between(e.low, 0.01, pr.ap.value);
    assert_true(e.high < 0.9);
    rx_pr_free(&pr);
}

/* Detections without a score come last, whatever they are; without references there is no AP. */
static void ends_of_a_curve(void **state)
{
    const double score[] = {NAN, -1e9};
    const unsigned char matched[] = {0, 1};
    rx_pr pr;
    assert_int_equal(rx_pr_make(2, score, matched, 1, &pr, NULL), RX_OK);
    assert_near(pr.ap.value, 1, 1e-15);
    rx_pr_free(&pr);
    assert_int_equal(rx_pr_make(0, NULL, NULL, 3, &pr, NULL), RX_OK);
    assert_near(pr.ap.value, 0, 0);
    rx_pr_free(&pr);
    assert_int_equal(rx_pr_make(2, score, matched, 0, &pr, NULL), RX_OK);
    assert_true(isnan(pr.ap.value));
    rx_pr_free(&pr);
}

static rx_psf_star star_of(double mag, double size)
{
    return (rx_psf_star){.flux = pow(10, -0.4 * (mag - 25)), .off = {size, 2 * size, -size}};
}

/* Of four references one run has two, the other all: the errors of the two are compared. Stars that judge the PSF, over 9
 * magnitudes, stand in ranges of 1: mean and its error by hand; one without a flux is in none. */
static void runs_on_the_same_references(void **state)
{
    double x[] = {50, 150, 250, 350}, y[] = {50, 50, 50, 50}, mag[] = {18, 19, 20, 21}, measured[2][4];
    const double ratio[2][4] = {{1.1, 1.1, 0, 0}, {1.0, 1.1, 2.0, 2.0}};
    rx_qa_run runs[2] = {{.name = "SHORT"}, {.name = "DEEP"}};
    rx_psf_star stars[] = {star_of(14, 0.1), star_of(14.9, 0.3), star_of(22.9, 0.2), {.flux = -1}};
    rx_psf_tested tested = {.nstars = 4, .star = stars};
    const rx_psf psf = {.tested = &tested};
    const rx_qa_input input = {.tile = "t",
                               .reference = "r",
                               .width = 400,
                               .height = 100,
                               .truth = {.n = 4, .x = x, .y = y, .mag = mag},
                               .nruns = 2,
                               .runs = runs,
                               .psf = {.psf = &psf, .zeropoint = 25}};
    const rx_qa_params params = {.match_radius = 1, .by = {.seed = 5, .nthreads = 2}};
    rx_qa_numbers q;
    stars[0].flux *= 1 - 1e-9;
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 4; i++)
            measured[k][i] = mag[i] - 2.5 * log10(ratio[k][i]);
        runs[k].list = (rx_qa_list){.n = k == 0 ? 2 : 4, .x = x, .y = y, .mag = measured[k]};
    }
    assert_int_equal(rx_qa_numbers_make(&params, &input, &q, NULL), RX_OK);
    assert_int_equal(q.ncommon, 2);
    assert_near(q.common[0], 10, 1e-9);
    assert_near(q.common[1], 5, 1e-9);
    assert_near(q.whole[1][RX_METRIC_MAGERR].value, 52.5, 1e-9);
    assert_int_equal(q.verdict, RX_VERDICT_NONE);
    assert_int_equal(q.npsf_bins, 2);
    assert_near(q.psf_bin[0].mag, 14.5, 1e-12);
    assert_int_equal(q.psf_bin[0].n, 2);
    assert_near(q.psf_bin[0].mean[0], 0.2, 1e-12);
    assert_near(q.psf_bin[0].error[0], 0.1, 1e-12);
    assert_near(q.psf_bin[1].mag, 22.5, 1e-12);
    assert_true(isnan(q.psf_bin[1].error[0]));
    rx_qa_numbers_free(&q);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, make_scene, free_scene)
    const struct CMUnitTest tests[] = {
        TEST(roles),
        TEST(shares_and_differences),
        cmocka_unit_test_setup_teardown(flux_scale, make_scene, free_scene),
        TEST(marked_detections),
        TEST(one_metric_alone),
        TEST(negative_flux_counts),
        cmocka_unit_test(zero_point_is_told_not_hidden),
        cmocka_unit_test(chance_matches),
        TEST(bins_from_data_and_keys),
        cmocka_unit_test(curve_by_hand),
        cmocka_unit_test(ends_of_a_curve),
        cmocka_unit_test(runs_on_the_same_references),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
