/* Noise for detection: against its formula where the smoothed brightness is known, and what masks do to it.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
/* cmocka.h comes after the headers it needs */
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "restore/noise_map.h"

enum { SIDE = 64 };

static float pixels[SIDE * SIDE], level[SIDE * SIDE], sigma[SIDE * SIDE];
static uint8_t mask[SIDE * SIDE];

static float *map_of(void)
{
    const rx_tile tile = {.width = SIDE, .height = SIDE, .pixels = pixels, .mask = mask};
    const rx_background sky = {.width = SIDE, .height = SIDE, .level = level, .sigma = sigma};
    rx_error err = RX_ERROR_NONE;
    rx_map_maker *maker = NULL;
    if (rx_noise_map(&tile, &sky, mask, 1, 1, &maker, &err) != RX_OK)
        fail_msg("%s", err.text);
    const rx_map made = rx_map_made(maker, SIDE);
    float *map = calloc(SIDE * SIDE, sizeof *map);
    assert_non_null(map);
    rx_map_fill(&made, SIDE, 1, map);
    free(maker);
    return map;
}

static int make_sky(void **unused)
{
    (void)unused;
    for (int i = 0; i < SIDE * SIDE; i++) {
        level[i] = 100;
        pixels[i] = 100;
        sigma[i] = 2;
        mask[i] = 0;
    }
    return 0;
}

static void test_sky_and_plateau(void **unused)
{
    (void)unused;
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE / 2; x++)
            pixels[y * SIDE + x] = 100 + 2 * 200; /* 200 sigmas */
    for (int y = 0; y < SIDE; y++)
        pixels[y * SIDE + SIDE - 8] = -50; /* below the sky: counts as none */
    float *map = map_of();
    assert_near(map[10 * SIDE + 10], 2 * sqrt(1 + 20.0 * 20.0), 1e-4);
    assert_near(map[10 * SIDE + 50], 2, 1e-6);
    assert_near(map[10 * SIDE + SIDE - 8], 2, 1e-6);
    free(map);
}

/* A single pixel of S sigmas spreads as a Gaussian of sigma 1.5, integrated over pixels:
 *   python3 -c "from math import erf; w = lambda k: (erf((k + .5) / 4.5**.5) - erf((k - .5) / 4.5**.5)) / 2;
 *               print(w(0)**2, w(0) * w(3))"  ->  0.068182 0.0099159 */
static void test_point(void **unused)
{
    (void)unused;
    pixels[32 * SIDE + 32] = 100 + 2 * 1000;
    float *map = map_of();
    assert_near(map[32 * SIDE + 32], 2 * sqrt(1 + pow(0.1 * 68.182, 2)), 0.005);
    assert_near(map[32 * SIDE + 35], 2 * sqrt(1 + pow(0.1 * 9.9159, 2)), 0.005);
    free(map);
}

/* What is hidden reaches nothing, whatever it holds. */
static void test_mask(void **unused)
{
    (void)unused;
    pixels[32 * SIDE + 32] = 1e30f;
    mask[32 * SIDE + 32] = RX_MASK_SATURATED;
    float *map = map_of();
    for (int i = 0; i < SIDE * SIDE; i++)
        assert_near(map[i], 2, 1e-6);
    free(map);
}

/* A piece is the same to the bit wherever it begins and ends, masked pixels in it or not. */
static void test_pieces(void **unused)
{
    (void)unused;
    enum { LONG = 700, HIGH = 130 };
    static float data[LONG * HIGH], piece[60 * 40];
    static uint8_t hidden[LONG * HIGH];
    float usual = 3;
    for (int k = 0; k < LONG * HIGH; k++) {
        data[k] = (float)(k * 37 % 101);
        hidden[k] = k % 211 == 0 || (k % LONG > 300 && k % LONG < 340 && k / LONG == 64);
    }
    const rx_tile tile = {.width = LONG, .height = HIGH, .pixels = data, .mask = hidden};
    const rx_background sky = {.width = LONG, .height = HIGH, .levels.value = 20, .sigmas.value = usual};
    rx_map_maker *maker = NULL;
    assert_int_equal(rx_noise_map(&tile, &sky, hidden, 0.5f, 2, &maker, NULL), RX_OK);
    const rx_map map = rx_map_made(maker, LONG);
    float *whole = calloc(LONG * HIGH, sizeof *whole);
    assert_non_null(whole);
    assert_ptr_equal(rx_map_rows(&map, 0, HIGH, whole), whole);
    assert_true(whole[211 * 10] == 0.5f * usual); /* hidden */
    for (int y = 0; y + 40 <= HIGH; y += 45)
        for (int x = 0; x + 60 <= LONG; x += 127) {
            maker->make(maker, x, y, 60, 40, piece);
            for (int i = 0; i < 40; i++) {
                assert_memory_equal(piece + 60 * i, whole + (y + i) * LONG + x, 60 * sizeof(float));
                assert_true(rx_map_at(&map, x, y + i) == whole[(y + i) * LONG + x]);
            }
        }
    free(whole);
    free(maker);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_sky_and_plateau, make_sky),
        cmocka_unit_test_setup(test_point, make_sky),
        cmocka_unit_test_setup(test_mask, make_sky),
        cmocka_unit_test(test_pieces),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
