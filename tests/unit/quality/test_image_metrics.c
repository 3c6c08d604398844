/* MSE, PSNR and SSIM against skimage and against windows one by one. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
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
    double ssim[RX_SSIM_KINDS];
    assert_int_equal(rx_image_reference_new(width, height, reference, &prepared, NULL), RX_OK);
    assert_int_equal(rx_reference_ssim(prepared, image, ssim, NULL), RX_OK);
    if (psnr != NULL)
        *psnr = rx_reference_psnr(prepared, image);
    rx_image_reference_free(prepared);
    return ssim[RX_SSIM_PAPER];
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
        {11, 11, 0, 31.4959909223723, 0.995855639687656},
        {11, 11, 1, 29.0088361111875, 0.93935833143445},
        {40, 23, 0, 31.5242734085789, 0.99568851512421},
        {64, 64, 1, 34.2201752723699, 0.948955681169134},
    };
    float image[MOST * MOST], reference[MOST * MOST];
    double psnr;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        int w = expected[i].width, h = expected[i].height;
        fill(w, h, expected[i].kind, image, reference);
        assert_near(ssim_of(w, h, image, reference, &psnr), expected[i].ssim, 1e-11);
        assert_near(psnr, expected[i].psnr, 1e-11);
    }
}

/* structural_similarity as above with K1=.01, K2=.03, and with full=True the mean of its map, .001 and .001, over the pixels at least 5
 * from the border that are among the brightest with 90 % of the light: ref = 255 exp(-((xx - 30)^2 + (yy - 34)^2) / 2 / 6^2) rounded to
 * whole numbers, img = ref + (31xx + 17yy) % 23 - 11. */
static void other_kinds_as_skimage(void **state)
{
    float image[MOST * MOST], reference[MOST * MOST];
    double ssim[RX_SSIM_KINDS];
    rx_image_reference *prepared = NULL;
    for (int y = 0; y < MOST; y++)
        for (int x = 0; x < MOST; x++) {
            const double r2 = (x - 30) * (x - 30) + (y - 34) * (y - 34);
            reference[y * MOST + x] = (float)floor(255 * exp(-r2 / 72) + 0.5);
            image[y * MOST + x] = reference[y * MOST + x] + (float)((31 * x + 17 * y) % 23 - 11);
        }
    assert_int_equal(rx_image_reference_new(MOST, MOST, reference, &prepared, NULL), RX_OK);
    assert_int_equal(rx_reference_ssim(prepared, image, ssim, NULL), RX_OK);
    assert_near(ssim[RX_SSIM_PAPER], 0.2937098985472912, 1e-11);
    assert_near(ssim[RX_SSIM_WANG], 0.6749541999268605, 1e-11);
    assert_near(ssim[RX_SSIM_OBJECT], 0.9601999652578084, 1e-11);
    rx_image_reference_free(prepared);
}

/* One window on a high level, where sums of squares lose their digits, by deviations from the mean. */
static void one_window_by_hand(void **state)
{
    float a[121], b[121];
    double low = INFINITY, high = -INFINITY, w = 0, m[2] = {0}, v[3] = {0};
    for (int i = 0; i < 121; i++) {
        b[i] = 1e5f + (float)((i * 37) % 101);
        a[i] = b[i] + (float)((i * 53) % 23);
        low = fmin(low, b[i]);
        high = fmax(high, b[i]);
    }
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < 121; i++) {
            const int x = i % 11 - 5, y = i / 11 - 5;
            const double g = exp(-(x * x + y * y) / 4.5);
            const double p = pass * (a[i] - m[0] / fmax(w, g)), q = pass * (b[i] - m[1] / fmax(w, g));
            w += pass == 0 ? g : 0;
            m[0] += pass == 0 ? g * a[i] : 0;
            m[1] += pass == 0 ? g * b[i] : 0;
            v[0] += g * p * p / w;
            v[1] += g * q * q / w;
            v[2] += g * p * q / w;
        }
    const double c = pow(0.001 * (high - low), 2), ma = m[0] / w, mb = m[1] / w;
    assert_near(ssim_of(11, 11, a, b, NULL),
                (2 * ma * mb + c) * (2 * v[2] + c) / ((ma * ma + mb * mb + c) * (v[0] + v[1] + c)), 1e-11);
}

static void what_cannot_be_measured(void **state)
{
    float image[16 * 16], reference[16 * 16] = {0};
    double psnr;
    rx_error err = RX_ERROR_NONE;
    rx_image_reference *prepared = NULL;
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
        cmocka_unit_test(other_kinds_as_skimage),
        cmocka_unit_test(one_window_by_hand),
        cmocka_unit_test(what_cannot_be_measured),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
