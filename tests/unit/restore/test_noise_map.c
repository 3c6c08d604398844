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
#include "num/convolve.h"
#include "restore/noise_map.h"

enum { SIDE = 64 };

static float pixels[SIDE * SIDE], level[SIDE * SIDE], sigma[SIDE * SIDE];
static uint8_t mask[SIDE * SIDE];

static float *map_of(void)
{
    const rx_image image = {.width = SIDE,
                            .height = SIDE,
                            .pixels = pixels,
                            .level = rx_map_plane(level, SIDE),
                            .with_sky = 1,
                            .noise = rx_map_plane(sigma, SIDE)};
    rx_error err = RX_ERROR_NONE;
    rx_map_maker *maker = NULL;
    if (rx_noise_map(&image, mask, 1, 1, &maker, &err) != RX_OK)
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
    pixels[32 * SIDE + 32] = 100 + 2 * 1000;
    float *map = map_of();
    assert_near(map[32 * SIDE + 32], 2 * sqrt(1 + pow(0.1 * 68.182, 2)), 0.005);
    assert_near(map[32 * SIDE + 35], 2 * sqrt(1 + pow(0.1 * 9.9159, 2)), 0.005);
    free(map);
}

/* The definition at each pixel: the mean, by a Gaussian of sigma 1.5 pixels over what is seen, of the light in
 * sigmas. Bright pixels far apart show the farthest weights. */
static void check_definition(int masked)
{
    float weights[64];
    const double fwhm = 1.5 * 2.3548200450309493;
    const int r = rx_gauss_radius(fwhm);
    rx_gauss_weights(fwhm, r, weights);
    for (int i = 0; i < SIDE * SIDE; i++) {
        level[i] = (float)(100 + i % 5);
        sigma[i] = (float)(1 + i % 3);
        pixels[i] = level[i] + (float)(30 * sin(1.7 * i)) + (i % 379 == 0 ? 1e6f : 0);
        mask[i] = !masked                                           ? (i == 30 * SIDE + 9) * RX_MASK_BAD
                  : i % 97 == 3 || (i / SIDE > 40 && i / SIDE < 45) ? RX_MASK_BAD
                                                                    : 0;
    }
    float *map = map_of();
    for (int i = 0; i < SIDE * SIDE; i++) {
        double num = 0, den = 0;
        for (int k = 0; k < SIDE * SIDE; k++) {
            const int dx = k % SIDE - i % SIDE, dy = k / SIDE - i / SIDE;
            if (abs(dx) > r || abs(dy) > r || mask[k] != 0)
                continue;
            const double weight = (double)weights[dx + r] * (double)weights[dy + r];
            num += weight * fmax(0, (pixels[k] - level[k]) / sigma[k]);
            den += weight;
        }
        const double light = mask[i] != 0 ? 0 : num / den;
        assert_near(map[i] / (sigma[i] * sqrt(1 + 0.01 * light * light)), 1, 1e-5);
    }
    free(map);
}

static void test_definition(void **unused)
{
    check_definition(0); /* one pixel hidden */
    check_definition(1);
}

/* What is hidden reaches nothing, whatever it holds. */
static void test_mask(void **unused)
{
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
    enum { LONG = 700, HIGH = 130 };
    static float data[LONG * HIGH], piece[60 * 40];
    static uint8_t hidden[LONG * HIGH];
    float usual = 3;
    for (int k = 0; k < LONG * HIGH; k++) {
        data[k] = (float)(k * 37 % 101);
        hidden[k] = k % 211 == 0 || (k % LONG > 300 && k % LONG < 340 && k / LONG == 64);
    }
    const rx_background sky = {.width = LONG, .height = HIGH, .levels.value = 20, .sigmas.value = usual};
    const rx_image image = {.width = LONG,
                            .height = HIGH,
                            .pixels = data,
                            .level = rx_background_level(&sky),
                            .with_sky = 1,
                            .noise = rx_background_noise(&sky)};
    rx_map_maker *maker = NULL;
    assert_int_equal(rx_noise_map(&image, hidden, 0.5f, 2, &maker, NULL), RX_OK);
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
        cmocka_unit_test_setup(test_definition, make_sky),
        cmocka_unit_test_setup(test_mask, make_sky),
        cmocka_unit_test(test_pieces),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
