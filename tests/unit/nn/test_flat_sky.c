/* What the flat sky takes and what it leaves. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "nn/flat_sky.h"

enum { W = 61, H = 47, N = W * H, REACH = 3 };
static const double FWHM = 2.4; /* that has this reach, and t = 1 */

/* Waves of a tenth of a sigma, and stars: Gaussians of FWHM 2 pixels. */
static void make(float *v, int stars, double flux)
{
    for (int k = 0; k < N; k++)
        v[k] = (float)(0.05 * rx_random_normal(1, 2, (uint64_t)k));
    const double s = 2 / 2.3548200450309493;
    for (int i = 0; i < stars; i++)
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++) {
                const double dx = x - (10 + 20 * i), dy = y - 23;
                v[y * W + x] += (float)(flux / (2 * M_PI * s * s) * exp(-(dx * dx + dy * dy) / (2 * s * s)));
            }
}

static void test_empty_sky_is_zero(void **state)
{
    (void)state;
    float v[N], scratch[N];
    make(v, 0, 0);
    rx_flat_sky(W, H, FWHM, 2, v, scratch);
    for (int k = 0; k < N; k++)
        assert_true(v[k] == 0);
}

/* A star whose peak stands above t keeps every pixel near it, to the bit, and with them all its flux. */
static void test_stars_keep_their_tails(void **state)
{
    (void)state;
    float before[N], v[N], scratch[N];
    make(before, 3, 10);
    memcpy(v, before, sizeof v);
    rx_flat_sky(W, H, FWHM, 1, v, scratch);
    double sum = 0, all = 0;
    for (int i = 0; i < 3; i++)
        for (int dy = -3; dy <= 3; dy++)
            for (int dx = -3; dx <= 3; dx++) {
                const int k = (23 + dy) * W + 10 + 20 * i + dx;
                assert_true(v[k] == before[k]);
            }
    for (int k = 0; k < N; k++)
        sum += v[k];
    for (int k = 0; k < N; k++)
        all += v[k] != 0;
    assert_true(fabs(sum / 30 - 1) < 0.2); /* waves around the stars are left */
    assert_true(all < N / 2);
}

/* Continuous: a change of 1e-6 somewhere changes nothing by more than some 1e-6. */
static void test_small_changes_stay_small(void **state)
{
    (void)state;
    float a[N], b[N], scratch[N];
    make(a, 3, 3); /* peaks around t */
    for (int k = 0; k < N; k++)
        b[k] = a[k] + 1e-6f * (float)((k * 7) % 3 - 1);
    rx_flat_sky(W, H, FWHM, 1, a, scratch);
    rx_flat_sky(W, H, FWHM, 3, b, scratch);
    for (int k = 0; k < N; k++)
        assert_true(fabsf(a[k] - b[k]) < 1e-5f);
}

/* Against the definition, at every place, borders included; the number of threads does not matter. */
static void test_definition(void **state)
{
    (void)state;
    float before[N], v[N], other[N], scratch[N];
    make(before, 2, 2.8);
    memcpy(v, before, sizeof v);
    memcpy(other, before, sizeof v);
    rx_flat_sky(W, H, FWHM, 1, v, scratch);
    rx_flat_sky(W, H, FWHM, 3, other, scratch);
    assert_memory_equal(v, other, sizeof v);
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            double m = -1e30;
            for (int j = -REACH; j <= REACH; j++)
                for (int i = -REACH; i <= REACH; i++)
                    if (y + j >= 0 && y + j < H && x + i >= 0 && x + i < W)
                        m = fmax(m, before[(y + j) * W + x + i]);
            const double u = fmin(1, fmax(0, (m - 0.5) / 0.5)), g = u * u * (3 - 2 * u);
            assert_true(fabs(v[y * W + x] - g * before[y * W + x]) < 1e-6);
        }
}

/* 1.25 FWHM rounded up, whatever that is; 1 sigma, up to 2 where hardly anything is blurred. */
static void test_reach_and_level(void **state)
{
    (void)state;
    assert_int_equal(rx_flat_sky_reach(FWHM), REACH);
    assert_true(rx_flat_sky_level(FWHM) == 1 && rx_flat_sky_level(8) == 1);
    assert_true(fabsf(rx_flat_sky_level(2.15) - 1.5f) < 1e-6f && rx_flat_sky_level(1) == 2);
    assert_true(rx_flat_sky_level(NAN) >= 1);
    assert_int_equal(rx_flat_sky_reach(2.5), 4);
    assert_int_equal(rx_flat_sky_reach(4), 5);
    assert_int_equal(rx_flat_sky_reach(0.1), 2);
    assert_int_equal(rx_flat_sky_reach(1e300), 16);
    assert_int_equal(rx_flat_sky_reach(NAN), 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_empty_sky_is_zero),        cmocka_unit_test(test_stars_keep_their_tails),
        cmocka_unit_test(test_small_changes_stay_small), cmocka_unit_test(test_definition),
        cmocka_unit_test(test_reach_and_level),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
