/* Cells of residuals whose cause is known. */
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
#include "data/flags.h"
#include "pipeline/residual.h"

enum { W = 270, H = 200, N = W * H, NX = 4, NY = 3 }; /* cells of 67 or 68 x 66 or 67 pixels */
static const double FWHM = 3.2;

static float pixels[N], sigma[N], level[N], light[N], residual[N];
static int32_t segments[N];
static uint8_t mask[N];
static rx_source stars[400];
static rx_sources sources = {.list = stars, .segments = segments};

/* Noise of 2 on a sky of 10. */
static rx_image make(void)
{
    for (int i = 0; i < N; i++) {
        sigma[i] = 2.0f;
        level[i] = 10.0f;
        pixels[i] = 10.0f + 2.0f * (float)rx_random_normal(3, 1, (uint64_t)i);
    }
    memset(light, 0, sizeof light);
    memset(segments, 0, sizeof segments);
    memset(mask, 0, sizeof mask);
    sources.n = 0;
    return (rx_image){.width = W,
                      .height = H,
                      .pixels = pixels,
                      .mask = mask,
                      .hide = RX_MASK_BAD,
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

static rx_residual measure(const rx_residual_input *input)
{
    rx_residual one, many;
    rx_residual_input of = *input;
    of.nthreads = 1;
    assert_int_equal(rx_residual_measure(&of, &one, NULL), RX_OK);
    of.nthreads = 5;
    assert_int_equal(rx_residual_measure(&of, &many, NULL), RX_OK);
    assert_memory_equal(one.cell, many.cell, (size_t)(one.nx * one.ny));
    assert_memory_equal(one.pull, many.pull, (size_t)(one.nx * one.ny) * sizeof *one.pull);
    rx_residual_free(&many);
    return one;
}

/* Between the sources. */
static rx_residual measure_sky(const rx_image *image)
{
    return measure(&(rx_residual_input){.image = image, .sources = &sources, .fwhm = FWHM});
}

static double mean_pull(const rx_residual *r)
{
    double sum = 0;
    for (int k = 0; k < r->nx * r->ny; k++)
        sum += r->pull[k];
    return sum / (r->nx * r->ny);
}

static void test_noise(void **state)
{
    (void)state;
    const rx_image image = make();
    rx_residual r = measure_sky(&image);
    assert_int_equal(r.nx, NX);
    assert_int_equal(r.ny, NY);
    assert_near(mean_pull(&r), 1, 0.04);
    assert_near(r.share, 0, 0);
    assert_near(r.dark, 0, 0);
    assert_int_equal(r.cause, RX_MISFIT_NONE);
    rx_residual_free(&r);
    /* a source's own light does not count, nor that next to it */
    add(pixels, 20, 20, 12, 50.0f);
    for (int y = 22; y < 30; y++)
        for (int x = 22; x < 30; x++)
            segments[y * W + x] = 1;
    r = measure_sky(&image);
    assert_near(r.share, 0, 0);
    rx_residual_free(&r);
    /* masked pixels say nothing */
    memset(mask, RX_MASK_BAD, sizeof mask);
    r = measure_sky(&image);
    assert_true(isnan(r.share));
    assert_true(isnan(r.dark));
    assert_false(rx_residual_is_large(r.share));
    assert_false(rx_residual_is_dark(r.dark));
    rx_residual_free(&r);
    const rx_residual none = {0};
    assert_int_equal(rx_residual_at(&none, 5, 5), 0);
}

/* Rows and columns that are offset are noise, correlated along them. */
static void test_rows(void **state)
{
    (void)state;
    for (int columns = 0; columns < 2; columns++) {
        rx_image image = make();
        rx_noise_correlation along = rx_noise_white(RX_NOISE_GIVEN);
        along.correlated = 1;
        for (int lag = -RX_NOISE_REACH; lag <= RX_NOISE_REACH; lag++)
            along.at[RX_NOISE_REACH + (columns ? lag : 0)][RX_NOISE_REACH + (columns ? 0 : lag)] =
                lag == 0 ? 1 : 1.44 / 5.44;
        image.correlation = &along;
        for (int i = 0; i < N; i++) {
            pixels[i] += (float)(1.2 * rx_random_normal(9, 1, (uint64_t)(columns ? i % W : i / W)));
            sigma[i] = (float)sqrt(5.44);
        }
        rx_residual r = measure_sky(&image);
        assert_near(mean_pull(&r), 1, 0.15); /* of some 60 independent lines */
        assert_int_equal(r.cause, RX_MISFIT_NONE);
        rx_residual_free(&r);
    }
}

/* Waves of half a sigma and 25 pixels along both diagonals, in two cells alone, and everywhere. */
static float wave(int x, int y)
{
    const double k = 2.0 * M_PI / 25.0 / sqrt(2.0);
    return (float)(1.2 * (cos(k * (x + y)) + cos(k * (x - y))));
}

static void test_structure(void **state)
{
    (void)state;
    const rx_image image = make();
    const double s = FWHM / (2.0 * sqrt(2.0 * log(2.0))), k = 2.0 * M_PI / 25.0;
    for (int y = 0; y < 66; y++)
        for (int x = 0; x < 135; x++)
            pixels[y * W + x] += wave(x, y);
    rx_residual r = measure_sky(&image);
    assert_near(r.share, 2.0 / 12.0, 1e-12);
    assert_int_equal(r.cause, RX_MISFIT_NONE);
    /* the filter leaves exp(-k^2 s^2 / 2) of a wave */
    const double left = 0.6 * exp(-0.5 * k * k * s * s) * 2.0 * sqrt(M_PI) * s;
    assert_near(r.pull[0], sqrt(1.0 + left * left), 0.25);
    assert_int_equal(rx_residual_at(&r, 3, 60), 1);
    assert_int_equal(rx_residual_at(&r, 134.4, 65.4), 1);
    assert_int_equal(rx_residual_at(&r, 134.6, 30), 0);
    assert_int_equal(rx_residual_at(&r, 30, 65.6), 0);
    assert_int_equal(rx_residual_at(&r, -3, 30), 0);
    assert_near(r.pull[NX * NY - 1], 1, 0.25);
    rx_residual_free(&r);
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            pixels[y * W + x] += x < 135 && y < 66 ? 0.0f : wave(x, y);
    r = measure_sky(&image);
    assert_true(rx_residual_is_large(r.share));
    assert_int_equal(r.cause, RX_MISFIT_SKY);
    rx_residual_free(&r);
}

static void test_values(void **state)
{
    (void)state;
    enum { ROUNDED, CUT, LOUD, QUIET, KINDS };
    for (int kind = 0; kind < KINDS; kind++) {
        const rx_image image = make();
        for (int i = 0; i < N; i++)
            pixels[i] = kind == ROUNDED ? 6.0f * roundf(pixels[i] / 6.0f) - 2.0f /* 10 is a value */
                        : kind == CUT   ? fmaxf(pixels[i], 10.0f)
                        : kind == LOUD  ? 10.0f + 1.5f * (pixels[i] - 10.0f)
                                        : 10.0f + 0.7f * (pixels[i] - 10.0f);
        rx_residual r = measure_sky(&image);
        assert_near(r.share, 1, 0);
        assert_int_equal(r.cause, RX_MISFIT_NOISE);
        rx_residual_free(&r);
    }
}

/* Noise that is smoothed, and known to be. */
static void test_correlated_noise(void **state)
{
    (void)state;
    const float kernel[9] = {1, 2, 1, 2, 4, 2, 1, 2, 1};
    rx_image image = make();
    for (int y = 1; y < H - 1; y++)
        for (int x = 1; x < W - 1; x++) {
            double sum = 0;
            for (int k = 0; k < 9; k++)
                sum += kernel[k] * rx_random_normal(3, 1, (uint64_t)((y + k / 3 - 1) * W + x + k % 3 - 1));
            pixels[y * W + x] = 10.0f + (float)(2.0 * sum / 6.0); /* the root of the sum of squares */
        }
    const rx_noise_correlation known = rx_noise_of_kernel(kernel, 3, 3);
    for (int given = 0; given < 2; given++) {
        image.correlation = given ? &known : NULL;
        rx_residual r = measure_sky(&image);
        assert_near(mean_pull(&r), given ? 1.0 : rx_noise_factor(&known, kernel, 3, 3) + 0.25,
                    given ? 0.06 : 0.25);
        assert_int_equal(r.share > 0.5, !given);
        rx_residual_free(&r);
    }
}

/* A grid of stars of S/N 50 by the light of Gaussians whose width is `wider` times the true one; at the flux that a fit gives, 2 q / (1 + q)
 * of the true one, q the ratio of areas. Returns the bias. */
static double add_stars(double wider)
{
    const double s = FWHM / (2.0 * sqrt(2.0 * log(2.0))), q = wider * wider, bias = 2.0 * q / (1.0 + q) - 1.0,
                 flux = 50.0 * 2.0 * 2.0 * sqrt(M_PI) * s;
    sources.n = 0;
    for (int y = 12; y < H - 10; y += 22)
        for (int x = 12; x < W - 10; x += 22) {
            stars[sources.n++] = (rx_source){.fit = {.x = x, .y = y, .star = 1, .snr = 50}};
            for (int j = -10; j <= 10; j++)
                for (int i = -10; i <= 10; i++) {
                    const double r2 = i * i + j * j,
                                 star = flux * exp(-0.5 * r2 / (s * s)) / (2.0 * M_PI * s * s);
                    const int at = (y + j) * W + x + i;
                    pixels[at] += (float)star;
                    light[at] += (float)(flux * (1.0 + bias) * exp(-0.5 * r2 / (s * s * q)) /
                                         (2.0 * M_PI * s * s * q));
                }
        }
    for (int i = 0; i < N; i++)
        residual[i] = pixels[i] - 10.0f - light[i];
    return bias;
}

static rx_residual measure_stars(const rx_image *image, double psf_error)
{
    return measure(&(rx_residual_input){.image = image,
                                        .residual = residual,
                                        .light = light,
                                        .sources = &sources,
                                        .psf_error = psf_error,
                                        .fwhm = FWHM});
}

static void test_psf(void **state)
{
    (void)state;
    static const double wider[] = {1.0, 1.01, 1.06, 0.94, 1.1};
    for (int k = 0; k < 5; k++) {
        const rx_image image = make();
        const double bias = add_stars(wider[k]);
        rx_residual r = measure_stars(&image, 0);
        assert_int_equal(r.cause, fabs(bias) > 0.04 ? RX_MISFIT_PSF : RX_MISFIT_NONE);
        if (r.cause == RX_MISFIT_PSF)
            assert_near(r.by / bias, 1, 0.25);
        rx_residual_free(&r);
        r = measure_stars(&image, 0.03);
        assert_int_equal(r.cause, RX_MISFIT_PSF);
        rx_residual_free(&r);
    }
}

/* Stars scatter by their photons: a gain that is too low promises more of that than there is. */
static void test_gain(void **state)
{
    (void)state;
    rx_image image = make();
    add_stars(1.0);
    for (int i = 0; i < N; i++) {
        const float noise = sqrtf(light[i] / 0.5f) * (float)rx_random_normal(5, 1, (uint64_t)i);
        pixels[i] += noise;
        residual[i] += noise;
    }
    image.gain = 0.5;
    rx_residual r = measure_stars(&image, 0);
    assert_int_equal(r.cause, RX_MISFIT_NONE);
    rx_residual_free(&r);
    image.gain = 0.1;
    r = measure_stars(&image, 0);
    assert_int_equal(r.cause, RX_MISFIT_NOISE);
    assert_near(r.by, 0.58, 0.1); /* of photons alone, the root of 0.2; with the sky's as many 0.77 */
    rx_residual_free(&r);
}

/* A crowd leaves no sky: nothing is known without a model of it, and with one what that leaves. */
static void test_crowd(void **state)
{
    (void)state;
    const rx_image image = make();
    for (int i = 0; i < N; i++) {
        segments[i] = 1;
        light[i] = (float)(10.0 + 5.0 * cos(0.2 * (i % W)) * cos(0.2 * (i / W)));
        pixels[i] += light[i];
        residual[i] = pixels[i] - 10.0f - light[i];
    }
    rx_residual r = measure_sky(&image);
    assert_true(isnan(r.share));
    rx_residual_free(&r);
    const rx_residual_input fitted = {
        .image = &image, .residual = residual, .light = light, .sources = &sources, .fwhm = FWHM};
    r = measure(&fitted);
    assert_near(r.share, 0, 0);
    rx_residual_free(&r);
    for (int i = 0; i < N; i++)
        residual[i] += 0.3f * (light[i] - 10.0f);
    r = measure(&fitted);
    assert_near(r.share, 1, 0);
    assert_int_equal(r.cause, RX_MISFIT_SKY);
    rx_residual_free(&r);
}

/* Photons of what the model has are noise, too: gain 0.045 makes sigma 20 of 18 ADU. */
static void test_photons(void **state)
{
    (void)state;
    rx_image image = make();
    for (int i = 0; i < N; i++) {
        light[i] = 18.0f;
        pixels[i] += 18.0f + 20.0f * (float)rx_random_normal(4, 1, (uint64_t)i);
    }
    for (int given = 0; given < 2; given++) {
        image.gain = given ? 0.045 : 0.0;
        rx_residual r =
            measure(&(rx_residual_input){.image = &image, .light = light, .sources = &sources, .fwhm = FWHM});
        assert_near(r.share, given ? 0 : 1, 0);
        rx_residual_free(&r);
    }
}

static void test_dark(void **state)
{
    (void)state;
    const rx_image image = make();
    add(pixels, 0, 0, 66, -0.8f); /* 0.4 sigma below the sky, in a cell of 67 x 66 pixels */
    rx_residual r = measure_sky(&image);
    assert_near(r.dark, 4.0 / 48.0, 1e-12);
    assert_true(rx_residual_is_dark(r.dark));
    assert_int_equal(rx_residual_dark_at(&r, 3, 60), 1);
    assert_int_equal(rx_residual_dark_at(&r, 66.4, 65.4), 1);
    assert_int_equal(rx_residual_dark_at(&r, 66.6, 30), 0);
    assert_int_equal(rx_residual_dark_at(&r, 70, 70), 0);
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
        add(light, 20, 20, 16, 500.0f);
        for (int i = 0; i < N; i++) {
            light[i] *= unit;
            sigma[i] *= unit;
            level[i] *= unit;
            pixels[i] = pixels[i] * unit + light[i];
        }
        const rx_residual_input input = {.image = &image, .light = light, .sources = &sources, .fwhm = FWHM};
        rx_residual r = measure(&input);
        assert_near(r.share, 0, 0);
        rx_residual_free(&r);
        add(pixels, 70, 70, 60, 2.0f * unit);
        r = measure(&input);
        assert_int_equal(rx_residual_at(&r, 90, 90), 1);
        rx_residual_free(&r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_noise),
        cmocka_unit_test(test_rows),
        cmocka_unit_test(test_structure),
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_correlated_noise),
        cmocka_unit_test(test_psf),
        cmocka_unit_test(test_gain),
        cmocka_unit_test(test_crowd),
        cmocka_unit_test(test_photons),
        cmocka_unit_test(test_dark),
        cmocka_unit_test(test_of_any_unit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
