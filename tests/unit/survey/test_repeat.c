/* Repeatability of simulated measurements against what their scatter makes it. */
#include "../near.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "base/text.h"
#include "survey/repeat.h"
#include "survey/visit.h"

enum { PAIRS = 4000 };

static double normal(int i, int k)
{
    return rx_random_normal(26, (uint64_t)k, (uint64_t)i);
}

/* Of magnitude 20, on a square of 20 arcmin: magnitudes scatter by `mag`, positions by `place` (arcsec) along each axis. */
static rx_repeat_pair *make_pairs(double mag, double claimed, double place, double zero_point)
{
    rx_repeat_pair *pairs = calloc(PAIRS, sizeof *pairs);
    assert_non_null(pairs);
    for (int i = 0; i < PAIRS; i++) {
        rx_repeat_pair *p = &pairs[i];
        const double mags[] = {20 + mag * normal(i, 0), 20 + zero_point + mag * normal(i, 1)};
        p->x = 1200 * rx_random_uniform(26, 2, (uint64_t)i);
        p->y = 1200 * rx_random_uniform(26, 3, (uint64_t)i);
        p->dx = place * (normal(i, 4) - normal(i, 5));
        p->dy = place * (normal(i, 6) - normal(i, 7));
        p->star = 1;
        assert_int_equal(rx_repeat_photometry(mags, (double[]){claimed, claimed}, zero_point, p), 1);
    }
    return pairs;
}

static const rx_repeat_cut ALL = {0, INFINITY, 1, 0.015, 2};

/* Tolerances are 4 standard errors: sigma_MAD has a relative one of 1 / sqrt(0.74 n), the rms 1 / sqrt(2 n). */
static void scatter_is_that_of_one_measurement(void **state)
{
    (void)state;
    const double mad = 4 / sqrt(0.74 * PAIRS), share = erfc(1.5 / M_SQRT2);
    rx_repeat_pair *pairs = make_pairs(0.010, 0.010, 0.02, 0.3);
    rx_repeat_numbers n;
    assert_int_equal(rx_repeat_measure(&ALL, PAIRS, pairs, &n, NULL), RX_OK);
    assert_int_equal(n.n, PAIRS);
    assert_close(n.scatter.value, 0.010, mad);
    assert_between(0.010, n.scatter.low, n.scatter.high);
    assert_close(n.rms, 0.010, 4 / sqrt(2.0 * PAIRS));
    assert_close(n.claimed, 0.010, 1e-9);
    assert_near(n.outliers.value, share, 4 * sqrt(share * (1 - share) / PAIRS));
    assert_between(share, n.outliers.low, n.outliers.high);
    assert_near(n.pull.value, 1, mad);
    assert_near(n.pull_median.value, 0, 4 * 1.2533 / sqrt(PAIRS));
    for (int k = 0; k < 2; k++)
        assert_close(n.axis[k].value, 0.02, mad);
    free(pairs);
}

/* Of two stars whose positions scatter by s along each axis a separation scatters by sqrt(2) s. */
static void separations_scatter_by_both_stars(void **state)
{
    (void)state;
    rx_repeat_pair *pairs = make_pairs(0.010, 0.010, 0.02, 0);
    rx_repeat_numbers n;
    assert_int_equal(rx_repeat_separations(&ALL, PAIRS, pairs, &n, NULL), RX_OK);
    /* each star is in many pairs: the error is that of RX_REPEAT_STARS positions */
    assert_close(n.separation, M_SQRT2 * 0.02, 4 / sqrt(0.74 * RX_REPEAT_STARS));
    /* of a square of side L, a ring of 240 to 360 arcsec, borders left out of account, has pi (r2^2 - r1^2) / L^2 */
    const double inside = M_PI * (360.0 * 360.0 - 240.0 * 240.0) / (1200.0 * 1200.0);
    assert_between((double)n.separations, 0.5 * inside * RX_REPEAT_STARS * RX_REPEAT_STARS / 2,
                   inside * RX_REPEAT_STARS * RX_REPEAT_STARS / 2);
    assert_int_equal(rx_repeat_separations(&ALL, 3, pairs, &n, NULL), RX_OK);
    assert_true(isnan(n.separation));
    free(pairs);
}

static void errors_that_are_too_small_show(void **state)
{
    (void)state;
    rx_repeat_pair *pairs = make_pairs(0.10, 0.05, 0.02, -1);
    rx_repeat_numbers n;
    assert_int_equal(rx_repeat_measure(&ALL, PAIRS, pairs, &n, NULL), RX_OK);
    assert_near(n.pull.value, 2, 2 * 4 / sqrt(0.74 * PAIRS));
    free(pairs);
}

/* A flux of 100 with error 10 and one of 80 with 5: 20 / sqrt(125), the mean 90 over sqrt((100 + 25) / 2). */
static void pulls_are_those_of_fluxes(void **state)
{
    (void)state;
    const double f[] = {100, 80}, s[] = {10, 5};
    const double mag[] = {-2.5 * log10(f[0]), -2.5 * log10(f[1]) + 0.7};
    const double error[] = {2.5 / log(10) * s[0] / f[0], 2.5 / log(10) * s[1] / f[1]};
    rx_repeat_pair p;
    assert_int_equal(rx_repeat_photometry(mag, error, 0.7, &p), 1);
    assert_close(p.dm, 2.5 * log10(100.0 / 80), 1e-12);
    assert_close(p.error, hypot(error[0], error[1]), 1e-12);
    assert_close(p.pull, 20 / sqrt(125), 1e-12);
    assert_close(p.snr, 90 / sqrt(62.5), 1e-12);
    assert_int_equal(rx_repeat_photometry(mag, (double[]){0.1, 0}, 0, &p), 0);
    assert_int_equal(rx_repeat_photometry((double[]){20, NAN}, error, 0, &p), 0);
}

static void cuts_choose(void **state)
{
    (void)state;
    rx_repeat_pair *pairs = make_pairs(0.010, 0.010, 0.02, 0);
    rx_repeat_numbers n, wide;
    for (int i = 0; i < PAIRS; i++) {
        pairs[i].snr = i < 1000 ? 50 : 100;
        pairs[i].star = i % 4 == 0;
    }
    rx_repeat_cut cut = {100, 200, 0, 0.015, 2};
    assert_int_equal(rx_repeat_measure(&cut, PAIRS, pairs, &n, NULL), RX_OK);
    assert_int_equal(n.n, 2250);
    cut = (rx_repeat_cut){50, 100, -1, 0.015, 2};
    assert_int_equal(rx_repeat_measure(&cut, PAIRS, pairs, &n, NULL), RX_OK);
    assert_int_equal(n.n, 1000);
    cut.visits = 8; /* each measurement is in 7 pairs */
    assert_int_equal(rx_repeat_measure(&cut, PAIRS, pairs, &wide, NULL), RX_OK);
    assert_close(wide.scatter.high - wide.scatter.value, 2 * (n.scatter.high - n.scatter.value), 1e-9);
    assert_close(wide.outliers.value, n.outliers.value, 1e-12);
    assert_between(wide.outliers.high - wide.outliers.low, 1.7 * (n.outliers.high - n.outliers.low),
                   2.3 * (n.outliers.high - n.outliers.low));
    cut.snr_low = 60;
    assert_int_equal(rx_repeat_measure(&cut, PAIRS, pairs, &n, NULL), RX_OK);
    assert_int_equal(n.n, 0);
    assert_true(isnan(n.scatter.value));
    assert_int_equal(rx_repeat_measure(&ALL, RX_REPEAT_FEW - 1, pairs, &n, NULL), RX_OK);
    assert_true(isnan(n.scatter.value));
    assert_int_equal(rx_repeat_measure(&ALL, 4 * RX_REPEAT_FEW, pairs, &n, NULL), RX_OK);
    assert_int_equal(n.n, RX_REPEAT_FEW);
    assert_false(isnan(n.scatter.value));
    free(pairs);
}

/* --- what a visit sees --- */

static rx_visit make_visit(long n, const double *alpha, const double *delta)
{
    rx_visit v = {.n = n, .nframes = 1};
    v.alpha = calloc((size_t)n, sizeof(double));
    v.delta = calloc((size_t)n, sizeof(double));
    v.x = calloc((size_t)n, sizeof(double));
    v.y = calloc((size_t)n, sizeof(double));
    v.frame = calloc(1, sizeof *v.frame);
    assert_non_null(v.frame);
    v.frame[0].last = n;
    memcpy(v.alpha, alpha, (size_t)n * sizeof(double));
    memcpy(v.delta, delta, (size_t)n * sizeof(double));
    return v;
}

static void card(rx_text *cards, const char *key, const char *value)
{
    rx_text one = {0};
    rx_text_printf(&one, "%-8s= %s", key, value);
    rx_text_printf(cards, "%-80s", one.data);
    rx_text_free(&one);
}

/* East and north in arcsec, around the pole and where right ascension begins anew, too. */
static void the_tangent_plane_is_in_arcsec(void **state)
{
    (void)state;
    static const double alpha[] = {359.9, 0.1, 359.9, 0.1}, delta[] = {-0.1, -0.1, 0.1, 0.1};
    rx_visit v = make_visit(4, alpha, delta);
    assert_int_equal(rx_visit_project(&v, &v, NULL), RX_OK);
    assert_near(v.x[1] - v.x[0], 720, 0.01);
    assert_near(v.y[2] - v.y[0], 720, 0.01);
    rx_visit_free(&v);
    static const double around[] = {0, 90, 180, 270}, pole[] = {89.9, 89.9, 89.9, 89.9};
    v = make_visit(4, around, pole);
    assert_int_equal(rx_visit_project(&v, &v, NULL), RX_OK);
    assert_near(hypot(v.x[0] - v.x[2], v.y[0] - v.y[2]), 720, 0.01);
    assert_near(hypot(v.x[0] - v.x[1], v.y[0] - v.y[1]), 720 * M_SQRT1_2, 0.01);
    rx_visit_free(&v);
}

/* 100 x 50 pixels of 1 arcsec around (0, 0); sources by their place in pixels from the centre. */
static void a_visit_sees_what_its_image_holds(void **state)
{
    (void)state;
    static const double x[] = {0, 44.4, 47.6, 0, 0, 20, 0, -47.6}, y[] = {0, 0, 0, 19.4, -22.6, 0, 22.6, 0};
    static const unsigned char inside[] = {1, 1, 0, 1, 0, 1, 0, 0};
    double alpha[8], delta[8];
    unsigned char seen[8];
    float weight[100 * 50];
    rx_text cards = {0};
    for (int i = 0; i < 8; i++) {
        alpha[i] = x[i] / 3600;
        delta[i] = y[i] / 3600;
    }
    rx_visit v = make_visit(8, alpha, delta);
    card(&cards, "CTYPE1", "'RA---TAN'");
    card(&cards, "CTYPE2", "'DEC--TAN'");
    card(&cards, "CRVAL1", "0.0");
    card(&cards, "CRVAL2", "0.0");
    card(&cards, "CRPIX1", "50.5");
    card(&cards, "CRPIX2", "25.5");
    card(&cards, "CDELT1", "2.7777777778E-4");
    card(&cards, "CDELT2", "2.7777777778E-4");
    rx_visit_frame *f = &v.frame[0];
    f->width = 100;
    f->height = 50;
    assert_int_equal(rx_wcs_from_cards(cards.data, cards.length / 80, 100, 50, &f->wcs, NULL, NULL), RX_OK);
    assert_non_null(f->wcs);
    assert_int_equal(rx_visit_sees(&v, &v, 3, seen, NULL), RX_OK);
    assert_memory_equal(seen, inside, sizeof seen);
    for (int i = 0; i < 100 * 50; i++)
        weight[i] = i % 100 < 60;
    f->weight = weight; /* the source at +20, pixel 69 or 70, and that at +44.4 are masked */
    assert_int_equal(rx_visit_sees(&v, &v, 3, seen, NULL), RX_OK);
    assert_memory_equal(seen, ((unsigned char[]){1, 0, 0, 1, 0, 0, 0, 0}), sizeof seen);
    f->weight = NULL;
    rx_text_free(&cards);
    rx_visit_free(&v);
}

/* Without an image a visit sees the hull of its sources, here a square turned by 45 degrees. */
static void without_an_image_it_is_the_hull(void **state)
{
    (void)state;
    static const double alpha[] = {0.1, 0, -0.1, 0, 0, 0.02}, delta[] = {0, 0.1, 0, -0.1, 0, 0.05};
    static const double there_alpha[] = {0.04, 0.06, 0.05, -0.03}, there_delta[] = {0.04, 0.06, 0.048, -0.03};
    unsigned char seen[4];
    rx_visit v = make_visit(6, alpha, delta), other = make_visit(4, there_alpha, there_delta);
    assert_int_equal(rx_visit_project(&v, &v, NULL), RX_OK);
    assert_int_equal(rx_visit_project(&v, &other, NULL), RX_OK);
    assert_int_equal(v.frame[0].n, 4);
    assert_int_equal(rx_visit_sees(&v, &other, 0, seen, NULL), RX_OK);
    assert_memory_equal(seen, ((unsigned char[]){1, 0, 1, 1}), sizeof seen);
    assert_int_equal(rx_visit_sees(&v, &other, 10, seen, NULL), RX_OK); /* 0.002 deg / sqrt 2 is 5 arcsec */
    assert_memory_equal(seen, ((unsigned char[]){1, 0, 0, 1}), sizeof seen);
    rx_visit_free(&other);
    rx_visit_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scatter_is_that_of_one_measurement),
        cmocka_unit_test(separations_scatter_by_both_stars),
        cmocka_unit_test(errors_that_are_too_small_show),
        cmocka_unit_test(pulls_are_those_of_fluxes),
        cmocka_unit_test(cuts_choose),
        cmocka_unit_test(the_tangent_plane_is_in_arcsec),
        cmocka_unit_test(a_visit_sees_what_its_image_holds),
        cmocka_unit_test(without_an_image_it_is_the_hull),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
