/* Cells of a residual that is known. */
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
#include "pipeline/residual.h"

enum { W = 200, H = 150, N = W * H }; /* 4 x 3 cells, those at the border 8 and 22 pixels wide */

static float pixels[N], sigma[N], level[N], model[N];
static uint8_t mask[N];

/* Noise of 2 on a sky of 10. */
static rx_image make(void)
{
    for (int i = 0; i < N; i++) {
        sigma[i] = 2.0f;
        level[i] = 10.0f;
        model[i] = 0.0f;
        mask[i] = 0;
        pixels[i] = 10.0f + 2.0f * (float)rx_random_normal(3, 1, (uint64_t)i);
    }
    return (rx_image){.width = W,
                      .height = H,
                      .pixels = pixels,
                      .with_sky = 1,
                      .level = rx_map_plane(level, W),
                      .noise = rx_map_plane(sigma, W)};
}

static void add(float *plane, int x0, int y0, int side, float value)
{
    for (int y = y0; y < y0 + side; y++)
        for (int x = x0; x < x0 + side; x++)
            plane[y * W + x] += value;
}

static rx_residual judge(const rx_image *image, int nthreads)
{
    const rx_restored restored = {.width = W, .height = H, .reblurred = model, .mask = mask};
    rx_residual residual;
    assert_int_equal(rx_residual_flag(image, &restored, nthreads, &residual, NULL), RX_OK);
    return residual;
}

static void test_what_is_explained(void **state)
{
    (void)state;
    const rx_image image = make();
    rx_residual r = judge(&image, 1);
    assert_int_equal(r.nx, 4);
    assert_int_equal(r.ny, 3);
    assert_int_equal(r.cells, 9); /* the last column has too few pixels, the last row enough */
    assert_int_equal(r.unexplained, 0);
    assert_near(r.share, 0, 0);
    assert_near(r.dark, 0, 0);
    assert_false(rx_residual_is_dark(r.dark));
    assert_false(rx_residual_is_large(r.share));
    rx_residual_free(&r);
    /* light that the model has is explained; a star too bright for any PSF is not asked */
    add(pixels, 70, 70, 30, 40.0f);
    add(model, 70, 70, 30, 40.0f);
    add(pixels, 20, 20, 10, 1500.0f);
    add(model, 20, 20, 10, 1000.0f);
    r = judge(&image, 1);
    assert_int_equal(r.unexplained, 0);
    rx_residual_free(&r);
    /* but a model that is bright where the pixels are not is made up */
    add(model, 140, 75, 10, 1000.0f);
    r = judge(&image, 1);
    assert_int_equal(r.unexplained, 1);
    assert_int_equal(rx_residual_at(&r, 145, 80), 1);
    rx_residual_free(&r);
}

static void test_what_is_not(void **state)
{
    (void)state;
    const rx_image image = make();
    add(pixels, 0, 0, 64, -0.8f);             /* 0.4 sigma below the sky, and the model is flat there */
    add(pixels, 128, 64, 64, 0.4f);           /* 0.2 above */
    add(pixels, 64 + 20, 64 + 20, 10, 30.0f); /* a source that is gone */
    rx_residual r = judge(&image, 1), many = judge(&image, 5);
    assert_int_equal(r.unexplained, 2);
    assert_near(r.share, 2.0 / 9.0, 1e-12);
    assert_true(rx_residual_is_large(r.share));
    assert_int_equal(rx_residual_at(&r, 3, 60), 1);
    assert_int_equal(rx_residual_at(&r, 63.4, 63.4), 1);
    assert_int_equal(rx_residual_at(&r, 63.6, 30), 0);
    assert_int_equal(rx_residual_at(&r, 70, 70), 1);
    assert_int_equal(rx_residual_at(&r, 140, 70), 0);
    assert_int_equal(rx_residual_at(&r, -3, 70), 0);
    assert_int_equal(rx_residual_dark_at(&r, 3, 60), 1);
    assert_int_equal(rx_residual_dark_at(&r, 63.4, 63.4), 1);
    assert_int_equal(rx_residual_dark_at(&r, 63.6, 30), 0);
    assert_int_equal(rx_residual_dark_at(&r, 70, 70), 0);
    assert_true(rx_residual_is_dark(r.dark));
    assert_near(r.dark, 4.0 / 34.0, 1e-12); /* 6 x 5 boxes, and 4 of 8 x 32 pixels at the right */
    assert_memory_equal(r.cell, many.cell, 12);
    assert_near(many.dark, r.dark, 0);
    rx_residual_free(&r);
    rx_residual_free(&many);
    /* masked pixels say nothing */
    memset(mask, 1, sizeof mask);
    r = judge(&image, 1);
    assert_int_equal(r.cells, 0);
    assert_true(isnan(r.share));
    assert_true(isnan(r.dark));
    assert_false(rx_residual_is_large(r.share));
    assert_false(rx_residual_is_dark(r.dark));
    rx_residual_free(&r);
    const rx_residual none = {0};
    assert_int_equal(rx_residual_at(&none, 5, 5), 0);
}

/* Photons of what the model has are noise, too: gain 0.1 makes sigma 20 of 40 ADU. */
static void test_photons(void **state)
{
    (void)state;
    rx_image image = make();
    for (int i = 0; i < N; i++) {
        model[i] = 40.0f;
        pixels[i] += 40.0f + 20.0f * (float)rx_random_normal(4, 1, (uint64_t)i);
    }
    rx_residual r = judge(&image, 1);
    assert_int_equal(r.unexplained, r.cells);
    rx_residual_free(&r);
    image.gain = 0.1;
    r = judge(&image, 1);
    assert_int_equal(r.unexplained, 0);
    rx_residual_free(&r);
}

/* In W m^-2 Hz^-1 a sky's noise is 1e-30 or so, and its square in single precision 0. */
static void test_of_any_unit(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        const float unit = k == 0 ? 1e-30f : 1e25f;
        rx_image image = make();
        image.gain = 2.0 / (double)unit;
        add(model, 20, 20, 30, 500.0f);
        for (int i = 0; i < N; i++) {
            model[i] *= unit;
            sigma[i] *= unit;
            level[i] *= unit;
            pixels[i] = pixels[i] * unit + model[i];
        }
        rx_residual r = judge(&image, 1);
        assert_near(r.share, 0.0, 0.0);
        rx_residual_free(&r);
        add(pixels, 70, 70, 50, 5.0f * unit);
        r = judge(&image, 1);
        assert_int_equal(rx_residual_at(&r, 90, 90), 1);
        rx_residual_free(&r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_what_is_explained),
        cmocka_unit_test(test_what_is_not),
        cmocka_unit_test(test_photons),
        cmocka_unit_test(test_of_any_unit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
