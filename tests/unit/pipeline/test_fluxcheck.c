/* The comparison of fluxes on restored and untouched pixels: a known factor is found, few sources give none.
 */
#include "../near.h"
#include "scene.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "detect/detect.h"
#include "pipeline/fluxcheck.h"

enum { SIDE = 400 };

typedef struct bench {
    scene scene;
    float *scaled, *sigma;
    rx_image untouched, restored;
    rx_psf psf;
    rx_measure_params par;
    rx_sources *sources;
} bench;

static rx_image image_of(const float *pixels, const float *sigma)
{
    return (rx_image){.width = SIDE,
                      .height = SIDE,
                      .pixels = pixels,
                      .noise = rx_map_plane(sigma, SIDE),
                      .global_noise = 5.0};
}

/* "Restored" pixels are the untouched ones times `factor`: what they are measured on. */
static void setup(bench *b, int nstars, float factor)
{
    const size_t n = (size_t)SIDE * SIDE;
    scene_make(&b->scene, SIDE, SIDE, nstars, 11);
    b->scaled = RX_NEW(float, n);
    b->sigma = RX_NEW(float, n);
    assert_true(b->scaled != NULL);
    assert_true(b->sigma != NULL);
    for (size_t i = 0; i < n; i++) {
        b->scene.pixels[i] -= 1000.0f;
        b->scaled[i] = factor * b->scene.pixels[i];
        b->sigma[i] = 5.0f;
    }
    b->psf = (rx_psf){.fwhm = 3.5};
    b->untouched = image_of(b->scene.pixels, b->sigma);
    b->untouched.psf = &b->psf;
    b->restored = image_of(b->scaled, b->sigma);
    b->par = (rx_measure_params){.auto_factor = 2.5,
                                 .auto_min_radius = 3.5,
                                 .neighbours = RX_NEIGHBOURS_CORRECT,
                                 .skip = RX_SKIP_PETRO | RX_SKIP_RADIUS | RX_SKIP_WIN | RX_SKIP_APER,
                                 .nthreads = 1};
    rx_detect_params detect = {.threshold = 3.0,
                               .analysis_threshold = 3.0,
                               .min_area = 5,
                               .deblend_levels = 32,
                               .deblend_contrast = 0.005,
                               .clean = 1,
                               .clean_param = 1.0,
                               .pixstack = 300000,
                               .pixstack_max = 1000000,
                               .subobjects = 1024,
                               .subobjects_max = 4096};
    rx_image image = {.width = SIDE, .height = SIDE, .pixels = b->scaled, .global_noise = 5.0};
    assert_int_equal(rx_detect_run(&detect, &image, NULL, NULL, &b->sources, NULL), RX_OK);
    assert_int_equal(rx_measure_run(&b->par, &b->restored, NULL, NULL, b->sources, NULL), RX_OK);
}

static void teardown(bench *b)
{
    scene_free(&b->scene);
    free(b->scaled);
    free(b->sigma);
    rx_sources_free(b->sources);
}

static void a_known_factor_is_found(void **state)
{
    (void)state;
    bench b;
    rx_fluxcheck check;
    setup(&b, 60, 1.02f);
    assert_int_equal(rx_fluxcheck_run(&b.par, &b.restored, &b.untouched, b.sources, NULL, &check, NULL),
                     RX_OK);
    assert_true(check.n >= 10);
    assert_near(check.diameter, 17.5, 1e-12);
    assert_near(check.wide, 1.02, 1e-5);
    assert_true(check.wide_error < 0.001); /* the sky's share */
    /* AUTO holds 94 % of a star and more (SExtractor manual), never more than all of it */
    assert_true(check.automatic > 0.92 * 1.02);
    assert_true(check.automatic < 1.02);
    assert_true(check.automatic_error > 0.0);
    assert_true(check.automatic_error < 0.02);
    teardown(&b);
}

/* A fifth of the PSF's light is beyond the aperture of the original pixels, and within it on the restored ones. */
static void wings_that_come_in_are_no_factor(void **state)
{
    (void)state;
    enum { SIZE = 41 };
    bench b;
    rx_fluxcheck check;
    setup(&b, 60, 1.25f);
    rx_psf *wide = rx_psf_new(RX_PSF_MOFFAT, SIZE, 1);
    assert_non_null(wide);
    wide->fwhm = 3.5;
    wide->basis[SIZE * SIZE / 2] = 0.8f;
    wide->basis[0] = 0.2f;
    b.untouched.psf = wide;
    assert_int_equal(rx_fluxcheck_run(&b.par, &b.restored, &b.untouched, b.sources, NULL, &check, NULL),
                     RX_OK);
    assert_near(check.wide, 1.0, 1e-5);
    assert_true(check.automatic < 1.0);
    rx_psf_free(wide);
    teardown(&b);
}

/* The same light more around every source, as of a sky that is off by 0.015 sigma, is no scale, but 4 % more of each are. */
static void light_alike_is_no_scale(void **state)
{
    (void)state;
    for (int scaled = 0; scaled < 2; scaled++) {
        bench b;
        rx_fluxcheck check;
        setup(&b, 60, scaled ? 1.04f : 1.0f);
        for (int i = 0; i < SIDE * SIDE; i++) { /* faint stars, whose noise is next to nothing here */
            b.scene.pixels[i] *= 0.15f;
            b.scaled[i] = 0.15f * b.scaled[i] + 0.075f;
        }
        for (int i = 0; i < b.sources->n; i++) { /* of like brightness, so that it is a like share of each */
            if (!(b.sources->list[i].flux_auto > 4000 && b.sources->list[i].flux_auto < 12000))
                b.sources->list[i].flux_auto = 0;
            b.sources->list[i].flux_auto *= 0.15;
            b.sources->list[i].fluxerr_auto *= 0.15;
        }
        assert_int_equal(rx_fluxcheck_run(&b.par, &b.restored, &b.untouched, b.sources, NULL, &check, NULL),
                         RX_OK);
        print_message("%d: %.4f +- %.4f, AUTO %.4f +- %.4f\n", check.n, check.wide, check.wide_error,
                      check.automatic, check.automatic_error);
        assert_true(check.n >= 5);
        assert_int_equal(rx_fluxcheck_is_off(&check), scaled);
        teardown(&b);
    }
}

/* Where wings of a bright one are, nothing is compared. */
static void what_others_light_is_left_out(void **state)
{
    (void)state;
    bench b;
    rx_fluxcheck all, check;
    setup(&b, 60, 1.02f);
    assert_int_equal(rx_fluxcheck_run(&b.par, &b.restored, &b.untouched, b.sources, NULL, &all, NULL), RX_OK);
    rx_source *bright = &b.sources->list[b.sources->n / 2];
    bright->flux_auto *= 1e6;
    bright->flags = RX_FLAG_SATURATED;
    assert_int_equal(rx_fluxcheck_run(&b.par, &b.restored, &b.untouched, b.sources, NULL, &check, NULL),
                     RX_OK);
    assert_true(check.n < all.n - 1);
    teardown(&b);
}

static void few_sources_tell_nothing(void **state)
{
    (void)state;
    bench b;
    rx_fluxcheck check;
    setup(&b, 3, 1.0f);
    assert_int_equal(rx_fluxcheck_run(&b.par, &b.restored, &b.untouched, b.sources, NULL, &check, NULL),
                     RX_OK);
    assert_int_equal(check.n, 0);
    teardown(&b);
}

/* 1 % and 5 sigma, both on each side; FLUX_AUTO only above, by 2 %. */
static void off_is_beyond_1_percent_and_5_sigma(void **state)
{
    (void)state;
    static const struct {
        int n;
        double wide, wide_error, automatic, automatic_error;
        int off;
    } cases[] = {
        {100, 1.0099, 0.0001, 0.95, 0.001, 0}, /* below 1 %, however sure */
        {100, 1.0101, 0.0001, 0.95, 0.001, 1},   {100, 0.9901, 0.0001, 0.95, 0.001, 0},
        {100, 0.9899, 0.0001, 0.95, 0.001, 1},   {100, 1.0490, 0.0100, 0.95, 0.001, 0}, /* 4.9 sigma */
        {100, 1.0510, 0.0100, 0.95, 0.001, 1},   {100, 1.0000, 0.0001, 1.0199, 0.001, 0},
        {100, 1.0000, 0.0001, 1.0201, 0.001, 1}, {100, 1.0000, 0.0001, 1.0490, 0.010, 0},
        {100, 1.0000, 0.0001, 1.0510, 0.010, 1}, {100, 1.0000, 0.0001, 0.80, 0.001, 0}, /* light left out */
        {100, 1.0000, 0.0001, NAN, NAN, 0},      {0, 1.5, 0.0001, 1.5, 0.0001, 0},      /* nothing measured */
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const rx_fluxcheck check = {.n = cases[i].n,
                                    .wide = cases[i].wide,
                                    .wide_error = cases[i].wide_error,
                                    .automatic = cases[i].automatic,
                                    .automatic_error = cases[i].automatic_error};
        if (rx_fluxcheck_is_off(&check) != cases[i].off)
            fail_msg("case %zu: %g +- %g, %g +- %g", i, check.wide, check.wide_error, check.automatic,
                     check.automatic_error);
    }
}

/* The ratio that is off says how far, not one whose small error makes it the farther one. */
static void excess_of_the_ratio_that_is_off(void **state)
{
    (void)state;
    rx_fluxcheck check = {50, 10, 1.0099, 0.0001, 1.04, 0.005};
    assert_near(rx_fluxcheck_excess(&check), 8, 1e-9);
    check.automatic = 0.9; /* the light that it leaves out */
    assert_near(rx_fluxcheck_excess(&check), 0, 0);
    check.wide = 0.98;
    assert_near(rx_fluxcheck_excess(&check), 10, 1e-9);
    check.wide_error = 0.0045;
    assert_near(rx_fluxcheck_excess(&check), 0, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(excess_of_the_ratio_that_is_off),
        cmocka_unit_test(a_known_factor_is_found),
        cmocka_unit_test(wings_that_come_in_are_no_factor),
        cmocka_unit_test(light_alike_is_no_scale),
        cmocka_unit_test(few_sources_tell_nothing),
        cmocka_unit_test(what_others_light_is_left_out),
        cmocka_unit_test(off_is_beyond_1_percent_and_5_sigma),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
