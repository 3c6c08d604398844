/* Adam, the schedule, the clip, and the quick look at stars. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "../near.h"
#include "train/adam.h"
#include "train/stars.h"

/* python3 -c "
 * import numpy as np
 * p=np.array([.5,-1,3.]); m=np.zeros(3); v=np.zeros(3)
 * for t,g in enumerate([[1,-2,0],[.5,4,0],[-3,1,1e-3]],1):
 *   g=np.array(g,float); m=.9*m+.1*g; v=.99*v+.01*g*g
 *   p-=.01*t*(m/(1-.9**t))/(np.sqrt(v/(1-.99**t))+1e-8)
 *   print(*['%.9g'%x for x in p])" */
static void adam_as_published(void **state)
{
    static const float gradients[3][3] = {{1, -2, 0}, {0.5f, 4, 0}, {-3, 1, 1e-3f}};
    static const double expected[3][3] = {
        {0.490000000, -0.990000000, 3.0},
        {0.471331040, -0.997312154, 3.0},
        {0.481711101, -1.009789890, 2.98092212},
    };
    float params[3] = {0.5f, -1, 3};
    rx_adam *adam = NULL;
    (void)state;
    assert_int_equal(rx_adam_new(3, &adam, NULL), RX_OK);
    for (int t = 0; t < 3; t++) {
        rx_adam_step(adam, gradients[t], 0.01 * (t + 1), params);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(params[i] - expected[t][i]) < 1e-6);
    }
    assert_int_equal(adam->steps, 3);
    rx_adam_free(adam);
    rx_adam_free(NULL);
}

/* The first step of a gradient of the size of epsilon is half the rate, of any other the rate; no number but
 * its own is touched. */
static void adam_beside_epsilon(void **state)
{
    const float gradient[3] = {1e-8f, -300, 1};
    float params[3] = {0, 0, 0};
    rx_adam *adam = NULL;
    (void)state;
    assert_int_equal(rx_adam_new(2, &adam, NULL), RX_OK);
    rx_adam_step(adam, gradient, 1, params);
    assert_near(params[0], -0.5, 1e-6);
    assert_near(params[1], 1, 1e-6);
    assert_near(params[2], 0, 0);
    rx_adam_free(adam);
}

/* A bowl of very different curvatures is descended to its bottom. */
static void adam_finds_a_minimum(void **state)
{
    float params[2] = {3, -4}, gradient[2];
    rx_adam *adam = NULL;
    (void)state;
    assert_int_equal(rx_adam_new(2, &adam, NULL), RX_OK);
    for (int t = 0; t < 2000; t++) {
        gradient[0] = 100 * (params[0] - 1);
        gradient[1] = 0.01f * (params[1] + 2);
        rx_adam_step(adam, gradient, 0.05 * rx_schedule((t + 0.5) / 2000, 0.04), params);
    }
    assert_true(fabsf(params[0] - 1) < 1e-3f);
    assert_true(fabsf(params[1] + 2) < 1e-3f);
    rx_adam_free(adam);
}

static const double PI = 3.14159265358979323846;

static void schedule_rises_and_falls(void **state)
{
    (void)state;
    assert_true(rx_schedule(0, 0.1) == 0);
    assert_true(fabs(rx_schedule(0.05, 0.1) - 0.5) < 1e-12);
    assert_true(fabs(rx_schedule(0.1, 0.1) - 1) < 1e-12);
    assert_true(fabs(rx_schedule(0.55, 0.1) - 0.5) < 1e-12);
    assert_true(fabs(rx_schedule(0.325, 0.1) - (0.5 + 0.25 * sqrt(2))) < 1e-12);
    assert_true(rx_schedule(1, 0.1) == 0);
    assert_true(rx_schedule(1.5, 0.1) == 0);
    assert_true(fabs(rx_schedule(0, 0) - 1) < 1e-12);
}

/* cos x < -0.8 from x = 2.498: 0.7952 of the way down, 0.8034 of the training with a warm-up of 0.04. */
static void patience_counts_low_rates_alone(void **state)
{
    (void)state;
    assert_int_equal(rx_schedule_low(0, 240, 240, 0.04), 240 - 193);
    assert_int_equal(rx_schedule_low(31, 193, 240, 0.04), 0); /* any number of epochs at a high rate */
    assert_int_equal(rx_schedule_low(31, 203, 240, 0.04), 10);
    assert_int_equal(rx_schedule_low(200, 203, 240, 0.04), 3);
    assert_int_equal(rx_schedule_low(0, 20, 100, 0.5), 0); /* low, but on the way up */
    assert_int_equal(rx_schedule_low(0, 100, 100, 0), 20);
    assert_int_equal(rx_schedule_low(0, 100000, 100000, 0), 99999 - (int)(1e5 / PI * acos(-0.8)));
}

static void gradients_are_clipped_together(void **state)
{
    float a[2] = {3, 0}, b[3] = {0, -4, 12};
    float *const both[2] = {a, b};
    const long n[2] = {2, 3};
    (void)state;
    assert_true(fabs(rx_gradient_clip(both, n, 2, 0) - 13) < 1e-6);
    assert_true(fabs(rx_gradient_clip(both, n, 2, 20) - 13) < 1e-6);
    assert_true(a[0] == 3);
    assert_true(b[2] == 12);
    assert_true(fabs(rx_gradient_clip(both, n, 2, 1.3) - 13) < 1e-6);
    assert_true(fabsf(a[0] - 0.3f) < 1e-6f);
    assert_true(fabsf(b[1] + 0.4f) < 1e-6f);
    assert_true(fabsf(b[2] - 1.2f) < 1e-6f);
    b[1] = NAN;
    assert_true(isnan(rx_gradient_clip(both, n, 2, 1)));
}

enum { SIDE = 64, MARGIN = 8 };

/* Gaussian of FWHM 2 sampled at the pixels, sum flux. */
static void add_star(float *image, double x, double y, double flux)
{
    const double sigma = 2 / 2.3548200450309493;
    for (int v = 0; v < SIDE; v++)
        for (int u = 0; u < SIDE; u++) {
            const double r = ((u - x) * (u - x) + (v - y) * (v - y)) / (2 * sigma * sigma);
            image[v * SIDE + u] += (float)(flux / (2 * 3.141592653589793 * sigma * sigma) * exp(-r));
        }
}

static void list_star(rx_sample *sample, double x, double y, double flux, double snr)
{
    float *star = sample->star[sample->nstars++];
    star[0] = (float)x;
    star[1] = (float)y;
    star[2] = (float)flux;
    star[3] = (float)snr;
    add_star(sample->y, x, y, flux);
}

static void stars_are_found_and_measured(void **state)
{
    rx_star_check check;
    rx_sample *sample = rx_sample_new(SIDE);
    (void)state;
    assert_non_null(sample);
    list_star(sample, 20.3, 20.7, 400, 50); /* 3 % too bright */
    list_star(sample, 44.0, 20.5, 300, 40); /* two pixels away: not the same star */
    list_star(sample, 20.0, 45.0, 100, 15); /* too near to the next one to be measured */
    list_star(sample, 24.0, 45.0, 90, 14);
    list_star(sample, 44.0, 44.0, 30, 6);  /* below the threshold */
    list_star(sample, 32.0, 32.0, 20, 4);  /* too faint to count */
    list_star(sample, 3.0, 30.0, 500, 60); /* in the margin */
    list_star(sample, 10.0, 32.0, 80, 13); /* found, but its circle touches the margin */
    float *restored = calloc(SIDE * SIDE, sizeof *restored);
    assert_non_null(restored);
    add_star(restored, 20.3, 20.7, 412);
    add_star(restored, 46.0, 20.5, 300);
    add_star(restored, 20.0, 45.0, 100);
    add_star(restored, 24.0, 45.0, 90);
    add_star(restored, 44.0, 44.0, 7);
    add_star(restored, 10.0, 32.0, 80);
    assert_int_equal(rx_star_check_run(sample, restored, MARGIN, 2, &check, NULL), RX_OK);
    assert_true(check.stars == 6);
    assert_true(check.found == 4);
    assert_true(check.ratios == 2); /* by S/N */
    assert_true(fabs(check.error[0] - 0.03) < 1e-4);
    assert_true(check.error[1] < -0.001);
    assert_true(check.error[1] > -0.1); /* a little lies outside */
    free(restored);
    rx_sample_free(sample);
}

/* One peak serves one star: the brighter one. */
static void a_blend_is_found_once(void **state)
{
    rx_star_check check;
    rx_sample *sample = rx_sample_new(SIDE);
    (void)state;
    assert_non_null(sample);
    list_star(sample, 30.2, 30.0, 100, 20);
    list_star(sample, 31.0, 30.0, 200, 40);
    assert_int_equal(rx_star_check_run(sample, sample->y, MARGIN, 2, &check, NULL), RX_OK);
    assert_true(check.stars == 2);
    assert_true(check.found == 1);
    assert_true(check.ratios == 0);
    rx_sample_free(sample);
}

static int found_of(const rx_sample *sample, const float *restored)
{
    rx_star_check check;
    assert_int_equal(rx_star_check_run(sample, restored, MARGIN, 2, &check, NULL), RX_OK);
    return (int)check.found;
}

/* A peak of one pixel is found from as far as 1.5 pixels. */
static void peaks_are_found_within_their_radius(void **state)
{
    static const float fractions[] = {0, 0.4996f, 0.5f, 0.8f};
    static float restored[SIDE * SIDE];
    rx_sample *sample = rx_sample_new(SIDE);
    (void)state;
    assert_non_null(sample);
    list_star(sample, 30, 30, 0, 10);
    for (int k = 0; k < 16; k++)
        for (int y = 27; y < 35; y++)
            for (int x = 27; x < 35; x++) {
                float *star = sample->star[0];
                star[0] = 30 + fractions[k % 4];
                star[1] = 30 + fractions[k / 4];
                restored[y * SIDE + x] = 10;
                assert_int_equal(found_of(sample, restored), hypot(x - star[0], y - star[1]) <= 1.5);
                restored[y * SIDE + x] = 0;
            }
    rx_sample_free(sample);
}

/* The brighter star takes the nearer of two peaks, which the fainter one then lacks. */
static void the_nearest_peak_is_taken(void **state)
{
    static const double places[][2] = {{30.9, 29.5}, {30.9998, 29.5}, {31.1, 32.5}, {31.0002, 32.5}};
    (void)state;
    for (int k = 0; k < 8; k++) {
        float restored[SIDE * SIDE] = {0};
        rx_sample *sample = rx_sample_new(SIDE);
        assert_non_null(sample);
        for (int i = 0; i < 2; i++) { /* along x, then along y */
            const double at = places[k / 2][i];
            list_star(sample, k % 2 == 0 ? at : 40, k % 2 == 0 ? 40 : at, 0, 11 - i);
            restored[k % 2 == 0 ? 40 * SIDE + 30 + 2 * i : (30 + 2 * i) * SIDE + 40] = 10;
        }
        assert_int_equal(found_of(sample, restored), 1);
        rx_sample_free(sample);
    }
}

/* Two equal pixels are one peak. */
static void equal_neighbours_are_one_peak(void **state)
{
    static const int next[4][2] = {{1, 0}, {0, 1}, {1, 1}, {-1, 1}};
    (void)state;
    for (int k = 0; k < 4; k++) {
        float restored[SIDE * SIDE] = {0};
        rx_sample *sample = rx_sample_new(SIDE);
        assert_non_null(sample);
        for (int i = 0; i < 2; i++) {
            const int x = 30 + i * next[k][0], y = 30 + i * next[k][1];
            list_star(sample, x, y, 0, 10);
            restored[y * SIDE + x] = 10;
        }
        assert_int_equal(found_of(sample, restored), 1);
        rx_sample_free(sample);
    }
}

static double circle(const float *image, const float *star, double radius)
{
    double sum = 0;
    for (int k = 0; k < SIDE * SIDE; k++)
        if (hypot(k % SIDE - star[0], k / SIDE - star[1]) <= radius)
            sum += image[k];
    return sum;
}

/* Errors of fluxes are of the pixels within twice the FWHM: of images where each pixel tells, with pixels on
 * the circle and hardly beyond it; brighter first, of equals the one that is listed first. */
static void fluxes_of_circles(void **state)
{
    static const double radii[] = {5, 5.0964}; /* the next: sqrt(26) */
    static const double places[3][2] = {{20, 22}, {33.5, 30.25}, {14, 44}};
    float restored[SIDE * SIDE];
    (void)state;
    for (int r = 0; r < 2; r++) {
        rx_star_check check;
        rx_sample *sample = rx_sample_new(SIDE);
        assert_non_null(sample);
        for (int k = 0; k < SIDE * SIDE; k++) {
            sample->y[k] = (float)(2 + sin(3.7 * k));
            restored[k] = (float)(2 + sin(2.3 * k));
        }
        sample->nstars = 3;
        for (int i = 0; i < 3; i++) {
            float *star = sample->star[i];
            star[0] = (float)places[i][0];
            star[1] = (float)places[i][1];
            star[2] = (float)circle(sample->y, star, radii[r]);
            star[3] = 20;
        }
        assert_int_equal(rx_star_check_run(sample, restored, MARGIN, radii[r] / 2, &check, NULL), RX_OK);
        assert_near(check.ratios, 3, 0);
        for (int i = 0; i < 3; i++) {
            const float *star = sample->star[i];
            assert_near(check.error[i],
                        circle(restored, star, radii[r]) / circle(sample->y, star, radii[r]) - 1, 1e-6);
        }
        rx_sample_free(sample);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(adam_as_published),
        cmocka_unit_test(adam_beside_epsilon),
        cmocka_unit_test(adam_finds_a_minimum),
        cmocka_unit_test(schedule_rises_and_falls),
        cmocka_unit_test(patience_counts_low_rates_alone),
        cmocka_unit_test(gradients_are_clipped_together),
        cmocka_unit_test(stars_are_found_and_measured),
        cmocka_unit_test(a_blend_is_found_once),
        cmocka_unit_test(peaks_are_found_within_their_radius),
        cmocka_unit_test(the_nearest_peak_is_taken),
        cmocka_unit_test(equal_neighbours_are_one_peak),
        cmocka_unit_test(fluxes_of_circles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
