/* The numbers of a tile's QA: stars that judge the PSF by magnitude, errors on common sources, runs on the same
 * references. */

#include "../near.h"
#include "quality/qa_numbers.h"

static const double ZEROPOINT = 25;

static rx_psf_star star_of(double mag, double size)
{
    return (rx_psf_star){.flux = pow(10, -0.4 * (mag - ZEROPOINT)), .off = {size, 2 * size, -size}};
}

/* The brightest star has a whole magnitude: the lower end of the first range. */
static void every_star_is_in_a_range(void **state)
{
    (void)state;
    rx_psf_star stars[] = {
        star_of(0, 0.01), star_of(16.2, 0.03), star_of(16.7, 0.05), star_of(20.9, 0.02), {.flux = -1}};
    stars[0].flux = 1; /* of zero point 15: 15 mag, to the last bit */
    for (int i = 1; i < 4; i++)
        stars[i].flux *= pow(10, -0.4 * 10);
    rx_psf_judged judged = {.nstars = 5, .star = stars};
    rx_psf psf = {.judged = &judged};
    rx_qa_psf_bin bins[RX_QA_PSF_BINS];
    const int n = rx_qa_psf_bins(&(rx_qa_psf){.psf = &psf, .zeropoint = 15}, bins);
    assert_int_equal(n, 4);
    assert_near(bins[0].mag, 15.25, 1e-12);
    assert_int_equal(bins[0].n, 1);
    assert_near(bins[0].mean[1], 0.02, 1e-12);
    assert_true(isnan(bins[0].error[0]));
    assert_int_equal(bins[1].n, 1);
    assert_int_equal(bins[2].n, 1);
    assert_near(bins[3].mag, 20.75, 1e-12);
    assert_int_equal(bins[3].n, 1);
}

/* 9 magnitudes need ranges of 1: mean and its error by hand. */
static void ranges_widen(void **state)
{
    (void)state;
    rx_psf_star stars[] = {star_of(14, 0.1), star_of(14.9, 0.3), star_of(22.9, 0.2)};
    rx_psf_judged judged = {.nstars = 3, .star = stars};
    rx_psf psf = {.judged = &judged};
    rx_qa_psf_bin bins[RX_QA_PSF_BINS];
    stars[0].flux *= 1 - 1e-9;
    assert_int_equal(rx_qa_psf_bins(&(rx_qa_psf){.psf = &psf, .zeropoint = ZEROPOINT}, bins), 2);
    assert_near(bins[0].mag, 14.5, 1e-12);
    assert_int_equal(bins[0].n, 2);
    assert_near(bins[0].mean[0], 0.2, 1e-12);
    assert_near(bins[0].error[0], 0.1, 1e-12);
    assert_near(bins[1].mag, 22.5, 1e-12);
}

/* Of four references one run has two, the other all: the errors of the two are compared. */
static void runs_on_the_same_references(void **state)
{
    (void)state;
    double x[] = {50, 150, 250, 350}, y[] = {50, 50, 50, 50}, mag[] = {18, 19, 20, 21}, measured[2][4];
    const double ratio[2][4] = {{1.1, 1.1, 0, 0}, {1.0, 1.1, 2.0, 2.0}};
    rx_qa_run runs[2] = {{.name = "SHORT"}, {.name = "DEEP"}};
    const rx_qa_input input = {.tile = "t",
                               .reference = "r",
                               .width = 400,
                               .height = 100,
                               .truth = {.n = 4, .x = x, .y = y, .mag = mag},
                               .nruns = 2,
                               .runs = runs};
    const rx_qa_params params = {.match_radius = 1, .by = {.seed = 5, .nthreads = 2}};
    rx_qa_numbers q;
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
    assert_int_equal(q.ncomparisons, 1);
    assert_int_equal(q.comparison[0].only_first, 0);
    assert_int_equal(q.comparison[0].only_second, 2);
    assert_near(q.comparison[0].p, 0.5, 1e-12);
    assert_int_equal(q.verdict, RX_VERDICT_NONE);
    rx_qa_numbers_free(&q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_star_is_in_a_range),
        cmocka_unit_test(ranges_widen),
        cmocka_unit_test(runs_on_the_same_references),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
