/* Noise whose correlation is known, with and without stars on it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "detect/correlation.h"
#include "io/fits_read.h"

enum { SIDE = 700, MID = RX_NOISE_REACH };

/* White noise of width 3 on a sky of 50, as many stars of FWHM 3.5, and the mean of pixels (0, 0), (1, 0), (0, 1), (1, 1) with these weights. */
static float *draw(double shift, int stars)
{
    const int side = SIDE + 1;
    float *white = malloc((size_t)side * side * sizeof *white),
          *dst = malloc((size_t)SIDE * SIDE * sizeof *dst);
    assert_non_null(white);
    assert_non_null(dst);
    for (int i = 0; i < side * side; i++)
        white[i] = 3.0f * (float)rx_random_normal(5, 1, (uint64_t)i);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            const float *w = white + y * side + x;
            dst[y * SIDE + x] =
                50.0f + (float)((1 - shift) * (1 - shift) * w[0] + shift * (1 - shift) * (w[1] + w[side]) +
                                shift * shift * w[side + 1]);
        }
    for (int s = 0; s < stars; s++) {
        const double u = SIDE * rx_random_uniform(6, 2, 3 * (uint64_t)s),
                     v = SIDE * rx_random_uniform(6, 2, 3 * (uint64_t)s + 1),
                     peak = 3.0 * pow(10.0, 3.5 * rx_random_uniform(6, 2, 3 * (uint64_t)s + 2));
        for (int y = (int)v - 12; y <= (int)v + 12; y++)
            for (int x = (int)u - 12; x <= (int)u + 12; x++)
                if (x >= 0 && y >= 0 && x < SIDE && y < SIDE)
                    dst[y * SIDE + x] +=
                        (float)(peak * exp(-((x - u) * (x - u) + (y - v) * (y - v)) / (2 * 1.5 * 1.5)));
    }
    free(white);
    return dst;
}

static rx_noise_correlation measure_image(const float *pixels, int width, int height, int nthreads)
{
    static float sigma[SIDE * SIDE], level[SIDE * SIDE];
    rx_noise_correlation noise;
    for (int i = 0; i < width * height; i++) {
        sigma[i] = 3.0f;
        level[i] = 50.0f;
    }
    const rx_image image = {.width = width,
                            .height = height,
                            .pixels = pixels,
                            .with_sky = 1,
                            .level = rx_map_plane(level, width),
                            .noise = rx_map_plane(sigma, width)};
    assert_int_equal(rx_correlation_measure(&image, NULL, nthreads, &noise, NULL), RX_OK);
    return noise;
}

static rx_noise_correlation measure(double shift, int stars, int nthreads)
{
    float *pixels = draw(shift, stars);
    const rx_noise_correlation noise = measure_image(pixels, SIDE, SIDE, nthreads);
    free(pixels);
    return noise;
}

static void test_white_noise_is_white(void **state)
{
    (void)state;
    for (int stars = 0; stars <= 800; stars += 400) {
        const rx_noise_correlation noise = measure(0, stars, 2);
        assert_int_equal(noise.origin, RX_NOISE_MEASURED);
        assert_int_equal(noise.correlated, 0);
        assert_near(noise.at[MID][MID + 1], 0, 0);
        assert_near(rx_noise_factor_wide(&noise), 1, 0);
        assert_near(noise.scale, 1, 0.015);
        assert_true(noise.skewness_error < 0.02);
        assert_near(noise.skewness, 0, 5 * noise.skewness_error + 0.02);
    }
}

/* Exponential pixels: 2, and 1.437 where they are cut 4 sigma above their median. */
static void test_skewed_pixels(void **state)
{
    (void)state;
    float *pixels = malloc((size_t)SIDE * SIDE * sizeof *pixels);
    assert_non_null(pixels);
    for (uint64_t k = 0; k < (uint64_t)SIDE * SIDE; k++)
        pixels[k] = (float)(1.5 * (pow(rx_random_normal(3, 1, k), 2) + pow(rx_random_normal(3, 2, k), 2)));
    const rx_noise_correlation noise = measure_image(pixels, SIDE, SIDE, 1);
    free(pixels);
    print_message("skewness %.3f +- %.3f\n", noise.skewness, noise.skewness_error);
    assert_near(noise.skewness, 1.437, 0.03);
}

/* rho(d) of the mean of two neighbours with weights 1 - s and s: s (1 - s) / (s^2 + (1 - s)^2) at 1, in x as in y. */
static void test_bilinear_shifts(void **state)
{
    (void)state;
    for (int stars = 0; stars <= 400; stars += 400)
        for (double s = 0.25; s <= 0.5; s += 0.25) {
            const rx_noise_correlation noise = measure(s, stars, 2);
            const double one = s * (1 - s) / (s * s + (1 - s) * (1 - s));
            assert_int_equal(noise.correlated, 1);
            assert_near(noise.at[MID][MID + 1], one, 0.015);
            assert_near(noise.at[MID - 1][MID], one, 0.02);
            assert_near(noise.at[MID + 1][MID - 1], one * one, 0.02);
            assert_near(noise.at[MID][MID + 4], 0, 0.01);
            assert_near(rx_noise_factor_wide(&noise), 1 + 2 * one, stars > 0 ? 0.05 : 0.02); /* their wings */
            for (int q = 0; q < RX_NOISE_QUADRANTS; q++) {
                assert_near(rx_noise_quadrant_factor(&noise, q), 1 + 2 * one, 0.15);
                assert_near((noise.quadrant[q] - pow(1 + 2 * one, 2)) / noise.quadrant_error[q], 0, 4);
            }
        }
}

/* A quarter of the tile was resampled, the rest was not. */
static void test_quadrants(void **state)
{
    (void)state;
    float *pixels = draw(0, 0), *shifted = draw(0.5, 0);
    const rx_noise_correlation white = measure_image(pixels, SIDE, SIDE, 2);
    for (int y = 0; y < SIDE / 2; y++)
        memcpy(pixels + y * SIDE + SIDE / 2, shifted + y * SIDE + SIDE / 2,
               (SIDE - SIDE / 2) * sizeof *pixels);
    const rx_noise_correlation noise = measure_image(pixels, SIDE, SIDE, 2);
    free(pixels);
    free(shifted);
    assert_int_equal(rx_noise_uneven(&white), 0);
    assert_int_equal(rx_noise_uneven(&noise), 1);
    for (int q = 0; q < RX_NOISE_QUADRANTS; q++) {
        assert_near(rx_noise_quadrant_factor(&white, q), 1, 0.1);
        assert_near(rx_noise_quadrant_factor(&noise, q), q == 1 ? 2 : 1, 0.15);
    }
}

/* That of a bilinear shift by half a pixel is 4 cos^2 (pi u) cos^2 (pi v). */
static void test_power(void **state)
{
    (void)state;
    static const float kernel[4] = {0.25f, 0.25f, 0.25f, 0.25f};
    const rx_noise_correlation noise = rx_noise_of_kernel(kernel, 2, 2),
                               white = rx_noise_white(RX_NOISE_WHITE);
    assert_near(rx_noise_power(&noise, 0, 0), 4, 1e-9);
    assert_near(rx_noise_power(&noise, 0.25, 0), 2, 1e-9);
    assert_near(rx_noise_power(&noise, 0.125, 0.25), 4 * 0.5 * 0.8535534, 1e-6);
    assert_near(rx_noise_power(&noise, 0, 0.5), 0, 1e-9);
    assert_near(rx_noise_power(&white, 0.1, 0.3), 1, 0);
    assert_int_equal(rx_noise_uneven(&noise), 0);
}

/* A sky that its mesh does not follow: waves of 250 pixels, a fifth of the noise's variance. */
static void test_uneven_sky_is_no_noise(void **state)
{
    (void)state;
    float *pixels = draw(0.5, 0);
    for (int i = 0; i < SIDE * SIDE; i++)
        pixels[i] += (float)(0.95 * sin(6.2832 * (i % SIDE) / 250.0));
    const rx_noise_correlation noise = measure_image(pixels, SIDE, SIDE, 2);
    free(pixels);
    assert_near(noise.at[MID][MID + 1], 0.5, 0.004);
    assert_near(rx_noise_factor_wide(&noise), 2, 0.01);
}

/* Fringes are more than resampling explains; drizzle is not, nor what was stated. */
static void test_structure(void **state)
{
    (void)state;
    float *pixels = draw(0.5, 0);
    rx_noise_correlation noise = measure_image(pixels, SIDE, SIDE, 1);
    assert_int_equal(rx_noise_is_structure(&noise), 0);
    for (int i = 0; i < SIDE * SIDE; i++)
        pixels[i] += (float)(6.0 * sin(2.0 * M_PI * (i % SIDE + 0.4 * (i / SIDE)) / 30.0));
    noise = measure_image(pixels, SIDE, SIDE, 1);
    print_message("fringes: wide sums %.2f\n", rx_noise_factor_wide(&noise));
    assert_int_equal(rx_noise_is_structure(&noise), 1);
    free(pixels);
    /* who states it, knows it */
    enum { FINE = 5 };
    float drop[FINE * FINE];
    for (int i = 0; i < FINE * FINE; i++)
        drop[i] = 1.0f;
    noise = rx_noise_of_kernel(drop, FINE, FINE);
    assert_near(rx_noise_factor_wide(&noise), FINE, 1e-9);
    assert_int_equal(rx_noise_is_structure(&noise), 0);
}

static void test_threads_change_nothing(void **state)
{
    (void)state;
    const rx_noise_correlation one = measure(0.3, 300, 1), seven = measure(0.3, 300, 7);
    assert_memory_equal(&one, &seven, sizeof one);
}

static void test_too_little_sky(void **state)
{
    (void)state;
    float few[20 * 20];
    for (int i = 0; i < 400; i++)
        few[i] = 50.0f + (float)rx_random_normal(1, 1, (uint64_t)i);
    const rx_noise_correlation noise = measure_image(few, 20, 20, 1);
    assert_int_equal(noise.origin, RX_NOISE_UNKNOWN);
    assert_near(rx_noise_factor_wide(&noise), 1, 0);
}

/* A kernel, and the variance of a weighted sum against that of many draws. */
static void test_factor_of_a_kernel(void **state)
{
    (void)state;
    const float kernel[3 * 3] = {1, 2, 1, 2, 5, 3, 0, 2, 1}, profile[2 * 3] = {1, 2, 1, 0.5f, -1, 3};
    const rx_noise_correlation noise = rx_noise_of_kernel(kernel, 3, 3);
    double sum = 0, plain = 0, power = 0;
    enum { DRAWS = 200000, W = 5, H = 4 };
    for (int i = 0; i < 6; i++)
        power += (double)profile[i] * profile[i];
    for (uint64_t k = 0; k < DRAWS; k++) {
        double white[W * H], value = 0;
        for (uint64_t i = 0; i < W * H; i++)
            white[i] = rx_random_normal(3, k, i);
        for (int y = 0; y < 2; y++)
            for (int x = 0; x < 3; x++) {
                double pixel = 0;
                for (int i = 0; i < 9; i++)
                    pixel += (double)kernel[i] * white[(y + i / 3) * W + x + i % 3];
                value += (double)profile[y * 3 + x] * pixel;
                plain += x == 0 && y == 0 ? pixel * pixel : 0;
            }
        sum += value * value;
    }
    assert_close(rx_noise_factor(&noise, profile, 3, 2), sqrt(sum / plain / power), 0.01);
    assert_near(rx_noise_factor(NULL, profile, 3, 2), 1, 0);
}

/* Noise of a resampled crowd: light that hangs together as a PSF of sigma 2.5 pixels makes a tenth of the variance. */
static void test_faint_light_is_no_noise(void **state)
{
    (void)state;
    const float half[2 * 2] = {1, 1, 1, 1};
    enum { SIZE = 25 };
    float psf[SIZE * SIZE];
    for (int i = 0; i < SIZE * SIZE; i++) {
        const double dx = i % SIZE - SIZE / 2, dy = i / SIZE - SIZE / 2;
        psf[i] = (float)exp(-(dx * dx + dy * dy) / (2 * 2.5 * 2.5));
    }
    const rx_noise_correlation noise = rx_noise_of_kernel(half, 2, 2);
    rx_noise_correlation mixed = noise, light = rx_noise_white(RX_NOISE_MEASURED);
    mixed.origin = RX_NOISE_MEASURED;
    light.correlated = 1;
    double near = 0;
    for (int dy = -3; dy <= 3; dy++)
        for (int dx = -3; dx <= 3; dx++)
            near += exp(-(dx * dx + dy * dy) / (4 * 2.5 * 2.5));
    for (int q = 0; q < RX_NOISE_QUADRANTS; q++) { /* white, with more light in one than in another */
        const double share = q == 0 ? 0.08 : q == 3 ? 0.12 : 0.1;
        light.quadrant[q] = 1 - share + share * near;
        light.quadrant_error[q] = 0.01;
    }
    assert_int_equal(rx_noise_uneven(&light), 1);
    for (int dy = -MID; dy <= MID; dy++)
        for (int dx = -MID; dx <= MID; dx++) {
            const double l = exp(-(dx * dx + dy * dy) / (4 * 2.5 * 2.5));
            mixed.at[MID + dy][MID + dx] = 0.9 * noise.at[MID + dy][MID + dx] + 0.1 * l;
            light.at[MID + dy][MID + dx] = dx == 0 && dy == 0 ? 1 : 0.1 * l;
        }
    memcpy(mixed.measured, mixed.at, sizeof mixed.at);
    memcpy(light.measured, light.at, sizeof light.at);
    assert_near(rx_noise_without_light(&mixed, psf, SIZE, SIZE, 0), 0.1, 0.0005);
    assert_near(rx_noise_factor_wide(&mixed), rx_noise_factor_wide(&noise), 0.01);
    assert_near(rx_noise_without_light(&light, psf, SIZE, SIZE, 0), 0.1, 0.0005);
    assert_int_equal(light.correlated, 0);
    assert_near(light.quadrant[1], 1, 0.005);
    assert_near(light.quadrant[2], 1, 0.005);
    assert_int_equal(rx_noise_uneven(&light), 0);
}

/* What crowds of stars of FWHM 2.5 and 4 leave between sources, on independent pixels, bilinearly shifted ones and
 * smoothed ones, measured to 0.005; the sky has taken off the mean at the reach. */
static void test_crowds_are_no_noise(void **state)
{
    (void)state;
    enum { SIZE = 41, KERNEL_SIDE = 9 };
    for (int wide = 0; wide < 2; wide++)
        for (int kind = 0; kind < 3; kind++) {
            float psf[SIZE * SIZE], kernel[KERNEL_SIDE * KERNEL_SIDE] = {0};
            const double s = wide ? 1.70 : 1.06, share = kind == 2 ? 0.0 : wide ? 0.4 : 0.15;
            for (int i = 0; i < SIZE * SIZE; i++)
                psf[i] =
                    (float)exp(-(pow(i % SIZE - SIZE / 2, 2) + pow(i / SIZE - SIZE / 2, 2)) / (2 * s * s));
            for (int i = 0; i < KERNEL_SIDE * KERNEL_SIDE; i++) {
                const int x = i % KERNEL_SIDE - 4, y = i / KERNEL_SIDE - 4;
                kernel[i] = kind == 0   ? x == 0 && y == 0
                            : kind == 1 ? (x == 0 || x == 1) && (y == 0 || y == 1)
                                        : (float)exp(-(x * x + y * y) / 2.0);
            }
            const rx_noise_correlation noise = rx_noise_of_kernel(kernel, KERNEL_SIDE, KERNEL_SIDE);
            rx_noise_correlation mixed = noise;
            mixed.origin = RX_NOISE_MEASURED;
            mixed.error = 0.005;
            const double floor = wide ? 0.01 : 0.0;
            for (int dy = -MID; dy <= MID; dy++)
                for (int dx = -MID; dx <= MID; dx++) {
                    const double light = exp(-(dx * dx + dy * dy) / (4 * s * s));
                    const uint64_t lag = (uint64_t)abs((2 * MID + 1) * dy + dx);
                    double *at = &mixed.at[MID + dy][MID + dx];
                    *at = dx == 0 && dy == 0 ? 1
                                             : (1 - share) * noise.at[MID + dy][MID + dx] + share * light -
                                                   floor + 0.005 * rx_random_normal(8, 1, lag);
                    mixed.measured[MID + dy][MID + dx] = *at;
                    *at = fabs(*at) < 0.015 ? 0 : *at;
                }
            rx_noise_without_light(&mixed, psf, SIZE, SIZE, 0);
            print_message("FWHM %g, noise %d: factor %.3f of %.3f\n", 2.3548 * s, kind,
                          rx_noise_factor(&mixed, psf, SIZE, SIZE), rx_noise_factor(&noise, psf, SIZE, SIZE));
            assert_int_equal(mixed.correlated, kind > 0);
            assert_close(rx_noise_factor(&mixed, psf, SIZE, SIZE), rx_noise_factor(&noise, psf, SIZE, SIZE),
                         kind == 2 ? 0.15 : 0.05);
        }
}

/* Half of the variance is light, of stars a little wider than the PSF, over noise that a shift by 0.15 pixels has smoothed: more
 * is not taken off than leaves wide sums those of independent pixels. */
static void test_most_is_light(void **state)
{
    (void)state;
    enum { SIZE = 41 };
    const float kernel[4] = {0.7225f, 0.1275f, 0.1275f, 0.0225f};
    const rx_noise_correlation noise = rx_noise_of_kernel(kernel, 2, 2);
    rx_noise_correlation mixed = noise;
    float psf[SIZE * SIZE];
    for (int i = 0; i < SIZE * SIZE; i++)
        psf[i] = (float)exp(-(pow(i % SIZE - SIZE / 2.0 + 0.5, 2) + pow(i / SIZE - SIZE / 2.0 + 0.5, 2)) /
                            (2 * 1.7 * 1.7));
    mixed.origin = RX_NOISE_MEASURED;
    mixed.error = 0.005;
    for (int dy = -MID; dy <= MID; dy++)
        for (int dx = -MID; dx <= MID; dx++)
            mixed.at[MID + dy][MID + dx] = mixed.measured[MID + dy][MID + dx] =
                0.5 * noise.at[MID + dy][MID + dx] + 0.5 * exp(-(dx * dx + dy * dy) / (4 * 1.8 * 1.8));
    assert_true(rx_noise_without_light(&mixed, psf, SIZE, SIZE, 0) > 0.3);
    print_message("factor %.3f of %.3f\n", rx_noise_factor(&mixed, psf, SIZE, SIZE),
                  rx_noise_factor(&noise, psf, SIZE, SIZE));
    assert_true(rx_noise_factor_wide(&mixed) >= 1.0);
    assert_close(rx_noise_factor(&mixed, psf, SIZE, SIZE), rx_noise_factor(&noise, psf, SIZE, SIZE), 0.1);
}

/* Images that Lanczos kernels have shifted by all parts of a pixel: their noise rings to 5 pixels along rows and columns, and of that
 * nothing is taken for the light, 5 % of the variance, that is beside it. */
static void test_ringing_is_no_light(void **state)
{
    (void)state;
    enum { TAPS = 6, SHIFTS = 8, SIZE = 41 };
    double along[MID + 1] = {0};
    float psf[SIZE * SIZE];
    for (int k = 0; k < SHIFTS; k++) {
        double tap[TAPS + MID] = {0}, sum = 0;
        for (int i = 0; i < TAPS; i++) {
            const double x = M_PI * (i - 2 - (k + 0.5) / SHIFTS);
            sum += tap[i] = sin(x) / x * sin(x / 3) / (x / 3);
        }
        for (int d = 0; d <= MID; d++)
            for (int i = 0; i < TAPS; i++)
                along[d] += tap[i] * tap[i + d] / (sum * sum);
    }
    for (int i = 0; i < SIZE * SIZE; i++)
        psf[i] = (float)exp(-(pow(i % SIZE - 20, 2) + pow(i / SIZE - 20, 2)) / (2 * 1.7 * 1.7));
    rx_noise_correlation noise = rx_noise_white(RX_NOISE_MEASURED);
    noise.correlated = 1;
    noise.error = 0.0052; /* of a tile of 256 x 256 */
    for (int dy = -MID; dy <= MID; dy++)
        for (int dx = -MID; dx <= MID; dx++) {
            noise.at[MID + dy][MID + dx] = along[abs(dx)] * along[abs(dy)] / (along[0] * along[0]);
            noise.measured[MID + dy][MID + dx] =
                0.95 * noise.at[MID + dy][MID + dx] + 0.05 * exp(-(dx * dx + dy * dy) / (4 * 1.7 * 1.7));
        }
    const double factor = rx_noise_factor(&noise, psf, SIZE, SIZE);
    assert_near(noise.at[MID][MID + 3], 0.02, 0.01);
    assert_near(rx_noise_without_light(&noise, psf, SIZE, SIZE, 0), 0.05, 0.004);
    assert_near(rx_noise_factor(&noise, psf, SIZE, SIZE), factor, 0.02);
}

/* The core of a cluster, where all but 0.07 of the variance is light, and the PSF is known to 3 %: so much the photons of the sky say. Without them, or
 * where they make up for more, it counts as smoothing. Quadrants of which more was subtracted than they had differ no more than
 * their errors. */
static void test_photons_bound_light(void **state)
{
    (void)state;
    enum { SIZE = 41 };
    static const double photons[] = {0, 0.5, 2, 0.07};
    float psf[SIZE * SIZE];
    for (int i = 0; i < SIZE * SIZE; i++)
        psf[i] = (float)exp(-(pow(i % SIZE - 20, 2) + pow(i / SIZE - 20, 2)) / (2 * 1.26 * 1.26));
    for (int k = 0; k < 4; k++) {
        rx_noise_correlation noise = rx_noise_white(RX_NOISE_MEASURED);
        noise.correlated = 1;
        noise.error = 0.001;
        for (int dy = -MID; dy <= MID; dy++)
            for (int dx = -MID; dx <= MID; dx++)
                noise.at[MID + dy][MID + dx] = noise.measured[MID + dy][MID + dx] =
                    (dx == 0 && dy == 0 ? 0.07 : 0) + 0.93 * exp(-(dx * dx + dy * dy) / (4 * 1.3 * 1.3));
        for (int q = 0; q < RX_NOISE_QUADRANTS; q++) {
            noise.quadrant[q] = q == 0 ? 10 : 20;
            noise.quadrant_error[q] = 0.1;
        }
        assert_true(rx_noise_reaches_far(&noise));
        assert_near(rx_noise_without_light(&noise, psf, SIZE, SIZE, photons[k]), k == 3 ? 0.93 : 0, 0.01);
        assert_int_equal(noise.correlated, k < 3);
        assert_int_equal(rx_noise_uneven(&noise), k < 3);
        assert_near(noise.scale, k < 3 ? 1 : sqrt(0.07), 0.01);
    }
    const rx_noise_correlation shifted = rx_noise_white(RX_NOISE_MEASURED);
    assert_false(rx_noise_reaches_far(&shifted));
}

/* The same pixels, skewed as light is, or too little or too uncertain for that. */
static void test_stars_without_end(void **state)
{
    (void)state;
    enum { SIZE = 41 };
    static const double skewness[][2] = {{1, 0.05}, {0.4, 0.01}, {1, 0.11}, {1, HUGE_VAL}};
    float psf[SIZE * SIZE];
    for (int i = 0; i < SIZE * SIZE; i++)
        psf[i] = (float)exp(-(pow(i % SIZE - 20, 2) + pow(i / SIZE - 20, 2)) / (2 * 1.26 * 1.26));
    for (int k = 0; k < 4; k++)
        for (int known = 0; known < 2; known++) { /* the photons' share */
            rx_noise_correlation noise = rx_noise_white(RX_NOISE_MEASURED);
            noise.correlated = 1;
            noise.error = 0.001;
            noise.skewness = skewness[k][0];
            noise.skewness_error = skewness[k][1];
            for (int dy = -MID; dy <= MID; dy++)
                for (int dx = -MID; dx <= MID; dx++)
                    noise.at[MID + dy][MID + dx] = noise.measured[MID + dy][MID + dx] =
                        (dx == 0 && dy == 0 ? 0.07 : 0) + 0.93 * exp(-(dx * dx + dy * dy) / (4 * 1.3 * 1.3));
            rx_noise_without_light(&noise, psf, SIZE, SIZE, known ? 0.07 : 0);
            assert_int_equal(noise.correlated, k > 0 && !known);
            assert_near(noise.scale, k > 0 && known ? sqrt(0.07) : 1, 0.01);
        }
}

/* A moving average that is not the same in x and y, nor along the two diagonals. */
enum { K = 3 };
static const float KERNEL[K * K] = {0.1f, 0.3f, 0.2f, 0.5f, 1.0f, 0.3f, 0.0f, 0.6f, 0.4f};

enum { W = 400, H = 360, N = W * H };

typedef struct sky {
    float pixels[N], sigma[N];
    unsigned char used[N];
} sky;

/* Filtered noise whose width grows from left to right, 1 to 3, on a level of half a sigma that the
 * subtraction left; the lower left quarter is a bright source, every 50th pixel is masked. */
static sky *make_sky(void)
{
    sky *dst = malloc(sizeof *dst);
    double power = 0.0;
    assert_non_null(dst);
    for (int k = 0; k < K * K; k++)
        power += (double)KERNEL[k] * (double)KERNEL[k];
    for (int i = 0; i < N; i++) {
        const int x = i % W, y = i / W;
        double value = 0.0;
        for (int k = 0; k < K * K; k++)
            value += (double)KERNEL[k] / sqrt(power) *
                     rx_random_normal(11, 0, (uint64_t)((y + k / K) * (W + K) + x + k % K));
        dst->sigma[i] = 1.0f + 2.0f * (float)x / W;
        dst->pixels[i] = dst->sigma[i] * (float)(value + 0.5);
        dst->used[i] = !(x < W / 2 && y < H / 2) && i % 50 != 0;
        if (!dst->used[i])
            dst->pixels[i] = i % 50 == 0 ? NAN : 1e4f;
    }
    return dst;
}

static rx_noise_correlation measure_sky(const sky *src)
{
    const rx_image image = {
        .width = W, .height = H, .pixels = src->pixels, .noise = rx_map_plane(src->sigma, W)};
    rx_noise_correlation noise;
    assert_int_equal(rx_correlation_measure(&image, src->used, 2, &noise, NULL), RX_OK);
    return noise;
}

/* Every lag within 5 errors of what it should be. */
static void near_kernel(const rx_noise_correlation *noise)
{
    const rx_noise_correlation exact = rx_noise_of_kernel(KERNEL, K, K);
    for (int i = 0; i < RX_NOISE_SIDE * RX_NOISE_SIDE; i++)
        assert_near(noise->at[i / RX_NOISE_SIDE][i % RX_NOISE_SIDE],
                    exact.at[i / RX_NOISE_SIDE][i % RX_NOISE_SIDE], 5.0 * noise->error);
}

/* Sources are known; what is hidden behind them changes nothing, nor does sky that was not quite flat: it adds
 * 0.2^2 / 4 = 0.01 of the variance, about the same at all lags. */
static void test_sources_that_are_known(void **state)
{
    (void)state;
    sky *src = make_sky();
    const rx_noise_correlation noise = measure_sky(src);
    assert_true(noise.correlated);
    near_kernel(&noise);
    assert_near(noise.scale, 1.0, 0.01);
    for (int i = 0; i < N; i++)
        if (!src->used[i])
            src->pixels[i] = i % 3 == 0 ? INFINITY : (float)i;
    const rx_noise_correlation second = measure_sky(src);
    assert_memory_equal(&noise, &second, sizeof noise);
    for (int i = 0; i < N; i++)
        src->pixels[i] += src->sigma[i] * 0.2f * (float)sin(0.03 * (i % W)) * (float)cos(0.03 * (i / W));
    const rx_noise_correlation uneven = measure_sky(src);
    near_kernel(&uneven);
    assert_near(uneven.scale, 1.0, 0.01);
    for (int i = 0; i < N; i++)
        src->used[i] = i % 1000 == 1;
    assert_int_equal(measure_sky(src).origin, RX_NOISE_UNKNOWN);
    free(src);
}

/* Cut-outs that were resampled, so that their noise is correlated. Expected: by numpy over all pixels at once,
 *   z = where(segim == 0, fitim / sigma, nan), nine times cut at 4 widths, c(d) = nanmean(z(p) z(p + d)) /
 * c(0), f = mean of c over the outermost of the lags |dx| <= 4, 0 <= dy <= 4; (c - f) / (1 - f) */
static const struct {
    const char *name;
    double scale, right, up, diagonal, other_diagonal, right2;
} resampled[] = {
    {"pairs/SDSS/G266662", 0.9677, 0.2947, 0.2833, 0.1076, 0.0749, -0.1113},
    {"pairs/KiDS/G265911", 0.9840, 0.2675, 0.2757, 0.0790, 0.0871, -0.1325},
};

static float *read_part(const char *folder, const char *name, const char *part, int *width, int *height)
{
    char path[4096];
    float *pixels = NULL;
    snprintf(path, sizeof path, "%s/%s%s.fits", folder, name, part);
    if (rx_fits_read_image(path, &pixels, width, height, NULL) != RX_OK)
        return NULL;
    return pixels;
}

static void test_resampled_images(void **state)
{
    (void)state;
    const char *folder = getenv("RX_SHARED_DATA");
    for (size_t k = 0; k < sizeof resampled / sizeof *resampled; k++) {
        int width = 0, height = 0;
        float *pixels = read_part(folder != NULL ? folder : "", resampled[k].name, "fitim", &width, &height);
        if (pixels == NULL) {
            printf("# %s is absent: skipped\n", resampled[k].name);
            skip();
        }
        float *sigma = read_part(folder, resampled[k].name, "sigma", &width, &height);
        float *segments = read_part(folder, resampled[k].name, "segim", &width, &height);
        assert_non_null(sigma);
        assert_non_null(segments);
        const size_t n = (size_t)width * (size_t)height;
        unsigned char *used = malloc(n);
        assert_non_null(used);
        for (size_t i = 0; i < n; i++)
            used[i] = segments[i] == 0.0f;
        const rx_image image = {
            .width = width, .height = height, .pixels = pixels, .noise = rx_map_plane(sigma, width)};
        rx_noise_correlation noise;
        assert_int_equal(rx_correlation_measure(&image, used, 1, &noise, NULL), RX_OK);
        assert_true(noise.correlated);
        assert_near(noise.scale, resampled[k].scale, 0.03);
        assert_near(noise.at[MID][MID + 1], resampled[k].right, 0.03);
        assert_near(noise.at[MID][MID - 1], resampled[k].right, 0.03);
        assert_near(noise.at[MID + 1][MID], resampled[k].up, 0.03);
        assert_near(noise.at[MID + 1][MID + 1], resampled[k].diagonal, 0.03);
        assert_near(noise.at[MID + 1][MID - 1], resampled[k].other_diagonal, 0.03);
        assert_near(noise.at[MID][MID + 2], resampled[k].right2, 0.03);
        free(pixels);
        free(sigma);
        free(segments);
        free(used);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_white_noise_is_white),
        cmocka_unit_test(test_skewed_pixels),
        cmocka_unit_test(test_bilinear_shifts),
        cmocka_unit_test(test_quadrants),
        cmocka_unit_test(test_power),
        cmocka_unit_test(test_structure),
        cmocka_unit_test(test_threads_change_nothing),
        cmocka_unit_test(test_uneven_sky_is_no_noise),
        cmocka_unit_test(test_too_little_sky),
        cmocka_unit_test(test_factor_of_a_kernel),
        cmocka_unit_test(test_faint_light_is_no_noise),
        cmocka_unit_test(test_crowds_are_no_noise),
        cmocka_unit_test(test_most_is_light),
        cmocka_unit_test(test_ringing_is_no_light),
        cmocka_unit_test(test_photons_bound_light),
        cmocka_unit_test(test_stars_without_end),
        cmocka_unit_test(test_sources_that_are_known),
        cmocka_unit_test(test_resampled_images),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
