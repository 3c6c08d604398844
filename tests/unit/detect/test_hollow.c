/* Cores that were left low, and what only looks like one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "detect/hollow.h"

enum { W = 200, H = 200, N = W * H, STARS = 25 };
static const double SKY = 100.0, NOISE = 3.0;

static float pixels[N], level[N], noise[N];
static uint8_t mask[N];

static void make_sky(void)
{
    memset(mask, 0, sizeof mask);
    for (int i = 0; i < N; i++) {
        level[i] = (float)SKY;
        noise[i] = (float)NOISE;
        pixels[i] = (float)(SKY + NOISE * rx_random_normal(1, 1, (uint64_t)i));
    }
}

/* A ring of radius r where that is above 0. */
static void add(double x0, double y0, double peak, double r, double fwhm)
{
    for (int i = 0; i < N; i++) {
        const double far = hypot(i % W - x0, i / W - y0) - r;
        pixels[i] += (float)(peak * exp2(-4.0 * far * far / (fwhm * fwhm)));
    }
}

static void add_stars(double fwhm, double brightest)
{
    for (int s = 0; s < STARS; s++)
        add(20 + 40 * (s % 5) + rx_random_uniform(1, 2, (uint64_t)s),
            20 + 40 * (s / 5) + rx_random_uniform(1, 3, (uint64_t)s), brightest / (1 + s), 0, fwhm);
}

/* Pixels above `limit` become `low`. How many. */
static size_t make_hollow(float limit, float low)
{
    size_t n = 0;
    for (int i = 0; i < N; i++)
        if (pixels[i] > limit) {
            pixels[i] = low;
            n++;
        }
    return n;
}

static size_t hidden(void)
{
    const rx_image image = {.width = W,
                            .height = H,
                            .pixels = pixels,
                            .mask = mask,
                            .with_sky = 1,
                            .level = rx_map_plane(level, W),
                            .noise = rx_map_plane(noise, W),
                            .global_noise = NOISE};
    size_t n, marked = 0;
    assert_int_equal(rx_hollow_hide(&image, mask, &n, NULL), RX_OK);
    for (int i = 0; i < N; i++)
        marked += (mask[i] & RX_MASK_BAD) != 0;
    assert_int_equal(marked, n);
    return n;
}

static void hides_all_cores(void **state)
{
    static const float lows[] = {-3000, 0, 100, 400};
    (void)state;
    for (double fwhm = 4; fwhm < 9; fwhm += 1.5)
        for (int i = 0; i < (fwhm > 8 ? 4 : 3);
             i++) { /* a narrow PSF is half as high as that beside the core */
            make_sky();
            add_stars(fwhm, 100000);
            const size_t n = make_hollow(2000, lows[i]);
            assert_true(n > 30);
            assert_int_equal(hidden(), n);
            for (int k = 0; k < N; k++)
                assert_int_equal(mask[k], pixels[k] == lows[i] ? RX_MASK_BAD | RX_MASK_SATURATED : 0);
        }
}

/* A ring at the level that is marked, and lower ones inside. */
static void hides_cores_in_saturated_rings(void **state)
{
    size_t n = 0;
    (void)state;
    make_sky();
    add_stars(6, 100000);
    for (int i = 0; i < N; i++)
        if (pixels[i] > 2000) {
            n += pixels[i] > 3500;
            mask[i] = pixels[i] > 3500 ? 0 : RX_MASK_SATURATED;
            pixels[i] = pixels[i] > 3500 ? 50 : 2000;
        }
    assert_true(n > 30);
    assert_int_equal(hidden(), n);
}

static void hides_nothing_in_whole_stars(void **state)
{
    (void)state;
    for (double fwhm = 1; fwhm < 20; fwhm *= 1.3) {
        make_sky();
        add_stars(fwhm, 100000);
        assert_int_equal(hidden(), 0);
    }
}

/* Rings as narrow as the PSF, one of stars, a dark lane through a galaxy. */
static void hides_nothing_in_rings_and_lanes(void **state)
{
    (void)state;
    for (double fwhm = 2; fwhm < 6; fwhm += 0.5) {
        make_sky();
        for (int i = 0; i < 9; i++)
            add(30 + 60 * (i % 3) + 0.1 * i, 30 + 60 * (i / 3) + 0.2 * i, 5000, 2 + 2.3 * i, fwhm);
        assert_int_equal(hidden(), 0);
    }
    for (int stars = 4; stars < 12; stars++) {
        make_sky();
        for (int i = 0; i < stars; i++)
            add(100 + 4 * cos(6.2832 * i / stars), 100 + 4 * sin(6.2832 * i / stars), 5000, 0, 2);
        assert_int_equal(hidden(), 0);
    }
    make_sky();
    add(100, 100, 5000, 0, 40);
    for (int i = 0; i < N; i++)
        if (abs(i / W - 100) < 2)
            pixels[i] = (float)SKY;
    assert_int_equal(hidden(), 0);
}

/* A crowd of twenty stars in the area of each PSF. */
static void hides_nothing_in_crowds(void **state)
{
    (void)state;
    for (double fwhm = 1.5; fwhm < 4; fwhm += 0.5) {
        make_sky();
        for (int s = 0; s < 4000; s++) {
            const double x0 = W * rx_random_uniform(2, 2, (uint64_t)s),
                         y0 = H * rx_random_uniform(2, 3, (uint64_t)s),
                         peak = 500 / rx_random_uniform(2, 4, (uint64_t)s);
            for (int y = (int)fmax(y0 - 8, 0); y < fmin(y0 + 8, H); y++)
                for (int x = (int)fmax(x0 - 8, 0); x < fmin(x0 + 8, W); x++)
                    pixels[y * W + x] +=
                        (float)(peak * exp2(-4 * (pow(x - x0, 2) + pow(y - y0, 2)) / (fwhm * fwhm)));
        }
        assert_int_equal(hidden(), 0);
    }
}

/* On the slope of a source, across its border, beside the tile's, masked already, or one on a peak. */
static void hides_no_dead_pixels(void **state)
{
    (void)state;
    make_sky();
    add(100, 100, 5000, 0, 40);
    add(2, 50, 5000, 0, 6);
    for (int i = 0; i < 3; i++)
        pixels[(100 + i) * W + 110] = pixels[90 * W + 100 + i] = pixels[50 * W + i] = 0;
    pixels[100 * W + 100] = 0;
    mask[100 * W + 100] = RX_MASK_WEIGHT;
    add(50, 150, 5000, 0, 6);
    pixels[150 * W + 50] = 0;
    assert_int_equal(hidden(), 0);
}

/* Images of fewer than 3 x 3 pixels. */
static void hides_nothing_where_there_is_no_inside(void **state)
{
    (void)state;
    size_t n;
    make_sky();
    const rx_image image = {
        .width = 2, .height = 1, .pixels = pixels, .mask = mask, .noise = rx_map_plane(noise, 2)};
    assert_int_equal(rx_hollow_hide(&image, mask, &n, NULL), RX_OK);
    assert_int_equal(n, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(hides_all_cores),
                                       cmocka_unit_test(hides_cores_in_saturated_rings),
                                       cmocka_unit_test(hides_nothing_in_whole_stars),
                                       cmocka_unit_test(hides_nothing_in_rings_and_lanes),
                                       cmocka_unit_test(hides_nothing_in_crowds),
                                       cmocka_unit_test(hides_no_dead_pixels),
                                       cmocka_unit_test(hides_nothing_where_there_is_no_inside)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
