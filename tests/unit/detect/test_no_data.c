/* Tiles filled up with a value where there is no data, and such as only look so. */
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
#include "detect/no_data.h"

enum { W = 300, H = 260, N = W * H };

static float pixels[N];
static uint8_t mask[N];

static const rx_image image = {.width = W, .height = H, .pixels = pixels, .mask = mask};

static void make_sky(double level, double sigma)
{
    memset(mask, 0, sizeof mask);
    for (int i = 0; i < N; i++)
        pixels[i] = (float)(level + sigma * rx_random_normal(6, 1, (uint64_t)i));
}

static size_t hide(void)
{
    static uint8_t one[N];
    size_t found, again;
    memcpy(one, mask, sizeof mask);
    assert_int_equal(rx_no_data_hide(&image, false, 1, one, &again, NULL), RX_OK);
    assert_int_equal(rx_no_data_hide(&image, false, 3, mask, &found, NULL), RX_OK);
    assert_int_equal(again, found);
    assert_memory_equal(one, mask, sizeof mask);
    return found;
}

/* In a ring's shape, with tips and steps, beyond a slanted edge, and in a frame of 5 pixels. */
static int is_outside(int shape, int x, int y)
{
    const int from_border = (int)fmin(fmin(x, W - 1 - x), fmin(y, H - 1 - y));
    return shape == 0 ? hypot(x - 150, y - 130) > 125 : shape == 1 ? 3 * x + 2 * y < 400 : from_border < 5;
}

static void finds_what_was_filled_up(void **state)
{
    (void)state;
    static const double levels[] = {0, 100, 100, -20, 0, 100, 100, 100},
                        values[] = {0, 0, -9999, 0, 0.1, 100, 10100, 65535};
    for (size_t k = 0; k < sizeof levels / sizeof *levels; k++)
        for (int shape = 0; shape < 3; shape++) {
            size_t of = 0, hidden = 0;
            make_sky(levels[k], 3);
            for (int i = 0; i < N; i++)
                if (is_outside(shape, i % W, i / W)) {
                    pixels[i] = (float)values[k];
                    of++;
                }
            mask[40 * W + 170] = RX_MASK_SATURATED; /* what is known already stays */
            assert_int_equal(hide(), of);
            for (int i = 0; i < N; i++) {
                assert_int_equal((mask[i] & RX_MASK_BAD) != 0, is_outside(shape, i % W, i / W));
                hidden += mask[i] != 0;
            }
            assert_int_equal(hidden, of + 1);
            assert_int_equal(hide(), 0);
        }
}

static void a_sky_has_no_runs(void **state)
{
    (void)state;
    make_sky(0, 3);
    assert_int_equal(hide(), 0);
    for (int i = 0; i < N; i++)
        pixels[i] = roundf(pixels[i] / 6); /* half a sigma: two of three are 0 */
    assert_int_equal(hide(), 0);
    for (int x = 0; x < 31; x++)
        pixels[100 * W + x] = -9999;
    assert_int_equal(hide(), 0);
    pixels[100 * W + 31] = -9999;
    assert_int_equal(hide(), 32);
}

/* A sky that is rounded away is one of zeros, with some that are none. */
static void a_coarse_sky_stays(void **state)
{
    (void)state;
    make_sky(0, 0.25);
    for (int i = 0; i < N; i++)
        pixels[i] = roundf(pixels[i]);
    assert_int_equal(hide(), 0);
}

/* A galaxy on nothing, cut off where it is faint. */
static void a_model_stays(void **state)
{
    (void)state;
    memset(mask, 0, sizeof mask);
    for (int i = 0; i < N; i++) {
        const double r = hypot(i % W - 140, i / W - 120);
        pixels[i] = r < 60 ? (float)(1000 * exp(-r / 8)) : 0;
    }
    assert_int_equal(hide(), 0);
}

/* Single photons on nothing. */
static void points_stay(void **state)
{
    (void)state;
    make_sky(0, 1);
    for (int i = 0; i < N; i++)
        pixels[i] = pixels[i] > 2.6f ? 1.0f : 0.0f;
    assert_int_equal(hide(), 0);
}

/* Chips of a mosaic, each with its own value beyond it, a map's hole across one, and numbers rounded to tenths of sigma. */
static void finds_several_values(void **state)
{
    (void)state;
    static const float values[] = {0, 0.1f, 17, 100, 1e5f};
    size_t of = 0;
    make_sky(100, 3);
    for (int i = 0; i < N; i++)
        pixels[i] = 0.3f * roundf(pixels[i] / 0.3f);
    for (int i = 0; i < N; i++) {
        const int x = i % W, y = i / W, chip = x / 60;
        if (hypot(x % 60 - 30, y - 130) > 110 + 3 * chip || x % 60 < 2) {
            pixels[i] = values[chip];
            mask[i] = x > 130 && x < 140 && y > 3 ? RX_MASK_WEIGHT
                      : values[chip] > 1e4f       ? RX_MASK_SATURATED
                                                  : 0;
            of += mask[i] != RX_MASK_WEIGHT;
        }
    }
    assert_in_range(hide(), of, of + 12); /* pixels of the sky beside it that are 100 by chance */
    for (int i = 0; i < N; i++)
        if (hypot(i % W % 60 - 30, i / W - 130) > 110 + 3 * (i % W / 60) || i % W % 60 < 2)
            assert_int_not_equal(mask[i] & RX_HIDE_PLAIN, 0);
}

/* A star that fills 41 pixels with one value, with what bleeds from it over half of the tile, whether or not a card says
 * where pixels saturate; beyond the sky's edge the same value is padding. */
static void saturated_stars_stay(void **state)
{
    (void)state;
    for (int padded = 0; padded < 2; padded++)
        for (int known = 0; known < 2; known++) {
            size_t of = 0;
            make_sky(100, 3);
            for (int i = 0; i < N; i++) {
                const int x = i % W, y = i / W, outside = padded && 3 * x + 2 * y < 200;
                const double r = hypot(x - 190, y - 120);
                pixels[i] += (float)(3e5 * pow(1 + r * r / 100, -1.5));
                if (pixels[i] > 3e4f || (abs(x - 191) < 3 && abs(y - 120) < 70) || outside)
                    pixels[i] = 3e4f;
                if (known && pixels[i] >= 3e4f)
                    mask[i] = RX_MASK_SATURATED;
                of += (size_t)outside;
            }
            assert_int_equal(hide(), of);
            assert_int_equal(mask[120 * W + 190] & RX_MASK_BAD, 0);
        }
}

/* Integers of a smoothed sky, cut off below: runs of its lowest value are long, and such of chance. */
static void a_smooth_coarse_sky_stays(void **state)
{
    (void)state;
    static float white[N];
    make_sky(0, 1);
    memcpy(white, pixels, sizeof white);
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            double sum = 0;
            for (int v = -6; v <= 6; v++)
                for (int u = -6; u <= 6; u++)
                    sum += white[(y + v + H) % H * W + (x + u + W) % W] * exp(-(u * u + v * v) / 12.0);
            pixels[y * W + x] = fmaxf(roundf((float)sum), -1);
        }
    assert_int_equal(hide(), 0);
}

/* Light that is far brighter elsewhere: noise is the same on either side of the edge. */
static void a_nebula_hides_no_edge(void **state)
{
    (void)state;
    size_t of = 0;
    make_sky(0, 1);
    for (int i = 0; i < N; i++) {
        const int outside = is_outside(1, i % W, i / W);
        const double r = hypot(i % W - 200, i / W - 170);
        pixels[i] = outside ? 0 : pixels[i] + 50 * (float)exp(-r * r / 4900);
        of += (size_t)outside;
    }
    assert_int_equal(hide(), of);
}

static void all_alike_is_nothing(void **state)
{
    (void)state;
    memset(mask, 0, sizeof mask);
    for (int i = 0; i < N; i++)
        pixels[i] = 1e9f;
    assert_int_equal(hide(), N);
    assert_int_equal(hide(), 0); /* nor is one that is hidden */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_what_was_filled_up), cmocka_unit_test(a_sky_has_no_runs),
        cmocka_unit_test(a_coarse_sky_stays),       cmocka_unit_test(a_model_stays),
        cmocka_unit_test(all_alike_is_nothing),     cmocka_unit_test(points_stay),
        cmocka_unit_test(a_nebula_hides_no_edge),   cmocka_unit_test(finds_several_values),
        cmocka_unit_test(saturated_stars_stay),     cmocka_unit_test(a_smooth_coarse_sky_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
