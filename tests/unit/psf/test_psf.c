/* Analytic PSFs against analytic and brute-force numbers; evaluation; copies. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "../near.h"
#include "psf/moffat_fit.h"
#include "psf/psf.h"

/* Moffat by the midpoint rule on a fine grid in each pixel, elliptical form written the textbook way. */
static double brute_force(double fwhm, double beta, double ratio, double angle, int dx, int dy)
{
    const int fine = 400;
    double alpha = fwhm / (2.0 * sqrt(pow(2.0, 1.0 / beta) - 1.0)), sum = 0.0;
    for (int j = 0; j < fine; j++)
        for (int i = 0; i < fine; i++) {
            double x = dx + (i + 0.5) / fine - 0.5, y = dy + (j + 0.5) / fine - 0.5;
            double u = x * cos(angle) + y * sin(angle), v = -x * sin(angle) + y * cos(angle);
            double r2 = u * u * ratio + v * v / ratio;
            sum += pow(1.0 + r2 / (alpha * alpha), -beta);
        }
    return sum / fine / fine;
}

static void test_moffat_pixels(void **state)
{
    (void)state;
    const double cases[][4] = {{3.0, 4.765, 1.0, 0.0},
                               {1.2, 2.5, 1.0, 0.0},
                               {0.5, 3.0, 1.0, 0.0},
                               {6.0, 2.0, 0.6, 0.5},
                               {20.0, 4.0, 0.8, -1.2}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const double *v = cases[c];
        double shape[RX_MOFFAT_SHAPE], centre = brute_force(v[0], v[1], v[2], v[3], 0, 0);
        rx_moffat profile;
        rx_moffat_shape(v[0], v[1], v[2], v[3], shape);
        rx_moffat_set(&profile, shape);
        for (int dy = -2; dy <= 2; dy++)
            for (int dx = 0; dx <= 3; dx++) {
                double got = rx_moffat_pixel(&profile, dx, dy, NULL);
                double want = brute_force(v[0], v[1], v[2], v[3], dx, dy);
                /* the midpoint rule itself is good to 2e-6, for the narrowest to 1e-5 */
                assert_near(got, want, (v[0] < 1.0 ? 1e-5 : 3e-6) * centre);
            }
    }
}

static void test_moffat_gradient(void **state)
{
    (void)state;
    double shape[RX_MOFFAT_SHAPE], gradient[6], position[2] = {0.7, -1.4};
    rx_moffat m;
    for (int near_round = 0; near_round < 2; near_round++) {
        rx_moffat_shape(3.3, 3.1, near_round ? 0.9999 : 0.7, 0.8, shape);
        rx_moffat_set(&m, shape);
        assert_near(rx_moffat_pixel(&m, position[0], position[1], gradient),
                    rx_moffat_pixel(&m, position[0], position[1], NULL), 0);
        for (int i = 0; i < 6; i++) {
            double f[2];
            const double step = 1e-5;
            for (int side = 0; side < 2; side++) {
                double s[RX_MOFFAT_SHAPE], p[2] = {position[0], position[1]};
                memcpy(s, shape, sizeof s);
                *(i < 2 ? &p[i] : &s[i - 2]) += side ? step : -step;
                rx_moffat_set(&m, s);
                f[side] = rx_moffat_pixel(&m, p[0], p[1], NULL);
            }
            assert_near((f[1] - f[0]) / (2.0 * step), gradient[i], 1e-8);
        }
    }
}

/* Share of the flux inside r: 1 - (1 + r^2/alpha^2)^(1 - beta). Wide, so that the pixels' own
 * smoothing (a share of about 1/(12 sigma^2) of the slope) stays below the tolerance. */
static void test_encircled_energy(void **state)
{
    (void)state;
    const double fwhm = 30.0, beta = 4.765;
    rx_psf *psf;
    assert_int_equal(rx_psf_moffat(fwhm, beta, 1.0, 0.0, 401, &psf, NULL), RX_OK);
    double alpha = fwhm / (2.0 * sqrt(pow(2.0, 1.0 / beta) - 1.0));
    for (double r = 10.0; r <= 150.0; r *= 1.5) {
        double inside = 0.0;
        for (int j = -200; j <= 200; j++)
            for (int i = -200; i <= 200; i++) {
                int hits = 0; /* share of the pixel inside the circle, by 8 x 8 points */
                for (int k = 0; k < 64; k++)
                    hits += hypot(i + (k % 8 + 0.5) / 8 - 0.5, j + (k / 8 + 0.5) / 8 - 0.5) < r;
                inside += hits / 64.0 * (double)psf->basis[(j + 200) * 401 + i + 200];
            }
        double want = 1.0 - pow(1.0 + r * r / (alpha * alpha), 1.0 - beta);
        assert_near(inside / want, 1.0, 1e-3);
    }
    double got, ellipticity, exponent;
    assert_int_equal(rx_psf_shape(psf->basis, 401, &got, &ellipticity, &exponent, NULL), RX_OK);
    assert_near(got / fwhm, 1.0, 1e-3);
    assert_near(ellipticity, 0.0, 1e-3);
    assert_near(exponent / beta, 1.0, 1e-2);
    rx_psf_free(psf);
}

/* A star of known numbers on its sky, from a start far off: all come back, and chi2 is that of the pixel that
 * was moved. */
static void test_moffat_fit(void **state)
{
    (void)state;
    enum { HALF = 12, SIDE = 2 * HALF + 1, N = SIDE * SIDE };
    rx_moffat_pixels pixels;
    rx_moffat profile;
    double shape[RX_MOFFAT_SHAPE];
    rx_moffat_shape(3.7, 3.2, 0.8, 0.4, shape);
    rx_moffat_set(&profile, shape);
    assert_int_equal(rx_moffat_pixels_new(N, &pixels, NULL), RX_OK);
    for (pixels.n = 0; pixels.n < N; pixels.n++) {
        const double x = pixels.n % SIDE - HALF, y = pixels.n / SIDE - HALF;
        pixels.x[pixels.n] = x;
        pixels.y[pixels.n] = y;
        pixels.value[pixels.n] = 20.0 + 500.0 * rx_moffat_pixel(&profile, x - 0.3, y + 0.45, NULL);
        pixels.sigma[pixels.n] = 2.0;
    }
    rx_moffat_fit fit = {.peak = 400.0, .sky = 10.0};
    rx_moffat_shape(5.0, 4.0, 1.0, 0.0, fit.shape);
    assert_int_equal(rx_moffat_fit_run(&pixels, 1, &fit, NULL), RX_OK);
    assert_int_equal(fit.converged, 1);
    assert_near(fit.peak, 500.0, 1e-3);
    assert_near(fit.x, 0.3, 1e-6);
    assert_near(fit.y, -0.45, 1e-6);
    assert_near(fit.sky, 20.0, 1e-3);
    for (int i = 0; i < RX_MOFFAT_SHAPE; i++)
        assert_near(fit.shape[i], shape[i], 1e-5);
    assert_near(fit.chi2, 0.0, 1e-6);
    assert_near(rx_moffat_fit_fwhm(&fit), 3.7, 1e-5);
    assert_near(rx_moffat_fit_ellipticity(&fit), 0.2, 1e-5);
    rx_moffat_set(&profile, fit.shape);
    assert_near(rx_moffat_fit_value(&fit, &profile, 2.0, 1.0), pixels.value[(1 + HALF) * SIDE + 2 + HALF],
                1e-3);
    fit = (rx_moffat_fit){.peak = 400.0, .sky = 20.0}; /* with the sky as it is */
    rx_moffat_shape(5.0, 4.0, 1.0, 0.0, fit.shape);
    assert_int_equal(rx_moffat_fit_run(&pixels, 0, &fit, NULL), RX_OK);
    assert_int_equal(fit.converged, 1);
    assert_near(fit.peak, 500.0, 1e-3);
    assert_near(fit.sky, 20.0, 0.0);
    assert_near(fit.chi2, 0.0, 1e-6);
    pixels.sigma[0] = 2e3; /* three sigma off, and no weight to speak of */
    pixels.value[0] += 6e3;
    assert_int_equal(rx_moffat_fit_run(&pixels, 1, &fit, NULL), RX_OK);
    assert_near(fit.chi2, 9.0, 1e-3);
    rx_moffat_pixels_free(&pixels);
}

/* The shape follows from the pixels within four widths of the disc that is above half of the peak, and not
 * from any other; in a small stamp from all. */
static void test_shape_is_of_the_core(void **state)
{
    (void)state;
    for (int size = 9; size < 80; size += 52) {
        const int half = size / 2;
        rx_psf *psf;
        int above = 0, n = size * size, reached = 0;
        double fwhm[2], ellipticity;
        assert_int_equal(rx_psf_moffat(4.2, 3.0, 1.0, 0.0, size, &psf, NULL), RX_OK);
        assert_int_equal(rx_psf_shape(psf->basis, size, &fwhm[0], &ellipticity, NULL, NULL), RX_OK);
        for (int i = 0; i < n; i++)
            above += psf->basis[i] > 0.5F * psf->basis[half * size + half];
        const double radius = 4.0 * 2.0 * sqrt(above / M_PI);
        for (int i = 0; i < n; i++) {
            const double r = hypot(i % size - half, i / size - half);
            const float kept = psf->basis[i];
            if (fabs(r - radius) > 1.0 && i != half && i != half * size) /* around the limit, and edges */
                continue;
            psf->basis[i] += 0.02F * psf->basis[half * size + half];
            assert_int_equal(rx_psf_shape(psf->basis, size, &fwhm[1], &ellipticity, NULL, NULL), RX_OK);
            assert_int_equal(fwhm[1] != fwhm[0], r <= radius);
            reached += r <= radius;
            psf->basis[i] = kept;
        }
        assert_true(reached > 0);
        rx_psf_free(psf);
    }
}

/* PSF_TYPE MOFFAT: of the tile at most where the size is ours to choose, else as asked for or refused. */
static void test_moffat_of_a_tile(void **state)
{
    (void)state;
    static const int cases[][4] = {{40, 31, 0, 31},  {31, 40, 0, 31},  {30, 44, 0, 29},  {400, 400, 0, 0},
                                   {40, 31, 31, 31}, {31, 40, 31, 31}, {40, 31, 33, -1}, {31, 40, 33, -1},
                                   {40, 31, 1, 1},   {40, 31, 8, -1}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const rx_image image = {.width = cases[k][0], .height = cases[k][1]};
        const rx_psf_params par = {.type = RX_PSF_MOFFAT, .fwhm = 6.0, .beta = 2.5, .size = cases[k][2]};
        rx_psf *psf, *same;
        rx_status status = rx_psf_make(&par, &image, NULL, NULL, &psf, NULL);
        assert_int_equal(status == RX_OK, cases[k][3] >= 0);
        if (status != RX_OK)
            continue;
        assert_int_equal(rx_psf_moffat(6.0, 2.5, 1.0, 0.0, cases[k][3], &same, NULL), RX_OK);
        assert_int_equal(psf->size, same->size);
        assert_memory_equal(psf->basis, same->basis, sizeof(float) * (size_t)(psf->size * psf->size));
        assert_near(psf->fwhm, 6.0, 0.0);
        assert_near(psf->beta, 2.5, 0.0);
        rx_psf_free(psf);
        rx_psf_free(same);
    }
}

/* A wide ellipse: second moments of the stamp point along the angle. */
static void test_moffat_angle(void **state)
{
    (void)state;
    rx_psf *psf;
    assert_int_equal(rx_psf_moffat(5.0, 4.0, 0.6, 0.5, 61, &psf, NULL), RX_OK);
    double xx = 0.0, yy = 0.0, xy = 0.0;
    for (int j = -30; j <= 30; j++)
        for (int i = -30; i <= 30; i++) {
            double v = (double)psf->basis[(j + 30) * 61 + i + 30];
            if (i * i + j * j < 900) {
                xx += v * i * i;
                yy += v * j * j;
                xy += v * i * j;
            }
        }
    assert_near(0.5 * atan2(2.0 * xy, xx - yy), 0.5, 0.005);
    /* the stamp is the model that is fitted to it */
    double fwhm, ellipticity, beta;
    assert_int_equal(rx_psf_shape(psf->basis, 61, &fwhm, &ellipticity, &beta, NULL), RX_OK);
    assert_near(fwhm, 5.0, 1e-4);
    assert_near(ellipticity, 0.4, 1e-5);
    assert_near(beta, 4.0, 1e-3);
    assert_near(psf->fwhm, 5.0, 0);
    assert_near(psf->beta, 4.0, 0);
    assert_near(psf->ellipticity, 0.4, 1e-15);
    rx_psf_free(psf);
}

static void test_moffat_refused(void **state)
{
    (void)state;
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_psf_moffat(0.0, 4.0, 1.0, 0.0, 0, &psf, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "PSF_FWHM"));
    assert_null(psf);
    assert_int_equal(rx_psf_moffat(NAN, 4.0, 1.0, 0.0, 0, &psf, &err), RX_INPUT);
    assert_int_equal(rx_psf_moffat(3.0, 1.0, 1.0, 0.0, 0, &psf, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "PSF_BETA"));
    assert_int_equal(rx_psf_moffat(3.0, 4.0, 0.0, 0.0, 0, &psf, &err), RX_INPUT);
    assert_int_equal(rx_psf_moffat(3.0, 4.0, 1.0, 0.0, 8, &psf, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "odd"));
}

/* Stars are those of a list; without one there is nothing to measure. */
static void test_auto_without_stars(void **state)
{
    (void)state;
    const rx_psf_params par = {.type = RX_PSF_AUTO, .min_stars = 5, .min_snr = 20.0};
    const rx_image image = {.width = 64, .height = 64};
    rx_error err = RX_ERROR_NONE;
    rx_psf *psf = NULL;
    assert_int_equal(rx_psf_make(&par, &image, NULL, NULL, &psf, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "PSF_TYPE AUTO"));
    assert_null(psf);
}

static void test_polynomial_and_copy(void **state)
{
    (void)state;
    rx_psf psf = {.type = RX_PSF_PSFEX,
                  .size = 1,
                  .nbasis = 3,
                  .x0 = 10,
                  .y0 = 20,
                  .xs = 5,
                  .ys = 4,
                  .px = {0, 2, 1},
                  .py = {0, 0, 1},
                  .nstars = 2};
    float basis[3] = {1.0F, 0.5F, -0.25F}, value;
    double stars[2][2] = {{1, 2}, {3, 4}};
    psf.basis = basis;
    psf.stars = stars;
    rx_psf_at(&psf, 15.0, 12.0, &value);
    assert_near(value, 1.0 + 0.5 * 1.0 - 0.25 * 1.0 * -2.0, 1e-6);
    assert_near(rx_psf_noise_area(&psf, 15.0, 12.0), 1.0 / 4.0, 1e-6);
    rx_psf *copy = rx_psf_copy(&psf);
    assert_non_null(copy);
    assert_true(copy->basis != psf.basis);
    assert_true(copy->stars != psf.stars);
    assert_true(copy->stars[1][1] == 4.0);
    rx_psf_at(copy, 15.0, 12.0, basis);
    assert_true(basis[0] == value);
    rx_psf_free(copy);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_auto_without_stars), cmocka_unit_test(test_shape_is_of_the_core),
        cmocka_unit_test(test_moffat_of_a_tile),   cmocka_unit_test(test_moffat_pixels),
        cmocka_unit_test(test_moffat_gradient),    cmocka_unit_test(test_encircled_energy),
        cmocka_unit_test(test_moffat_angle),       cmocka_unit_test(test_moffat_fit),
        cmocka_unit_test(test_moffat_refused),     cmocka_unit_test(test_polynomial_and_copy),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
