/* The significance of proposed sources against what is known of stars on a white sky. */
#include "../near.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "fit/significance.h"

enum { SIDE = 64, PSF_SIDE = 31 };
static const double SPREAD = 1.7, NOISE = 2.0; /* rms of the Gaussian PSF, pixels; sigma of a pixel, ADU */

typedef struct sky {
    float pixels[SIDE * SIDE];
    uint8_t mask[SIDE * SIDE];
    float noise[SIDE * SIDE];
    rx_psf *psf;
    rx_image image;
} sky;

static double gauss(double dx, double dy)
{
    return exp(-0.5 * (dx * dx + dy * dy) / (SPREAD * SPREAD)) / (2.0 * M_PI * SPREAD * SPREAD);
}

static sky *open_sky(void)
{
    sky *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->psf = rx_psf_new(RX_PSF_GAUSS, PSF_SIDE, 1);
    assert_non_null(s->psf);
    s->psf->fwhm = SPREAD * 2.0 * sqrt(2.0 * M_LN2);
    for (int i = 0; i < PSF_SIDE * PSF_SIDE; i++)
        s->psf->basis[i] = (float)gauss(i % PSF_SIDE - PSF_SIDE / 2, i / PSF_SIDE - PSF_SIDE / 2);
    for (int i = 0; i < SIDE * SIDE; i++)
        s->noise[i] = (float)NOISE;
    s->image = (rx_image){.width = SIDE,
                          .height = SIDE,
                          .pixels = s->pixels,
                          .mask = s->mask,
                          .hide = RX_HIDE_PLAIN,
                          .noise = rx_map_plane(s->noise, SIDE),
                          .global_noise = NOISE,
                          .psf = s->psf};
    return s;
}

static void close_sky(sky *s)
{
    rx_psf_free(s->psf);
    free(s);
}

static void add_star(sky *s, double x, double y, double flux)
{
    for (int i = 0; i < SIDE * SIDE; i++)
        s->pixels[i] += (float)(flux * gauss(i % SIDE - x, i / SIDE - y));
}

static void significance(const sky *s, double least, int nthreads, int n, rx_proposal *list)
{
    assert_int_equal(rx_significance(&s->image, least, nthreads, n, list, NULL), RX_OK);
}

/* sum P(p - a) P(p - b): of Gaussians one of twice the variance. */
static double product(double distance)
{
    return exp(-0.25 * distance * distance / (SPREAD * SPREAD)) / (4.0 * M_PI * SPREAD * SPREAD);
}

static void alone_it_is_the_matched_filter(void **state)
{
    (void)state;
    sky *s = open_sky();
    add_star(s, 30.3, 31.6, 500.0);
    rx_proposal star = {.x = 30.3, .y = 31.6};
    significance(s, 5.0, 1, 1, &star);
    assert_true(star.kept);
    assert_near(star.flux, 500.0, 1.0);
    assert_near(star.lambda, 500.0 / NOISE * sqrt(product(0.0)), 0.15);
    significance(s, 60.0, 1, 1, &star);
    assert_false(star.kept);
    close_sky(s);
}

/* Two by two, by hand. */
static void beside_another_it_is_what_that_leaves(void **state)
{
    (void)state;
    sky *s = open_sky();
    const double apart = 3.0, own = product(0.0), shared = product(apart),
                 left = sqrt(own - shared * shared / own) / NOISE;
    rx_proposal pair[2] = {{.x = 28.2, .y = 30.0}, {.x = 28.2 + apart, .y = 30.0}};
    add_star(s, pair[0].x, pair[0].y, 900.0);
    add_star(s, pair[1].x, pair[1].y, 200.0);
    significance(s, 5.0, 1, 2, pair);
    assert_near(pair[0].lambda, 900.0 * left, 1.0);
    assert_near(pair[1].lambda, 200.0 * left, 0.5);
    /* photons of the other are noise, one's own are not */
    s->image.gain = 0.1;
    significance(s, 1.0, 1, 2, pair);
    for (int j = 0; j < 2; j++) {
        const double flux[2] = {900.0, 200.0};
        double photons = 0.0;
        for (int i = 0; i < SIDE * SIDE; i++) {
            const double own_psf = gauss(i % SIDE - pair[j].x, i / SIDE - pair[j].y),
                         other = flux[1 - j] * gauss(i % SIDE - pair[1 - j].x, i / SIDE - pair[1 - j].y);
            photons += own_psf * own_psf * other / s->image.gain / pow(NOISE, 4.0);
        }
        assert_close(pair[j].lambda, flux[j] * left * left / sqrt(left * left + photons), 0.02);
    }
    close_sky(s);
}

static void two_proposals_for_one_star_leave_one(void **state)
{
    (void)state;
    sky *s = open_sky();
    add_star(s, 40.1, 20.2, 60.0);
    rx_proposal twice[2] = {{.x = 40.1, .y = 20.2}, {.x = 40.9, .y = 20.2}};
    significance(s, 4.0, 1, 2, twice);
    assert_int_equal(twice[0].kept + twice[1].kept, 1);
    assert_near(twice[0].kept ? twice[0].lambda : twice[1].lambda, 60.0 / NOISE * sqrt(product(0.0)), 0.4);
    close_sky(s);
}

static void what_no_pixel_shows_is_left_to_others(void **state)
{
    (void)state;
    sky *s = open_sky();
    rx_proposal list[2] = {{.x = 10.0, .y = 10.0}, {.x = 50.0, .y = 50.0}};
    add_star(s, 50.0, 50.0, 500.0);
    memset(s->mask, RX_MASK_BAD, (size_t)SIDE * 30);
    significance(s, 5.0, 1, 2, list);
    assert_true(isnan(list[0].lambda));
    assert_true(list[0].kept);
    assert_true(list[1].kept);
    significance(s, 5.0, 1, 0, NULL);
    close_sky(s);
}

/* Nothing as a point, something as wide as it is: the matched filter of its own size. */
static void faint_and_wide_is_a_source(void **state)
{
    (void)state;
    sky *s = open_sky();
    const double spread = 2.0 * SPREAD, flux = 80.0, peak = flux / (2.0 * M_PI * spread * spread);
    for (int i = 0; i < SIDE * SIDE; i++)
        s->pixels[i] =
            (float)(peak * exp(-0.5 * (pow(i % SIDE - 32, 2) + pow(i / SIDE - 32, 2)) / (spread * spread)));
    rx_proposal wide = {.x = 32.0, .y = 32.0};
    const double alone = flux / NOISE / sqrt(4.0 * M_PI) / spread,
                 point = flux / NOISE * 2.0 * SPREAD / sqrt(4.0 * M_PI) / (SPREAD * SPREAD + spread * spread);
    assert_true(point < 0.85 * alone);
    significance(s, 0.95 * alone, 1, 1, &wide);
    assert_true(wide.kept);
    assert_close(wide.lambda, alone, 0.03);
    significance(s, 0.95 * point, 1, 1, &wide); /* a point is enough */
    assert_true(wide.kept);
    assert_close(wide.lambda, point, 0.03);
    close_sky(s);
}

/* Of a crowd on noise: the same bytes by one thread and by three, and white noise in white noise. */
static void threads_and_noise(void **state)
{
    (void)state;
    enum { N = 40 };
    sky *s = open_sky();
    rx_proposal one[N], three[N];
    double sum = 0.0, square = 0.0;
    unsigned seed = 12345;
    for (int i = 0; i < SIDE * SIDE; i++) {
        double value = -6.0;
        for (int k = 0; k < 12; k++, seed = seed * 1664525u + 1013904223u)
            value += (seed >> 8) / 16777216.0;
        s->pixels[i] = (float)(NOISE * value);
    }
    for (int i = 0; i < N; i++)
        one[i] = three[i] = (rx_proposal){.x = 8 + i % 8 * 6.7, .y = 8 + (double)(i / 8) * 11.3};
    significance(s, -100.0, 1, N, one);
    significance(s, -100.0, 3, N, three);
    for (int i = 0; i < N; i++) {
        assert_memory_equal(&one[i].lambda, &three[i].lambda, sizeof(double));
        sum += one[i].lambda;
        square += one[i].lambda * one[i].lambda;
    }
    assert_near(sum / N, 0.0, 3.0 / sqrt(N));
    assert_near(sqrt(square / N), 1.0, 0.35);
    close_sky(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(alone_it_is_the_matched_filter),
        cmocka_unit_test(beside_another_it_is_what_that_leaves),
        cmocka_unit_test(two_proposals_for_one_star_leave_one),
        cmocka_unit_test(what_no_pixel_shows_is_left_to_others),
        cmocka_unit_test(faint_and_wide_is_a_source),
        cmocka_unit_test(threads_and_noise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
