/* restore/stamp: widths against Gaussians, moves, copies. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../near.h"
#include "sky.h"

static double fwhm_of(const float *stamp, int size, double *ellipticity)
{
    double fwhm = 0;
    assert_int_equal(rx_stamp_fwhm(stamp, size, &fwhm, ellipticity, NULL), RX_OK);
    return fwhm;
}

static void widths(void **state)
{
    static const double fwhm[] = {2.0, 2.7, 3.5, 6.0, 11.0};
    for (int i = 0; i < 5; i++) {
        rx_psf *psf = rx_stamp_gauss(fwhm[i]);
        double ellipticity = 1;
        /* a Gaussian over a pixel has the variance sigma^2 + 1/12 */
        double seen = sqrt(fwhm[i] * fwhm[i] + 5.545177 / 12);
        assert_near(fwhm_of(psf->basis, psf->size, &ellipticity), seen, 0.02 * seen);
        assert_true(fabs(ellipticity) < 0.01);
        assert_near(psf->fwhm, fwhm[i], 0);
        rx_psf_free(psf);
    }
}

/* The width of the area above half the height, on 8 x 8 places per pixel: that of a wide Gaussian is smooth
 * enough for the places to be counted without the stamp. */
static void the_area_above_half_the_height(void **state)
{
    float round[61 * 61], flat[61 * 61];
    double ellipticity = 0, n = 0;
    for (int k = 0; k < 61 * 61; k++) {
        const double x = k % 61 - 30, y = k / 61 - 30;
        round[k] = (float)exp(-log(16) * (x * x + y * y) / (18.0 * 18.0));
        flat[k] = (float)exp(-log(16) * (x * x / (24.0 * 24.0) + y * y / (12.0 * 12.0)));
    }
    for (int j = -200; j < 200; j++)
        for (int i = -200; i < 200; i++)
            n += hypot((i + 0.5) / 8, (j + 0.5) / 8) < 9;
    assert_near(fwhm_of(round, 61, &ellipticity), 2 * sqrt(n / 3.14159265358979324) / 8, 0.005);
    assert_near(ellipticity, 0, 1e-6);
    fwhm_of(flat, 61, &ellipticity);
    assert_near(ellipticity, 0.5, 3e-4);
}

/* The same of an ellipse that lies askew, and its axes from the moments of those places. */
static void the_axes_of_the_area(void **state)
{
    enum { SIDE = 61, CENTRE = SIDE / 2 };
    const double major = 12, minor = 6, cosine = cos(0.4), sine = sin(0.4);
    float tilted[SIDE * SIDE];
    double ellipticity = 0, n = 0, xx = 0, yy = 0, xy = 0;
    for (int k = 0; k < SIDE * SIDE; k++) {
        const double x = k % SIDE - CENTRE, y = k / SIDE - CENTRE;
        const double u = (cosine * x + sine * y) / major, v = (cosine * y - sine * x) / minor;
        tilted[k] = (float)exp2(-(u * u + v * v));
    }
    for (int k = 0; k < 256 * 256; k++) {
        const double x = (k % 256 - 127.5) / 8, y = (k / 256 - 127.5) / 8;
        const double u = (cosine * x + sine * y) / major, v = (cosine * y - sine * x) / minor;
        if (u * u + v * v < 1) {
            n++;
            xx += x * x;
            yy += y * y;
            xy += x * y;
        }
    }
    const double half = hypot((xx - yy) / 2, xy), mean = (xx + yy) / 2;
    assert_near(fwhm_of(tilted, SIDE, &ellipticity), 2 * sqrt(n / 3.14159265358979324) / 8, 0.005);
    assert_near(ellipticity, 1 - sqrt((mean - half) / (mean + half)), 1e-4);
}

/* A stamp has one width however it is turned, the area in a corner and other stars two pixels away. */
static void turned_stamps(void **state)
{
    enum { SIDE = 9, LAST = SIDE - 1 };
    double first = 0, flat = 0;
    for (int peak = 0; peak < 3; peak++)
        for (int turn = 0; turn < 8; turn++) {
            float stamp[SIDE * SIDE] = {0};
            double ellipticity = 0;
            for (int k = 0; k < SIDE * SIDE; k++) {
                const int u = turn & 1 ? LAST - k % SIDE : k % SIDE,
                          v = turn & 2 ? LAST - k / SIDE : k / SIDE;
                const int x = turn & 4 ? v : u, y = turn & 4 ? u : v;
                stamp[k] = (float)(exp(-0.3 * (hypot(x - peak, y) + x - peak)) * 0.4);
                if (y == 0 && x == peak)
                    stamp[k] = 1;
                if ((y == 0 && x == peak + 2) || (x == 4 && y == 4))
                    stamp[k] = 0.95f;
                if (y == 1 && x == peak)
                    stamp[k] = 0.7f;
                if (y == 1 && x == peak + 1)
                    stamp[k] = 0.2f;
            }
            const double fwhm = fwhm_of(stamp, SIDE, &ellipticity);
            if (turn == 0) {
                first = fwhm;
                flat = ellipticity;
            }
            assert_near(fwhm, first, 1e-9);
            assert_near(ellipticity, flat, 1e-9);
        }
}

static void odd_shapes(void **state)
{
    float flat[25] = {0}, ellipse[31 * 31];
    assert_true(isnan(fwhm_of(flat, 5, NULL)));
    flat[12] = 1;
    assert_between(fwhm_of(flat, 5, NULL), 0.9, 1.6);
    for (int k = 0; k < 31 * 31; k++)
        ellipse[k] = (float)(pixel_gauss(k % 31 - 15, 8) * pixel_gauss(k / 31 - 15, 4));
    double ellipticity = 0;
    assert_near(fwhm_of(ellipse, 31, &ellipticity), sqrt(32), 0.08);
    assert_near(ellipticity, 0.5, 0.01);
    /* a second star elsewhere on the stamp is not part of the width */
    ellipse[3 * 31 + 3] = ellipse[15 * 31 + 15] * 0.9f;
    assert_near(fwhm_of(ellipse, 31, NULL), sqrt(32), 0.08);
}

static void moves(void **state)
{
    float stamp[25 * 25], work[25 * 25];
    for (int k = 0; k < 25 * 25; k++)
        stamp[k] = (float)(pixel_gauss(k % 25 - 12 - 0.3, 4) * pixel_gauss(k / 25 - 12 + 0.2, 4));
    double x, y;
    rx_stamp_centroid(stamp, 25, 4, &x, &y);
    assert_near(x, 0.3, 0.01);
    assert_near(y, -0.2, 0.006);
    rx_stamp_shift(stamp, 25, -0.3, 0.2, work);
    for (int k = 0; k < 25 * 25; k++)
        assert_near(stamp[k], pixel_gauss(k % 25 - 12, 4) * pixel_gauss(k / 25 - 12, 4), 6e-4);
    assert_near(fwhm_of(stamp, 25, NULL), sqrt(16 + 5.545177 / 12), 0.03);
}

/* Keys' cubic convolution (a = -1/2), the weighted centroid by its definition, and a shift by both. */
static void shifts_by_cubic_convolution(void **state)
{
    enum { SIDE = 21, CENTRE = SIDE / 2 };
    float stamp[SIDE * SIDE], moved[SIDE * SIDE], work[SIDE * SIDE];
    double w[4], wx[4], wy[4], sum = 0, sx = 0, sy = 0, dx = 0, dy = 0;
    rx_stamp_cubic(0.3, w);
    for (int i = 0; i < 4; i++) {
        const double x = fabs(0.3 - (i - 1));
        assert_near(w[i], x < 1 ? (1.5 * x - 2.5) * x * x + 1 : ((-0.5 * x + 2.5) * x - 4) * x + 2, 1e-15);
    }
    for (int k = 0; k < SIDE * SIDE; k++) {
        const double x = k % SIDE - 10.4, y = k / SIDE - 9.7;
        stamp[k] = (float)(0.2 + (1 + 0.3 * cos(x - y)) * exp(-0.1 * (x * x + y * y)));
        const double weight =
            exp(-4 * log(2) * (pow(k % SIDE - CENTRE, 2) + pow(k / SIDE - CENTRE, 2)) / 25) * stamp[k];
        sum += weight;
        sx += weight * (k % SIDE - CENTRE);
        sy += weight * (k / SIDE - CENTRE);
    }
    rx_stamp_centroid(stamp, SIDE, 5, &dx, &dy);
    assert_near(dx, 2 * sx / sum, 1e-12);
    assert_near(dy, 2 * sy / sum, 1e-12);
    memcpy(moved, stamp, sizeof moved);
    rx_stamp_shift(moved, SIDE, -0.3, 0.4, work); /* what was at x + 0.3, y - 0.4 */
    rx_stamp_cubic(0.3, wx);
    rx_stamp_cubic(0.6, wy);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            double value = 0;
            for (int k = 0; k < 16; k++) {
                const int u = x + k % 4 - 1, v = y - 1 + k / 4 - 1;
                if (u >= 0 && v >= 0 && u < SIDE && v < SIDE) /* nothing beyond */
                    value += wx[k % 4] * wy[k / 4] * stamp[v * SIDE + u];
            }
            assert_near(moved[y * SIDE + x], value, 1e-6);
        }
}

/* All pixels of a small stamp count, its corners too. */
static void the_centroid_sees_all_pixels(void **state)
{
    for (int lit = 0; lit < 9; lit++) {
        float stamp[9];
        double dx = 0, dy = 0, sum = 0, sx = 0, sy = 0;
        for (int k = 0; k < 9; k++) {
            const int x = k % 3 - 1, y = k / 3 - 1;
            stamp[k] = k == lit ? 3 : 1;
            sum += stamp[k] * exp2(-4.0 * (x * x + y * y) / 9);
            sx += x * stamp[k] * exp2(-4.0 * (x * x + y * y) / 9);
            sy += y * stamp[k] * exp2(-4.0 * (x * x + y * y) / 9);
        }
        rx_stamp_centroid(stamp, 3, 3, &dx, &dy);
        assert_near(dx, 2 * sx / sum, 1e-12);
        assert_near(dy, 2 * sy / sum, 1e-12);
    }
}

static void evaluates_and_copies(void **state)
{
    rx_psf *psf = sky_psf_varying(3, 0.2, 101), *copy = rx_psf_copy(psf);
    const int n = psf->size * psf->size;
    float *stamp = calloc((size_t)n, sizeof(float));
    rx_psf_at(copy, 100, 7, stamp);
    double sum = 0;
    for (int k = 0; k < n; k++) {
        assert_near(stamp[k], psf->basis[k] + psf->basis[n + k], 1e-7);
        sum += stamp[k];
    }
    assert_near(sum, 1, 1e-5);
    free(stamp);
    rx_psf_free(copy);
    rx_psf_free(psf);
    rx_psf *pixel = rx_stamp_gauss(0);
    assert_int_equal(pixel->type, RX_PSF_PIXEL);
    assert_int_equal(pixel->size, 1);
    assert_near(pixel->basis[0], 1, 0);
    rx_psf_free(pixel);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(widths),
                                       cmocka_unit_test(the_area_above_half_the_height),
                                       cmocka_unit_test(the_axes_of_the_area),
                                       cmocka_unit_test(turned_stamps),
                                       cmocka_unit_test(odd_shapes),
                                       cmocka_unit_test(moves),
                                       cmocka_unit_test(shifts_by_cubic_convolution),
                                       cmocka_unit_test(the_centroid_sees_all_pixels),
                                       cmocka_unit_test(evaluates_and_copies)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
