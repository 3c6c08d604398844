/* nn/deblur: what the relative PSF leaves, how the Tikhonov filter reaches, against direct sums and numpy. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
#include "nn/deblur.h"
#include "num/convolve.h"
#include "psf/moffat.h"

enum { SIZE = 63, TARGET_RADIUS = 5 };
static const double TARGET = 2;

/* Moffat of sum 1, its centre (dx, dy) off that of the stamp; caller frees. */
static float *moffat(double fwhm, double beta, double ratio, double dx, double dy, int size)
{
    float *stamp = RX_NEW(float, (size_t)size *(size_t)size);
    assert_non_null(stamp);
    double shape[RX_MOFFAT_SHAPE], sum = 0;
    rx_moffat profile;
    rx_moffat_shape(fwhm, beta, ratio, 0.5, shape);
    rx_moffat_set(&profile, shape);
    for (int k = 0; k < size * size; k++) {
        stamp[k] = (float)rx_moffat_pixel(&profile, k % size - size / 2 - dx, k / size - size / 2 - dy, NULL);
        sum += stamp[k];
    }
    for (int k = 0; k < size * size; k++)
        stamp[k] = (float)(stamp[k] / sum);
    return stamp;
}

static void target_weights(double *k)
{
    const double unit = 2.3548200450309493 / TARGET / sqrt(2.0);
    double sum = 0;
    for (int i = -TARGET_RADIUS; i <= TARGET_RADIUS; i++)
        sum += k[i + TARGET_RADIUS] = erf((i + 0.5) * unit) - erf((i - 0.5) * unit);
    for (int i = 0; i <= 2 * TARGET_RADIUS; i++)
        k[i] /= sum;
}

static double at(const float *stamp, int size, int x, int y)
{
    return x < 0 || y < 0 || x >= size || y >= size ? 0 : stamp[(size_t)y * (size_t)size + (size_t)x];
}

/* largest |K' * K - O| / peak of O where the sum is complete */
static double left_over(const float *relative, const float *psf)
{
    double k[2 * TARGET_RADIUS + 1], worst = 0, peak = 0;
    target_weights(k);
    for (int y = TARGET_RADIUS; y < SIZE - TARGET_RADIUS; y++)
        for (int x = TARGET_RADIUS; x < SIZE - TARGET_RADIUS; x++) {
            double sum = 0;
            for (int j = -TARGET_RADIUS; j <= TARGET_RADIUS; j++)
                for (int i = -TARGET_RADIUS; i <= TARGET_RADIUS; i++)
                    sum += k[j + TARGET_RADIUS] * k[i + TARGET_RADIUS] * at(relative, SIZE, x - i, y - j);
            worst = fmax(worst, fabs(sum - at(psf, SIZE, x, y)));
            peak = fmax(peak, at(psf, SIZE, x, y));
        }
    return worst / peak;
}

/* The table of nn/deblur.h: each figure there is an upper limit, and no idle one. */
static void relative_psf_of_moffats(void **state)
{
    static const struct {
        double fwhm, left[2], lobe;
    } table[] = {{2, {0.0138, 0.0121}, 0.053},    {2.25, {0.0087, 0.0071}, 0.0117},
                 {2.5, {0.0054, 0.0042}, 0.0024}, {3, {0.0021, 0.0015}, 0.0002},
                 {4, {0.0004, 0.00025}, 0.0002},  {6, {0.00006, 0.00005}, 0.0002},
                 {8, {0.00003, 0.00002}, 0.0002}};
    for (size_t t = 0; t < sizeof table / sizeof table[0]; t++)
        for (int b = 0; b < 2; b++) {
            float *psf = moffat(table[t].fwhm, b == 0 ? 3 : 5, 1, 0, 0, SIZE);
            float *relative = RX_NEW(float, SIZE *SIZE);
            assert_int_equal(rx_deblur_relative(psf, SIZE, TARGET, SIZE, 0, relative, NULL), RX_OK);
            const double left = left_over(relative, psf);
            double least = 0, peak = 0;
            for (int k = 0; k < SIZE * SIZE; k++) {
                least = fmin(least, relative[k]);
                peak = fmax(peak, relative[k]);
            }
            if (left > table[t].left[b] || left < table[t].left[b] / 3 || -least > table[t].lobe * peak)
                fail_msg("FWHM %g beta %d: |K'*K - O| %.5f of the peak, lobes %.4f", table[t].fwhm,
                         b == 0 ? 3 : 5, left, -least / peak);
            free(psf);
            free(relative);
        }
}

/* Elliptical and off centre: not mirrored, not moved; and sum 1. */
static void relative_psf_keeps_its_place(void **state)
{
    float *psf = moffat(4, 3.5, 0.7, 1.3, -0.6, SIZE), *relative = RX_NEW(float, SIZE *SIZE);
    assert_int_equal(rx_deblur_relative(psf, SIZE, TARGET, SIZE, 1, relative, NULL), RX_OK);
    assert_true(left_over(relative, psf) < 0.003);
    double sum = 0;
    for (int k = 0; k < SIZE * SIZE; k++)
        sum += relative[k];
    assert_true(fabs(sum - 1) < 1e-5);
    free(psf);
    free(relative);
}

static double share_outside(const float *relative, int size, int radius)
{
    double inside = 0, total = 0;
    for (int k = 0; k < size * size; k++) {
        const int far = abs(k % size - size / 2) > radius || abs(k / size - size / 2) > radius;
        total += fabs(relative[k]);
        inside += far ? 0 : fabs(relative[k]);
    }
    return 1 - inside / total;
}

static void size_holds_all_but_a_thousandth(void **state)
{
    for (double fwhm = 2; fwhm <= 4; fwhm += 1) {
        float *psf = moffat(fwhm, 4, 1, 0, 0, SIZE), *relative = RX_NEW(float, 95 * 95);
        int size = 0;
        assert_int_equal(rx_deblur_relative_size(psf, SIZE, TARGET, 99, &size, NULL), RX_OK);
        assert_int_equal(rx_deblur_relative(psf, SIZE, TARGET, 95, 0, relative, NULL), RX_OK);
        assert_int_equal(size % 2, 1);
        assert_true(share_outside(relative, 95, size / 2) <= 1.0001e-3);
        assert_true(share_outside(relative, 95, size / 2 - 1) > 0.9999e-3);
        assert_int_equal(rx_deblur_relative_size(psf, SIZE, TARGET, 16, &size, NULL), RX_OK);
        assert_int_equal(size, 15);
        free(psf);
        free(relative);
    }
}

/* ---- Tikhonov ---- */

typedef struct rx_bench {
    rx_fft *fft;
    float *work, *spectrum, *half;
} rx_bench;

static rx_bench bench_new(int width, int height)
{
    rx_bench b = {0};
    assert_int_equal(rx_fft_new(width, height, 1, &b.fft, NULL), RX_OK);
    b.work = rx_fft_real(b.fft);
    b.spectrum = rx_fft_complex(b.fft);
    b.half = rx_fft_complex(b.fft);
    assert_non_null(b.work);
    assert_non_null(b.spectrum);
    assert_non_null(b.half);
    return b;
}

static void bench_free(rx_bench *b)
{
    rx_fft_free(b->fft);
    free(b->work);
    free(b->spectrum);
    free(b->half);
}

/* the filter's values: what it makes of a point at the origin */
static void impulse(rx_bench *b)
{
    memset(b->work, 0, (size_t)rx_fft_height(b->fft) * (size_t)rx_fft_stride_real(b->fft) * sizeof *b->work);
    b->work[0] = 1;
    rx_convolve(b->fft, b->spectrum, b->work, b->half, b->work);
}

/* /usr/bin/python3 -c '
import numpy as np
from scipy.special import erf
def g(f, c=0):
    s = f/2.3548200450309493*2**.5; i = np.arange(-15, 16)-c
    w = erf((i+.5)/s)-erf((i-.5)/s); return w/w.sum()
def ft(a):
    p = np.zeros((40, 48)); p[:31, :31] = a; return np.fft.fft2(np.roll(p, (-15, -15), (0, 1)))
O, K, e = ft(np.outer(g(4, -0.5), g(5, 1))), ft(np.outer(g(2), g(2))), 0.02
T = np.fft.ifft2((1+e)*O.conj()*K/(abs(O)**2+e)).real
for y, x in ((0, 0), (0, 47), (1, 47), (2, 45), (35, 3), (20, 24)): print("{%d, %d, %.7f}," % (y, x, T[y,
x]))' */
static void tikhonov_against_numpy(void **state)
{
    static const struct {
        int y, x;
        double value;
    } expected[] = {{0, 0, 0.2046870},  {0, 47, 0.2596873}, {1, 47, 0.2596873},
                    {2, 45, 0.0171921}, {35, 3, 0.0105280}, {20, 24, 0.0000007}};
    float psf[31 * 31], gx[31], gy[31];
    const double sx = 5 / 2.3548200450309493 * sqrt(2.0), sy = 4 / 2.3548200450309493 * sqrt(2.0);
    for (int i = -15; i <= 15; i++) {
        gx[i + 15] = (float)(erf((i - 0.5) / sx) - erf((i - 1.5) / sx)) / 2;
        gy[i + 15] = (float)(erf((i + 1.0) / sy) - erf(i / sy)) / 2;
    }
    for (int k = 0; k < 31 * 31; k++)
        psf[k] = gy[k / 31] * gx[k % 31];
    rx_bench b = bench_new(48, 40);
    assert_int_equal(rx_deblur_tikhonov(b.fft, psf, 31, &(rx_tikhonov){TARGET, 0.02, 0}, b.spectrum, NULL),
                     RX_OK);
    impulse(&b);
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++) {
        const double value =
            b.work[(size_t)expected[i].y * (size_t)rx_fft_stride_real(b.fft) + (size_t)expected[i].x];
        if (fabs(value - expected[i].value) > 2e-6)
            fail_msg("filter (%d, %d): %.7f, numpy %.7f", expected[i].y, expected[i].x, value,
                     expected[i].value);
    }
    bench_free(&b);
}

/* The sum of |filter| farther than RX_TIKHONOV_REACH in x or y; *sum: of the filter itself. */
static double beyond_reach(rx_bench *b, double *sum)
{
    double beyond = 0;
    const int n = rx_fft_width(b->fft);
    *sum = 0;
    impulse(b);
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            const double value = b->work[(size_t)y * (size_t)rx_fft_stride_real(b->fft) + (size_t)x];
            const int dx = x > n / 2 ? n - x : x, dy = y > n / 2 ? n - y : y;
            *sum += value;
            beyond += dx > RX_TIKHONOV_REACH || dy > RX_TIKHONOV_REACH ? fabs(value) : 0;
        }
    return beyond;
}

static void tikhonov_reach_and_flux(void **state)
{
    static const double most[] = {1e-4, 1e-4, 4e-4, 1e-3}; /* FWHM 2, 4, 6, 8 */
    rx_bench b = bench_new(256, 256);
    for (int f = 0; f < 4; f++)
        for (int beta = 3; beta <= 5; beta += 2) {
            float *psf = moffat(2 + 2 * f, beta, 1, 0, 0, 127);
            double sum;
            assert_int_equal(
                rx_deblur_tikhonov(b.fft, psf, 127, &(rx_tikhonov){TARGET, 0.02, 0}, b.spectrum, NULL),
                RX_OK);
            const double beyond = beyond_reach(&b, &sum);
            if (beyond > most[f])
                fail_msg("FWHM %d beta %d: %.2e beyond %d pixels", 2 + 2 * f, beta, beyond,
                         RX_TIKHONOV_REACH);
            assert_true(fabs(sum - 1) < 1e-4);
            free(psf);
        }
    bench_free(&b);
}

static void what_cannot_be_is_said(void **state)
{
    float psf[9] = {0, 0, 0, 0, 1, 0, 0, 0, 0}, out[9];
    rx_error err = RX_ERROR_NONE;
    int size;
    rx_bench b = bench_new(8, 8);
    psf[5] = NAN;
    assert_int_equal(rx_deblur_relative(psf, 3, TARGET, 3, 1, out, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "column 3 of row 2"));
    assert_int_equal(rx_deblur_relative_size(psf, 3, TARGET, 3, &size, &err), RX_INPUT);
    assert_int_equal(rx_deblur_tikhonov(b.fft, psf, 3, &(rx_tikhonov){TARGET, 0.02, 0}, b.spectrum, &err),
                     RX_INPUT);
    psf[5] = 0;
    psf[0] = NAN;
    assert_int_equal(rx_deblur_relative(psf, 3, TARGET, 3, 1, out, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "column 1 of row 1"));
    psf[0] = -1; /* with the 1 in the middle a sum of 0 */
    assert_int_equal(rx_deblur_relative(psf, 3, TARGET, 3, 1, out, &err), RX_INPUT);
    psf[0] = 0;
    psf[4] = -1;
    assert_int_equal(rx_deblur_relative(psf, 3, TARGET, 3, 1, out, &err), RX_INPUT);
    assert_int_equal(rx_deblur_relative(psf, 3, TARGET, 3, 0, out, &err), RX_OK);
    float *large = moffat(3, 3, 1, 0, 0, 9);
    assert_int_equal(rx_deblur_tikhonov(b.fft, large, 9, &(rx_tikhonov){TARGET, 0.02, 0}, b.spectrum, &err),
                     RX_INPUT);
    free(large);
    bench_free(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(relative_psf_of_moffats),         cmocka_unit_test(relative_psf_keeps_its_place),

        cmocka_unit_test(size_holds_all_but_a_thousandth), cmocka_unit_test(tikhonov_against_numpy),
        cmocka_unit_test(tikhonov_reach_and_flux),         cmocka_unit_test(what_cannot_be_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
