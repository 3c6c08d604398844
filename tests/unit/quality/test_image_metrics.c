/* MSE, PSNR and SSIM against skimage and against windows one by one. */
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
#include "quality/image_metrics.h"

enum { MOST = 64 };

/* yy, xx = mgrid[0:h, 0:w]; ref = (3xx^2 + 5yy^2 + 7xx*yy) % 251 or 100 + xx + 2yy + 60((xx//8 + yy//8) % 2);
 * img = ref + (31xx + 17yy) % 23 - 11. */
static void fill(int width, int height, int kind, float *image, float *reference)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            int value = kind == 0 ? (3 * x * x + 5 * y * y + 7 * x * y) % 251
                                  : 100 + x + 2 * y + 60 * ((x / 8 + y / 8) % 2);
            reference[y * width + x] = (float)value;
            image[y * width + x] = (float)(value + (31 * x + 17 * y) % 23 - 11);
        }
}

/* skimage.metrics.structural_similarity(ref, img, gaussian_weights=True, sigma=1.5,
 * use_sample_covariance=False, K1=, K2=, data_range=) with .001, .001, ref.max()-ref.min() and .01, .03, 255;
 * 20 log10(ref.max() / sqrt(mse)). */
static void as_skimage(void **state)
{
    static const struct {
        int width, height, kind;
        double mse, psnr, paper, usual;
    } expected[] = {
        {11, 11, 0, 43.9338842975207, 31.4959909223723, 0.995855639687656, 0.995878585703113},
        {11, 11, 1, 43.9338842975207, 29.0088361111875, 0.93935833143445, 0.94393152870473},
        {40, 23, 0, 44, 31.5242734085789, 0.99568851512421, 0.995713598790534},
        {40, 23, 1, 44, 30.9868304805729, 0.955056918204443, 0.959113570074109},
        {64, 64, 0, 44.00390625, 31.5238878659608, 0.9957538431899, 0.995777842269239},
        {64, 64, 1, 44.00390625, 34.2201752723699, 0.948955681169134, 0.954277268885394},
        {11, 30, 0, 43.9636363636364, 31.5278641031357, 0.995858609028403, 0.995881324521965},
        {11, 30, 1, 43.9636363636364, 30.6127142919222, 0.944940623415753, 0.949674559571492},
    };
    float image[MOST * MOST], reference[MOST * MOST];
    double ssim;
    (void)state;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        int w = expected[i].width, h = expected[i].height;
        fill(w, h, expected[i].kind, image, reference);
        assert_near(rx_image_mse(w, h, image, reference), expected[i].mse, 1e-11);
        assert_near(rx_image_psnr(w, h, image, reference), expected[i].psnr, 1e-11);
        assert_int_equal(rx_image_ssim(w, h, image, reference, 0.001, 0.001, 0, &ssim, NULL), RX_OK);
        assert_near(ssim, expected[i].paper, 1e-11);
        assert_int_equal(rx_image_ssim(w, h, image, reference, 0.01, 0.03, 255, &ssim, NULL), RX_OK);
        assert_near(ssim, expected[i].usual, 1e-11);
    }
}

/* One window at a time, weights in two dimensions. */
static double window_by_window(int width, int height, const float *a, const float *b, double c1, double c2)
{
    double sum = 0;
    for (int y = 5; y < height - 5; y++)
        for (int x = 5; x < width - 5; x++) {
            double w = 0, ma = 0, mb = 0, va = 0, vb = 0, cov = 0;
            for (int pass = 0; pass < 2; pass++)
                for (int v = -5; v <= 5; v++)
                    for (int u = -5; u <= 5; u++) {
                        double g = exp(-(u * u + v * v) / (2 * 1.5 * 1.5));
                        double p = a[(y + v) * width + x + u], q = b[(y + v) * width + x + u];
                        if (pass == 0) {
                            w += g;
                            ma += g * p;
                            mb += g * q;
                        } else {
                            va += g * (p - ma / w) * (p - ma / w) / w;
                            vb += g * (q - mb / w) * (q - mb / w) / w;
                            cov += g * (p - ma / w) * (q - mb / w) / w;
                        }
                    }
            ma /= w;
            mb /= w;
            sum += (2 * ma * mb + c1) * (2 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
        }
    return sum / ((width - 10) * (height - 10));
}

/* Also on a high level, where sums of squares lose their digits. */
static void ssim_window_by_window(void **state)
{
    static const double levels[] = {0, 1e5};
    float image[37 * 29], reference[37 * 29];
    (void)state;
    for (size_t k = 0; k < 2; k++) {
        double low = INFINITY, high = -INFINITY, ssim;
        for (uint64_t i = 0; i < 37 * 29; i++) {
            reference[i] = (float)(levels[k] + 100 * rx_random_uniform(1, 0, i));
            image[i] = (float)(reference[i] + 20 * rx_random_normal(1, 1, i));
            low = fmin(low, reference[i]);
            high = fmax(high, reference[i]);
        }
        double c = 0.001 * (high - low) * 0.001 * (high - low);
        assert_int_equal(rx_image_ssim(37, 29, image, reference, 0.001, 0.001, 0, &ssim, NULL), RX_OK);
        assert_near(ssim, window_by_window(37, 29, image, reference, c, c), 1e-11);
    }
}

static void what_follows_from_the_formulas(void **state)
{
    float image[32 * 16], reference[32 * 16], other[32 * 16];
    double ssim, back;
    (void)state;
    fill(32, 16, 1, other, reference);
    assert_near(rx_image_mse(32, 16, reference, reference), 0, 0);
    assert_true(isinf(rx_image_psnr(32, 16, reference, reference)));
    assert_int_equal(rx_image_ssim(32, 16, reference, reference, 0.001, 0.001, 0, &ssim, NULL), RX_OK);
    assert_near(ssim, 1, 1e-14);
    for (int i = 0; i < 32 * 16; i++)
        image[i] = reference[i] + 2.5f;
    assert_near(rx_image_mse(32, 16, image, reference), 6.25, 1e-12);
    /* symmetric, when the range is given */
    assert_int_equal(rx_image_ssim(32, 16, image, other, 0.001, 0.001, 200, &ssim, NULL), RX_OK);
    assert_int_equal(rx_image_ssim(32, 16, other, image, 0.001, 0.001, 200, &back, NULL), RX_OK);
    assert_near(ssim, back, 1e-14);
    /* an image upside down about its mean is anticorrelated */
    for (int i = 0; i < 32 * 16; i++)
        image[i] = 300 - reference[i];
    assert_int_equal(rx_image_ssim(32, 16, image, reference, 0.001, 0.001, 0, &ssim, NULL), RX_OK);
    assert_true(ssim < -0.8);
}

/* Prepared once, a reference gives what it gives unprepared: to the bit, for one image after another. */
static void prepared_references(void **state)
{
    static const int sizes[][2] = {{11, 11}, {12, 40}, {64, 64}};
    float image[MOST * MOST], reference[MOST * MOST];
    (void)state;
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        int w = sizes[i][0], h = sizes[i][1];
        rx_image_reference *prepared = NULL;
        fill(w, h, 1, image, reference);
        assert_int_equal(rx_image_reference_new(w, h, reference, 0.01, 0.03, 0, &prepared, NULL), RX_OK);
        for (int k = 0; k < 3; k++) {
            double one, other;
            image[k] = (float)(100 * k);
            assert_int_equal(rx_image_ssim(w, h, image, reference, 0.01, 0.03, 0, &one, NULL), RX_OK);
            assert_int_equal(rx_reference_ssim(prepared, image, &other, NULL), RX_OK);
            assert_true(one == other);
            assert_true(rx_image_psnr(w, h, image, reference) == rx_reference_psnr(prepared, image));
        }
        rx_image_reference_free(prepared);
    }
    rx_image_reference_free(NULL);
}

static void what_cannot_be_measured(void **state)
{
    float image[16 * 16], reference[16 * 16] = {0};
    double ssim = 0;
    rx_error err = RX_ERROR_NONE;
    (void)state;
    fill(16, 16, 0, image, reference);
    assert_int_equal(rx_image_ssim(10, 16, image, reference, 0.001, 0.001, 0, &ssim, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "11 x 11 pixels or more, not 10 x 16"));
    assert_true(isnan(ssim));
    image[40] = NAN;
    assert_true(isnan(rx_image_psnr(16, 16, image, reference)));
    assert_int_equal(rx_image_ssim(16, 16, image, reference, 0.001, 0.001, 0, &ssim, NULL), RX_OK);
    assert_true(isnan(ssim));
    image[40] = INFINITY;
    assert_true(isnan(rx_image_mse(16, 16, image, reference)));
    assert_true(isnan(rx_image_psnr(16, 16, image, reference)));
    memset(reference, 0, sizeof reference);
    assert_true(isnan(rx_image_psnr(16, 16, image, reference)));
    assert_int_equal(rx_image_ssim(16, 16, image, reference, 0.001, 0.001, 0, &ssim, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "contrast"));
    rx_image_reference *prepared = NULL;
    assert_int_equal(rx_image_reference_new(16, 16, reference, 0.001, 0.001, 0, &prepared, &err), RX_INPUT);
    assert_null(prepared);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_skimage),
        cmocka_unit_test(ssim_window_by_window),
        cmocka_unit_test(what_follows_from_the_formulas),
        cmocka_unit_test(prepared_references),
        cmocka_unit_test(what_cannot_be_measured),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
