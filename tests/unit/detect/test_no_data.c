/* Tiles filled up with a value where there is no data, and such as only look so. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
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
    assert_int_equal(rx_no_data_hide(&image, 1, one, &again, NULL), RX_OK);
    assert_int_equal(rx_no_data_hide(&image, 3, mask, &found, NULL), RX_OK);
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
    static const double levels[] = {0, 100, 100, -20}, values[] = {0, 0, -9999, 0};
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
        cmocka_unit_test(a_nebula_hides_no_edge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
