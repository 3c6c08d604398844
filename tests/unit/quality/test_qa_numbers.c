/* The numbers of a tile's QA: stars that judge the PSF by magnitude, errors on common sources, runs on the same
 * references. */

#include "../near.h"
#include "quality/qa_numbers.h"

static rx_psf_star star_of(double mag, double size)
{
    return (rx_psf_star){.flux = pow(10, -0.4 * (mag - 25)), .off = {size, 2 * size, -size}};
}

/* Of four references one run has two, the other all: the errors of the two are compared. Stars that judge the PSF, over 9
 * magnitudes, stand in ranges of 1: mean and its error by hand; one without a flux is in none. */
static void runs_on_the_same_references(void **state)
{
    (void)state;
    double x[] = {50, 150, 250, 350}, y[] = {50, 50, 50, 50}, mag[] = {18, 19, 20, 21}, measured[2][4];
    const double ratio[2][4] = {{1.1, 1.1, 0, 0}, {1.0, 1.1, 2.0, 2.0}};
    rx_qa_run runs[2] = {{.name = "SHORT"}, {.name = "DEEP"}};
    rx_psf_star stars[] = {star_of(14, 0.1), star_of(14.9, 0.3), star_of(22.9, 0.2), {.flux = -1}};
    rx_psf_judged judged = {.nstars = 4, .star = stars};
    const rx_psf psf = {.judged = &judged};
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
    assert_int_equal(q.ncomparisons, 1);
    assert_int_equal(q.comparison[0].only_first, 0);
    assert_int_equal(q.comparison[0].only_second, 2);
    assert_near(q.comparison[0].p, 0.5, 1e-12);
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
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(runs_on_the_same_references),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
