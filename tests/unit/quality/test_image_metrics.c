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

/* SSIM of the image, and PSNR where it is asked for. */
static double ssim_of(int width, int height, const float *image, const float *reference, double *psnr)
{
    rx_image_reference *prepared = NULL;
    double ssim = 0;
    assert_int_equal(rx_image_reference_new(width, height, reference, &prepared, NULL), RX_OK);
    assert_int_equal(rx_reference_ssim(prepared, image, &ssim, NULL), RX_OK);
    if (psnr != NULL)
        *psnr = rx_reference_psnr(prepared, image);
    rx_image_reference_free(prepared);
    return ssim;
}

/* skimage.metrics.structural_similarity(ref, img, gaussian_weights=True, sigma=1.5,
 * use_sample_covariance=False, K1=, K2=, data_range=) with .001, .001, ref.max()-ref.min();
 * 20 log10(ref.max() / sqrt(mse)). */
static void as_skimage(void **state)
{
    static const struct {
        int width, height, kind;
        double psnr, ssim;
    } expected[] = {
        {11, 11, 0, 31.4959909223723, 0.995855639687656}, {11, 11, 1, 29.0088361111875, 0.93935833143445},
        {40, 23, 0, 31.5242734085789, 0.99568851512421},  {40, 23, 1, 30.9868304805729, 0.955056918204443},
        {64, 64, 0, 31.5238878659608, 0.9957538431899},   {64, 64, 1, 34.2201752723699, 0.948955681169134},
        {11, 30, 0, 31.5278641031357, 0.995858609028403}, {11, 30, 1, 30.6127142919222, 0.944940623415753},
    };
    float image[MOST * MOST], reference[MOST * MOST];
    double psnr;
    (void)state;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        int w = expected[i].width, h = expected[i].height;
        fill(w, h, expected[i].kind, image, reference);
        assert_near(ssim_of(w, h, image, reference, &psnr), expected[i].ssim, 1e-11);
        assert_near(psnr, expected[i].psnr, 1e-11);
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
        double low = INFINITY, high = -INFINITY;
        for (uint64_t i = 0; i < 37 * 29; i++) {
            reference[i] = (float)(levels[k] + 100 * rx_random_uniform(1, 0, i));
            image[i] = (float)(reference[i] + 20 * rx_random_normal(1, 1, i));
            low = fmin(low, reference[i]);
            high = fmax(high, reference[i]);
        }
        double c = 0.001 * (high - low) * 0.001 * (high - low);
        assert_near(ssim_of(37, 29, image, reference, NULL), window_by_window(37, 29, image, reference, c, c),
                    1e-11);
    }
}

static void what_follows_from_the_formulas(void **state)
{
    float image[32 * 16], reference[32 * 16];
    double psnr;
    (void)state;
    fill(32, 16, 1, image, reference);
    assert_near(ssim_of(32, 16, reference, reference, &psnr), 1, 1e-14);
    assert_true(isinf(psnr));
    double high = 0;
    for (int i = 0; i < 32 * 16; i++) {
        image[i] = reference[i] + 2.5f;
        high = fmax(high, reference[i]);
    }
    ssim_of(32, 16, image, reference, &psnr);
    assert_near(psnr, 20 * log10(high / 2.5), 1e-12);
    /* an image upside down about its mean is anticorrelated */
    for (int i = 0; i < 32 * 16; i++)
        image[i] = 300 - reference[i];
    assert_true(ssim_of(32, 16, image, reference, NULL) < -0.8);
}

/* A reference gives the same for one image whatever it was compared with before. */
static void one_image_after_another(void **state)
{
    static const int sizes[][2] = {{11, 11}, {12, 40}, {64, 64}};
    float image[MOST * MOST], reference[MOST * MOST];
    (void)state;
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        int w = sizes[i][0], h = sizes[i][1];
        rx_image_reference *prepared = NULL;
        fill(w, h, 1, image, reference);
        assert_int_equal(rx_image_reference_new(w, h, reference, &prepared, NULL), RX_OK);
        for (int k = 0; k < 3; k++) {
            double ssim, psnr;
            image[k] = (float)(100 * k);
            assert_int_equal(rx_reference_ssim(prepared, image, &ssim, NULL), RX_OK);
            assert_true(ssim == ssim_of(w, h, image, reference, &psnr));
            assert_true(psnr == rx_reference_psnr(prepared, image));
        }
        rx_image_reference_free(prepared);
    }
    rx_image_reference_free(NULL);
}

static void what_cannot_be_measured(void **state)
{
    float image[16 * 16], reference[16 * 16] = {0};
    double psnr;
    rx_error err = RX_ERROR_NONE;
    rx_image_reference *prepared = NULL;
    (void)state;
    fill(16, 16, 0, image, reference);
    assert_int_equal(rx_image_reference_new(10, 16, reference, &prepared, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "11 x 11 pixels or more, not 10 x 16"));
    assert_null(prepared);
    image[40] = NAN;
    assert_true(isnan(ssim_of(16, 16, image, reference, &psnr)));
    assert_true(isnan(psnr));
    image[40] = INFINITY;
    ssim_of(16, 16, image, reference, &psnr);
    assert_true(isnan(psnr));
    for (int i = 0; i < 16 * 16; i++)
        reference[i] -= 1000;
    image[40] = 0;
    ssim_of(16, 16, image, reference, &psnr); /* max(ref) <= 0 */
    assert_true(isnan(psnr));
    memset(reference, 0, sizeof reference);
    assert_int_equal(rx_image_reference_new(16, 16, reference, &prepared, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "contrast"));
    assert_null(prepared);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_skimage),
        cmocka_unit_test(ssim_window_by_window),
        cmocka_unit_test(what_follows_from_the_formulas),
        cmocka_unit_test(one_image_after_another),
        cmocka_unit_test(what_cannot_be_measured),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
