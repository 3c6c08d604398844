/* What surveys deliver, in training images: correlated and uneven noise, the sky, defects, PSFs told wrong. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "data/noise_correlation.h"
#include "psf/psf.h"
#include "samples_test.h"
#include "simulate/coadd.h"
#include "simulate/survey_sky.h"

enum { P = 64, N = P * P };

/* --- kernels --- */

/* Of two pixels `lag` apart in x. */
static double correlation(rx_resampler kind, double size, int lag)
{
    const rx_noise_correlation noise = rx_resampled_noise(kind, (const double[]){size, size});
    return noise.at[RX_NOISE_REACH][RX_NOISE_REACH + lag];
}

static void test_kernels(void **state)
{
    for (double d = 0.0; d <= 1.0; d += 0.25) {
        assert_near(correlation(RX_RESAMPLER_LINEAR, d, 1), d * (1.0 - d) / (d * d + (1.0 - d) * (1.0 - d)),
                    1e-12);
        assert_near(correlation(RX_RESAMPLER_LINEAR, d, 2), 0.0, 1e-12);
    }
    assert_near(correlation(RX_RESAMPLER_CUBIC, 0.5, 0), 1.0, 1e-12);
    assert_near(correlation(RX_RESAMPLER_CUBIC, 0.5, 1), 63.0 / 164.0, 1e-12);
    assert_near(correlation(RX_RESAMPLER_LANCZOS, 0.0, 1), 0.0, 1e-12);
    /* weights at half a pixel: 24, -100/9 ... of sinc(d) sinc(d / 3), which is 3 sin(pi d) sin(pi d / 3) / (pi
     * d)^2 */
    const double a = 12.0 * 0.5, b = -12.0 / 9.0, c = 12.0 / 25.0 * 0.5;
    assert_near(correlation(RX_RESAMPLER_LANCZOS, 0.5, 5), c * c / (2.0 * (a * a + b * b + c * c)), 1e-12);
    /* boxes of one pixel on pixels: the cubic B-spline */
    assert_near(correlation(RX_RESAMPLER_DRIZZLE, 1.0, 1), 0.25, 2e-3);
    /* shifts that differ in x and y */
    const rx_noise_correlation noise = rx_resampled_noise(RX_RESAMPLER_LINEAR, (const double[]){0.5, 0.0});
    assert_near(noise.at[RX_NOISE_REACH][RX_NOISE_REACH + 1], 0.5, 1e-12);
    assert_near(noise.at[RX_NOISE_REACH + 1][RX_NOISE_REACH], 0.0, 1e-12);
}

/* --- noise --- */

static samples_test open_blank(void)
{
    samples_test t = samples_test_open(1.0, 15.0);
    t.config->star_count = t.config->galaxy_count = 0.0;
    t.par.sky.beta[0] = t.par.sky.beta[1] = 4.0;
    t.par.sky.ellipticity = 0.0;
    return t;
}

/* Of images of the first bins of FWHM: the width of pixels, over that of white noise of the same matched
 * filter; the width behind that filter; and `expected`, what the first should be of a Gaussian of sigma 1. */
static void noise_widths(const samples_test *t, double *pixel, double *matched, double *expected)
{
    enum { IMAGES = 60, R = 7 };
    rx_samples *scenes = samples_test_make(t);
    rx_sample *s = samples_test_new(P);
    double squares = 0.0, filtered = 0.0, places = 0.0;
    *expected = 0.0;
    for (uint32_t i = 0; i < IMAGES; i++) {
        rx_psf *psf = NULL;
        samples_test_sample(scenes, (rx_sample_id){.bin = i % 5, .index = i / 5}, s);
        assert_int_equal(rx_psf_moffat((double)s->true_fwhm, 4.0, 1.0, 0.0, 2 * R + 1, &psf, NULL), RX_OK);
        const float *h = psf->basis;
        double norm = 0.0, joint = 0.0;
        for (int k = 0; k < (2 * R + 1) * (2 * R + 1); k++)
            for (int j = 0; j < (2 * R + 1) * (2 * R + 1); j++) {
                const int dx = k % (2 * R + 1) - j % (2 * R + 1), dy = k / (2 * R + 1) - j / (2 * R + 1);
                const double product = (double)h[k] * (double)h[j];
                norm += k == j ? product : 0.0;
                joint += product * exp(-0.25 * (dx * dx + dy * dy));
            }
        *expected += norm / joint / IMAGES;
        for (int k = 0; k < N; k++)
            squares += (double)s->x[k] * (double)s->x[k] / N / IMAGES;
        for (int y = R; y < P - R; y++)
            for (int x = R; x < P - R; x++) {
                double sum = 0.0;
                for (int k = 0; k < (2 * R + 1) * (2 * R + 1); k++)
                    sum +=
                        (double)h[k] * (double)s->x[(y + k / (2 * R + 1) - R) * P + x + k % (2 * R + 1) - R];
                filtered += sum * sum / norm;
                places += 1.0;
            }
        rx_psf_free(psf);
    }
    *pixel = sqrt(squares);
    *matched = sqrt(filtered / places);
    *expected = sqrt(*expected);
    free(s);
    rx_samples_free(scenes);
}

static void test_effective_noise(void **state)
{
    double pixel, matched, expected;
    samples_test t = open_blank();
    noise_widths(&t, &pixel, &matched, &expected);
    assert_near(pixel, 1.0, 0.01);
    assert_near(matched, 1.0, 0.015);
    t.par.survey.smoothed = 1.0;
    t.par.survey.smoothed_fwhm[0] = t.par.survey.smoothed_fwhm[1] = sqrt(8.0 * log(2.0));
    noise_widths(&t, &pixel, &matched, &expected);
    assert_close(pixel, expected, 0.03);
    assert_true(expected < 0.7);
    assert_near(matched, 1.0, 0.03);
    t.par.survey.smoothed = 0.0;
    t.par.survey.resampled = 1.0;
    noise_widths(&t, &pixel, &matched, &expected);
    assert_true(pixel < 0.9);
    assert_near(matched, 1.0, 0.015);
    rx_simulate_config_free(t.config);
}

/* --- beside the sample without it --- */

typedef void watcher(const rx_sample *plain, const rx_sample *s, double *sums);

/* Both of some samples, for which `watch` adds up what it wants. */
static void compare(const samples_test *with, int images, watcher *watch, double *sums)
{
    samples_test without = *with;
    without.par.survey = (rx_survey_params){0};
    rx_samples *both[2] = {samples_test_make(&without), samples_test_make(with)};
    rx_sample *plain = samples_test_new(P), *s = samples_test_new(P);
    for (uint32_t i = 0; i < (uint32_t)images; i++) {
        const rx_sample_id id = {.bin = i % 25, .index = i / 25};
        samples_test_sample(both[0], id, plain);
        samples_test_sample(both[1], id, s);
        watch(plain, s, sums);
    }
    free(plain);
    free(s);
    rx_samples_free(both[0]);
    rx_samples_free(both[1]);
}

static int is_same(const float *a, const float *b)
{
    return memcmp(a, b, N * sizeof *a) == 0;
}

/* In sums: samples that are the same to the byte, all. */
static void watch_share(const rx_sample *plain, const rx_sample *s, double *sums)
{
    const int same =
        is_same(plain->x, s->x) && is_same(plain->w, s->w) && is_same(plain->y, s->y) &&
        is_same(plain->blurred, s->blurred) &&
        memcmp(plain->kernel, s->kernel, RX_SAMPLE_KERNEL * RX_SAMPLE_KERNEL * sizeof(float)) == 0;
    sums[0] += same;
    sums[1] += 1.0;
}

/* The largest noise factor of a training, against noise made by kernels in pixels. */
static void test_factor(void **state)
{
    enum { K = 17, PSF = 33 };
    const double fwhm = 6.0, wide = 3.0;
    float kernel[K * K], psf[PSF * PSF];
    for (int i = 0; i < K * K; i++)
        kernel[i] =
            (float)exp(-4.0 * M_LN2 * (pow(i % K - K / 2, 2) + pow(i / K - K / 2, 2)) / (wide * wide));
    for (int i = 0; i < PSF * PSF; i++)
        psf[i] = (float)exp(-4.0 * M_LN2 * (pow(i % PSF - PSF / 2, 2) + pow(i / PSF - PSF / 2, 2)) /
                            (fwhm * fwhm));
    const rx_noise_correlation smoothed = rx_noise_of_kernel(kernel, K, K);
    rx_survey_params survey = {0};
    double factor;
    assert_int_equal(rx_survey_factor(&survey, fwhm, &factor, NULL), RX_OK);
    assert_near(factor, 1, 0);
    survey.smoothed = 0.5;
    survey.smoothed_fwhm[1] = wide;
    assert_int_equal(rx_survey_factor(&survey, fwhm, &factor, NULL), RX_OK);
    assert_near(factor, rx_noise_factor(&smoothed, psf, PSF, PSF), 0.02);
    survey.smoothed = 0.0;
    survey.resampled = 0.5; /* drops of two pixels: 2.4 of wide sums (Fruchter & Hook 2002) */
    assert_int_equal(rx_survey_factor(&survey, 60.0, &factor, NULL), RX_OK);
    assert_near(factor, 2.4, 0.02);
}

static void test_shares(void **state)
{
    enum { IMAGES = 100 };
    const samples_test blank = open_blank();
    for (int which = 0; which < 8; which++) {
        samples_test t = blank;
        double sums[2] = {0.0};
        rx_survey_params *v = &t.par.survey;
        double *const share[8] = {&v->smoothed, &v->resampled, &v->uneven,  &v->offsets,
                                  &v->waves,    &v->dark,      &v->defects, &v->psf};
        v->smoothed_fwhm[1] = 3.0;
        v->sky_offset = 0.3;
        *share[which] = 0.3;
        compare(&t, IMAGES, watch_share, sums);
        assert_near(sums[0] / IMAGES, 0.7, 4.0 * sqrt(0.3 * 0.7 / IMAGES));
    }
    rx_simulate_config_free(blank.config);
}

/* y and the blurred plane are divided by the same, which is smooth; x keeps its width. */
static void watch_uneven(const rx_sample *plain, const rx_sample *s, double *sums)
{
    double least = 1e9, most = 0.0;
    for (int k = 0; k < N; k++) {
        sums[0] += (double)s->x[k] - (double)s->blurred[k] > 0.0 ? 1.0 : 0.0;
        sums[1] += pow((double)(s->x[k] - s->blurred[k]), 2);
        sums[2] += 1.0;
        if (!(plain->blurred[k] > 1.0f && plain->y[k] > 1.0f))
            continue;
        const double blurred = (double)(s->blurred[k] / plain->blurred[k]),
                     y = (double)(s->y[k] / plain->y[k]);
        assert_close(y, blurred, 1e-5);
        least = fmin(least, y);
        most = fmax(most, y);
        assert_between(y, exp(-0.75 - 0.7), exp(0.75 + 0.7));
    }
    sums[3] += most > 1.1 * least;
    assert_int_equal(s->nstars, plain->nstars);
    for (int i = 0; i < s->nstars; i++)
        assert_between((double)(s->star[i][2] / plain->star[i][2]), exp(-1.45), exp(1.45));
}

static void test_uneven(void **state)
{
    samples_test t = samples_test_open(1.0, 15.0);
    double sums[4] = {0.0};
    t.par.survey.uneven = 1.0;
    compare(&t, 50, watch_uneven, sums);
    assert_near(sums[0] / sums[2], 0.5, 0.0025);
    assert_near(sqrt(sums[1] / sums[2]), 1.02, 0.01); /* beside edges it is not what the map says */
    assert_true(sums[3] > 25);
    rx_simulate_config_free(t.config);
}

/* What is in x is true, sharp and blurred; sums: lowest and highest, means of boxes of 32 pixels in x - y,
 * their squares, boxes. */
static void watch_light(const rx_sample *plain, const rx_sample *s, double *sums)
{
    double box[4] = {0.0};
    for (int k = 0; k < N; k++) {
        const double light = (double)s->y[k] - (double)plain->y[k];
        assert_near((double)s->blurred[k] - (double)plain->blurred[k], light, 1e-4);
        assert_near((double)s->x[k] - (double)plain->x[k], light, 1e-4);
        sums[0] = fmin(sums[0], light);
        sums[1] = fmax(sums[1], light);
        box[k / P / 32 * 2 + k % P / 32] += (double)s->x[k] - (double)s->y[k];
    }
    for (int i = 0; i < 4; i++) {
        sums[2] += box[i] / 1024.0;
        sums[3] += pow(box[i] / 1024.0, 2);
        sums[4] += 1.0;
    }
}

static void test_dark_sky_and_waves(void **state)
{
    const samples_test blank = open_blank();
    for (int dark = 0; dark < 2; dark++) {
        samples_test t = blank;
        double sums[5] = {0.0};
        if (dark)
            t.par.survey.dark = 1.0;
        else
            t.par.survey.waves = 1.0;
        compare(&t, 100, watch_light, sums);
        assert_between(sums[0], dark ? -30.0 : -3.0, dark ? -3.0 : -0.3);
        assert_between(sums[1], dark ? -1e-6 : 0.3, dark ? 1e-6 : 3.0);
        assert_near(sums[2] / sums[4], 0.0, 4.0 / 32.0 / sqrt(sums[4]));
        assert_close(sqrt(sums[3] / sums[4]), 1.0 / 32.0, 0.005); /* white noise in boxes, and no more */
    }
    rx_simulate_config_free(blank.config);
}

/* sums: pixels that differ, those more than 6 above, those more than 6 below, all */
static void watch_defects(const rx_sample *plain, const rx_sample *s, double *sums)
{
    assert_true(is_same(plain->y, s->y));
    assert_true(is_same(plain->blurred, s->blurred));
    for (int k = 0; k < N; k++) {
        sums[0] += plain->x[k] != s->x[k];
        sums[1] += s->x[k] > 6.0f;
        sums[2] += s->x[k] < -6.0f;
        assert_true(fabsf(plain->x[k]) < 6.0f);
    }
    sums[3] += N;
}

static void test_defects(void **state)
{
    samples_test t = open_blank();
    double sums[4] = {0.0};
    t.par.survey.defects = 1.0;
    compare(&t, 100, watch_defects, sums);
    assert_between(sums[0] / sums[3], 0.005, 0.05);
    assert_between(sums[1] / sums[3], 0.003, 0.03);
    assert_between(sums[2] / sums[3], 0.0005, 0.02);
    rx_simulate_config_free(t.config);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_kernels),
        cmocka_unit_test(test_effective_noise),
        cmocka_unit_test(test_factor),
        cmocka_unit_test(test_shares),
        cmocka_unit_test(test_uneven),

        cmocka_unit_test(test_dark_sky_and_waves),
        cmocka_unit_test(test_defects),

    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
