/* Tiles of stars that are cut off at a level, and such as only reach one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "detect/saturation.h"

enum { W = 200, H = 200, N = W * H, STARS = 40 };

static float pixels[N];
static uint8_t mask[N];
static const rx_image image = {.width = W, .height = H, .pixels = pixels, .mask = mask};

/* Peaks above a sky of 100 +- 3 fall as 1 / rank, `alike`: all are the brightest; Gaussians. */
static void make_stars(double brightest, double fwhm, int alike, uint64_t seed)
{
    memset(mask, 0, sizeof mask);
    for (int i = 0; i < N; i++)
        pixels[i] = (float)(100.0 + 3.0 * rx_random_normal(seed, 1, (uint64_t)i));
    for (int s = 0; s < STARS; s++) {
        const double x0 = 10 + 180 * rx_random_uniform(seed, 2, (uint64_t)s),
                     y0 = 10 + 180 * rx_random_uniform(seed, 3, (uint64_t)s),
                     peak = brightest / (alike ? 1 : 1 + s);
        for (int y = (int)fmax(y0 - 3 * fwhm, 0); y < fmin(y0 + 3 * fwhm, H); y++)
            for (int x = (int)fmax(x0 - 3 * fwhm, 0); x < fmin(x0 + 3 * fwhm, W); x++)
                pixels[y * W + x] +=
                    (float)(peak * exp2(-4.0 * (pow(x - x0, 2) + pow(y - y0, 2)) / (fwhm * fwhm)));
    }
}

/* At `level`, as seen through a flat field of 1 %. */
static void cut_off(double level)
{
    for (int i = 0; i < N; i++)
        pixels[i] =
            (float)(fmin((double)pixels[i], level) * (1.0 + 0.01 * rx_random_normal(9, 4, (uint64_t)i)));
}

static double level_of(void)
{
    double level;
    assert_int_equal(rx_saturation_find(&image, mask, &level, NULL), RX_OK);
    return level;
}

/* The brightest at a third of its peak or less. */
static void finds_the_level(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed < 5; seed++)
        for (double fwhm = 3; fwhm < 10; fwhm += 2) {
            make_stars(100000, fwhm, 0, seed);
            cut_off(30000);
            assert_near(level_of(), 0.95 * 30000, 0.03 * 30000);
            pixels[150] = 60000; /* a hot pixel */
            assert_near(level_of(), 0.95 * 30000, 0.03 * 30000);
        }
}

/* One narrow star is full, in a few pixels: too small a plateau to have 3 x 3 pixels. */
static void finds_the_level_of_one_star(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed < 5; seed++) {
        make_stars(30000, 4, 0, seed);
        for (int i = 0; i < N; i++)
            pixels[i] = fminf(pixels[i], 19000);
        assert_near(level_of(), 19000, 1e-9);
    }
}

/* What is above `level` becomes anything up to three times as much. */
static void make_hollow(double level)
{
    for (int i = 0; i < N; i++)
        if ((double)pixels[i] > level)
            pixels[i] = (float)(3 * level * rx_random_uniform(9, 5, (uint64_t)i));
}

/* Between whole tops and hollow ones: where one pixel alone is above the level it stays a top. */
static void finds_the_level_of_hollow_cores(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed < 5; seed++)
        for (double fwhm = 4; fwhm < 7; fwhm++) {
            make_stars(100000, fwhm, 0, seed);
            make_hollow(12000);
            assert_near(level_of(), 18000, 7000);
        }
}

/* Every tenth column is dead, whatever it goes through. */
static void finds_none_where_columns_are_dead(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed < 5; seed++)
        for (double fwhm = 2; fwhm < 8; fwhm++) {
            make_stars(30000, fwhm, 0, seed);
            for (int i = 0; i < N; i++)
                if (i % 10 == 0)
                    pixels[i] = 0;
            assert_true(level_of() == HUGE_VAL);
        }
}

static void finds_none_where_stars_grow_to_their_centres(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed < 5; seed++)
        for (double fwhm = 1; fwhm < 20; fwhm *= 1.3)
            for (int alike = 0; alike < 2; alike++) {
                make_stars(30000, fwhm, alike, seed);
                assert_true(level_of() == HUGE_VAL);
                for (int i = 0; i < N; i++)
                    pixels[i] = roundf(pixels[i] / 3); /* steps of a sigma */
                assert_true(level_of() == HUGE_VAL);
                pixels[150] = 60000;
                assert_true(level_of() == HUGE_VAL);
            }
}

/* Tops that are noise, a sky without noise, an image without 3 x 3 pixels, nothing that is not hidden. */
static void finds_none_where_there_is_no_top(void **state)
{
    (void)state;
    static const float two[] = {1, 2};
    static const uint8_t none[2] = {0};
    double level;
    make_stars(40, 4, 0, 1);
    assert_true(level_of() == HUGE_VAL);
    for (int i = 0; i < N; i++)
        pixels[i] = (float)(i % W > 150);
    assert_true(level_of() == HUGE_VAL);
    memset(mask, 1, sizeof mask);
    assert_true(level_of() == HUGE_VAL);
    assert_int_equal(
        rx_saturation_find(&(rx_image){.width = 2, .height = 1, .pixels = two}, none, &level, NULL), RX_OK);
    assert_true(level == HUGE_VAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(finds_the_level),
                                       cmocka_unit_test(finds_the_level_of_one_star),
                                       cmocka_unit_test(finds_the_level_of_hollow_cores),
                                       cmocka_unit_test(finds_none_where_columns_are_dead),
                                       cmocka_unit_test(finds_none_where_stars_grow_to_their_centres),
                                       cmocka_unit_test(finds_none_where_there_is_no_top)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
