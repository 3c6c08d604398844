/* Skies with rows and light that are known, and one without. */
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
#include "detect/anomalies.h"

enum { W = 400, H = 320, N = W * H, STARS = 60 };

static const double WIDTH = 1.4; /* pixels, sigma of the PSF */
static float pixels[N], sigma[N], level[N];
static uint8_t mask[N];

static void add_light(double x0, double y0, double peak, double width)
{
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            pixels[y * W + x] +=
                (float)(peak * exp(-(pow(x - x0, 2) + pow(y - y0, 2)) / (2 * width * width)));
}

/* Noise of 2 on a sky of 10, and stars of 5 to 1500 sigma anywhere in their pixels. */
static rx_image make(void)
{
    for (int i = 0; i < N; i++) {
        sigma[i] = 2.0f;
        level[i] = 10.0f;
        mask[i] = 0;
        pixels[i] = 10.0f + 2.0f * (float)rx_random_normal(4, 1, (uint64_t)i);
    }
    for (int s = 0; s < STARS; s++) {
        const double x = W * rx_random_uniform(4, 2, 3 * (uint64_t)s),
                     y = H * rx_random_uniform(4, 2, 3 * (uint64_t)s + 1);
        add_light(x, y, 10 * pow(300, rx_random_uniform(4, 2, 3 * (uint64_t)s + 2)), WIDTH);
    }
    return (rx_image){.width = W,
                      .height = H,
                      .pixels = pixels,
                      .mask = mask,
                      .hide = 1,
                      .with_sky = 1,
                      .level = rx_map_plane(level, W),
                      .noise = rx_map_plane(sigma, W)};
}

static rx_anomalies measure(const rx_image *image)
{
    rx_anomalies one, many;
    assert_int_equal(rx_anomalies_measure(image, 1.0, 1, &one, NULL), RX_OK);
    assert_int_equal(rx_anomalies_measure(image, 1.0, 5, &many, NULL), RX_OK);
    assert_int_equal(one.nx, W / RX_ANOMALIES_BOX);
    assert_int_equal(one.ny, H / RX_ANOMALIES_BOX);
    assert_memory_equal(&one.rows, &many.rows, sizeof one.rows);
    assert_memory_equal(&one.columns, &many.columns, sizeof one.columns);
    assert_memory_equal(&one.light, &many.light, sizeof one.light);
    assert_memory_equal(one.lit, many.lit, (size_t)(one.nx * one.ny));
    rx_anomalies_free(&many);
    return one;
}

/* Stars, and a galaxy with its outskirts, are no anomaly. */
static void test_an_ordinary_sky(void **state)
{
    (void)state;
    const rx_image image = make();
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            pixels[y * W + x] += (float)(2000 / (1 + pow(hypot(x - 120, y - 150) / 4, 2)));
    rx_anomalies a = measure(&image);
    assert_between(a.rows, 0, 0.06);
    assert_between(a.columns, 0, 0.06);
    assert_near(a.light, 0, 0);
    assert_int_equal(rx_anomalies_is_striped(&a), 0);
    assert_int_equal(rx_anomalies_is_lit(&a), 0);
    rx_anomalies_free(&a);
}

static void test_rows_and_columns(void **state)
{
    (void)state;
    for (int columns = 0; columns < 2; columns++) {
        const rx_image image = make();
        for (int i = 0; i < N; i++)
            pixels[i] += (float)rx_random_normal(5, 1, (uint64_t)(columns ? i % W : i / W));
        rx_anomalies a = measure(&image);
        assert_near(columns ? a.columns : a.rows, 0.5, 0.06);
        assert_between(columns ? a.rows : a.columns, 0, 0.06);
        assert_int_equal(rx_anomalies_is_striped(&a), 1);
        assert_int_equal(rx_anomalies_is_lit(&a), 0);
        rx_anomalies_free(&a);
    }
}

static void test_light(void **state)
{
    (void)state;
    const rx_image image = make();
    for (int y = 96; y < 144; y++) /* 3 boxes high, at 1 sigma */
        for (int x = 160; x < W; x++)
            pixels[y * W + x] += 2.0f;
    add_light(328, 120, 100, WIDTH); /* a star there */
    for (int k = 0; k < 2; k++)      /* a faint galaxy in two boxes */
        add_light(248 + 16 * k, 248, 4, 8);
    rx_anomalies a = measure(&image);
    assert_int_equal(a.lit[7 * a.nx + 19] != 0, 1);
    assert_int_equal(a.lit[7 * a.nx + 20], 0);
    assert_int_equal(a.lit[15 * a.nx + 15], 0);
    assert_int_equal(a.lit[15 * a.nx + 16], 0);
    assert_near(a.light, 45.0 / 500.0, 10.0 / 500.0); /* but for boxes with stars */
    assert_int_equal(rx_anomalies_is_lit(&a), 1);
    assert_int_equal(rx_anomalies_is_striped(&a), 0);
    pixels[120 * W + 300] = 20.0f;
    assert_int_equal(rx_anomalies_lit_at(&a, &image, 300, 120), 1);
    assert_int_equal(rx_anomalies_lit_at(&a, &image, 300, 90), 1); /* beside it */
    assert_int_equal(rx_anomalies_lit_at(&a, &image, 300, 60), 0);
    assert_int_equal(rx_anomalies_lit_at(&a, &image, 50, 120), 0);
    pixels[120 * W + 300] = 60.0f; /* too bright for the light to matter */
    assert_int_equal(rx_anomalies_lit_at(&a, &image, 300, 120), 0);
    rx_anomalies_free(&a);
}

/* Values cut off at half a sigma below the sky: as many as a Gaussian has below that have it. Dead pixels far below the sky,
 * alike, and a lowest value on the foot of the noise are no cut. */
static void test_cut(void **state)
{
    (void)state;
    enum { AS_IT_IS, CUT, DEAD, FOOT, KINDS };
    for (int kind = AS_IT_IS; kind < KINDS; kind++) {
        const rx_image image = make();
        for (int i = 0; i < N; i++) {
            mask[i] = i % 5 == 0;
            if (kind == CUT)
                pixels[i] = fmaxf(pixels[i], 9.0f);
            else if (kind != AS_IT_IS && i % 31 == 0)
                pixels[i] = kind == DEAD ? -200.0f : 3.0f;
            else if (kind == FOOT)
                pixels[i] = fmaxf(pixels[i], 3.1f);
            pixels[i] = mask[i] ? -50.0f : pixels[i]; /* hidden */
        }
        rx_anomalies found = measure(&image);
        assert_near(found.cut, kind == CUT ? 0.3 : 0, 0.01);
        assert_int_equal(rx_anomalies_is_cut(&found), kind == CUT);
        rx_anomalies_free(&found);
    }
}

/* Numbers rounded to steps, between them hidden ones that are not, and two rows of other steps. */
static void test_steps(void **state)
{
    (void)state;
    static const double steps[] = {0, 0.5, 2.5, 2.75};
    for (size_t k = 0; k < sizeof steps / sizeof *steps; k++) {
        const rx_image image = make();
        const double step = steps[k];
        for (int i = 0; step > 0 && i < N; i++) {
            const double own = i / W < 2 ? step / 4 : step;
            mask[i] = i % 7 == 0;
            pixels[i] = mask[i] ? pixels[i] : (float)(own * round(pixels[i] / own));
        }
        rx_anomalies found = measure(&image);
        if (step > 0)
            assert_near(found.step, step, 1e-6);
        else
            assert_between(found.step, 1e-6, 0.05);
        assert_int_equal(rx_anomalies_is_coarse(&found, 2.0), step > 2.6);
        rx_anomalies_free(&found);
    }
    const rx_image image = make();
    for (int i = 0; i < N; i++)
        pixels[i] = 10.0f;
    rx_anomalies found = measure(&image);
    assert_near(found.step, 0, 0);
    rx_anomalies_free(&found);
}

static void test_nothing_to_see(void **state)
{
    (void)state;
    const rx_image image = make();
    memset(mask, 1, sizeof mask);
    rx_anomalies a;
    assert_int_equal(rx_anomalies_measure(&image, 1.0, 2, &a, NULL), RX_OK);
    assert_true(isnan(a.rows));
    assert_true(isnan(a.columns));
    assert_true(isnan(a.light));
    assert_int_equal(rx_anomalies_is_striped(&a), 0);
    assert_int_equal(rx_anomalies_is_lit(&a), 0);
    assert_int_equal(rx_anomalies_lit_at(&a, &image, 5, 5), 0);
    rx_anomalies_free(&a);
    /* a tile that is smaller than a box */
    const rx_image tiny = {
        .width = 3, .height = 2, .pixels = pixels, .noise = rx_map_plane(sigma, 3), .level = {0}};
    assert_int_equal(rx_anomalies_measure(&tiny, 1.0, 2, &a, NULL), RX_OK);
    assert_true(isnan(a.rows));
    rx_anomalies_free(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_an_ordinary_sky),
        cmocka_unit_test(test_rows_and_columns),
        cmocka_unit_test(test_light),
        cmocka_unit_test(test_steps),
        cmocka_unit_test(test_cut),
        cmocka_unit_test(test_nothing_to_see),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
