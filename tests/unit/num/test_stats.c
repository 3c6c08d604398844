/* Robust statistics against sorting and against values that numpy gives. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "num/stats.h"

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void test_median_small(void **state)
{
    (void)state;
    float odd[] = {3.0F, 1.0F, 2.0F}, even[] = {4.0F, 1.0F, 3.0F, 2.0F}, one[] = {7.0F};
    assert_true(rx_median_float(odd, 3) == 2.0F);
    assert_true(rx_median_float(even, 4) == 2.5F);
    assert_true(rx_median_float(one, 1) == 7.0F);
    assert_true(isnan(rx_median_float(one, 0)));
    assert_true(isnan(rx_median(NULL, 0)));
    assert_true(isnan(rx_quantile(NULL, 0, 0.5)));
    float huge[] = {3e38F, 3e38F};
    assert_true(rx_median_float(huge, 2) == 3e38F);
}

/* Every length up to 200, with many ties, against a sorted copy. */
static void test_against_sorting(void **state)
{
    (void)state;
    for (size_t n = 1; n <= 200; n++)
        for (int kind = 0; kind < 4; kind++) {
            double v[200], sorted[200], scratch[200];
            float single[200];
            for (size_t i = 0; i < n; i++) {
                double u = rx_random_uniform(1, n, i);
                v[i] = kind == 0 ? u : kind == 1 ? floor(4.0 * u) : kind == 2 ? (double)i : (double)(n - i);
                single[i] = (float)v[i];
            }
            memcpy(sorted, v, sizeof v);
            qsort(sorted, n, sizeof *sorted, ascending);
            double expected = 0.5 * (sorted[n / 2] + sorted[(n - 1) / 2]);
            memcpy(scratch, v, sizeof v);
            assert_true(fabs(rx_median(scratch, n) - expected) < 1e-14 * (1.0 + expected));
            assert_true(fabs((double)rx_median_float(single, n) - expected) < 1e-6 * (1.0 + expected));
            for (int q = 0; q <= 8; q++) {
                double h = 0.125 * q * (double)(n - 1);
                size_t j = (size_t)h;
                double want = sorted[j];
                if (j + 1 < n)
                    want += (h - (double)j) * (sorted[j + 1] - sorted[j]);
                memcpy(scratch, v, sizeof v);
                assert_true(fabs(rx_quantile(scratch, n, 0.125 * q) - want) < 1e-12 * (1.0 + want));
            }
        }
}

/* numpy.quantile(v, q) and 1.4826 * median(|v - median(v)|) of these ten numbers. */
static void test_numpy_values(void **state)
{
    (void)state;
    const double v[10] = {2.5, -1.0, 7.25, 3.0, 100.0, 0.5, 4.75, -2.0, 3.5, 6.0};
    const double q[4] = {0.1, 0.25, 0.683, 0.9}, want[4] = {-1.1, 1.0, 4.93375, 16.525};
    double scratch[10], median;
    for (int i = 0; i < 4; i++) {
        memcpy(scratch, v, sizeof v);
        assert_true(fabs(rx_quantile(scratch, 10, q[i]) - want[i]) < 1e-12);
    }
    memcpy(scratch, v, sizeof v);
    assert_true(fabs(rx_sigma_mad(scratch, 10, &median) - 4.07715) < 1e-9);
    assert_true(fabs(median - 3.25) < 1e-12);
}

static void test_sigma_of_normal(void **state)
{
    (void)state;
    enum { N = 100000 };
    double *v = malloc(N * sizeof *v);
    assert_non_null(v);
    for (uint64_t i = 0; i < N; i++)
        v[i] = 10.0 + 3.0 * rx_random_normal(2, 0, i);
    assert_true(fabs(rx_sigma_mad(v, N, NULL) / 3.0 - 1.0) < 0.015);
    free(v);
}

/* Two outliers: the larger hides the smaller one from the first round of 3 sigma. */
static void test_clipped_mean(void **state)
{
    (void)state;
    double v[40], mean, sigma;
    size_t kept;
    for (int i = 0; i < 38; i++)
        v[i] = i % 2 ? 9.0 : 11.0;
    v[38] = 1000.0;
    v[39] = 60.0;
    rx_clipped_mean(v, 40, 3.0, &mean, &sigma, &kept);
    assert_int_equal(kept, 38);
    assert_true(fabs(mean - 10.0) < 1e-12 && fabs(sigma - 1.0) < 1e-12);
    rx_clipped_mean(v, 40, 100.0, &mean, &sigma, &kept);
    assert_int_equal(kept, 40);
    assert_true(fabs(mean - 36.0) < 1e-12);
    rx_clipped_mean(v, 1, 3.0, &mean, &sigma, &kept);
    assert_true(mean == 11.0 && sigma == 0.0 && kept == 1);
    rx_clipped_mean(NULL, 0, 3.0, &mean, &sigma, &kept);
    assert_true(isnan(mean) && isnan(sigma) && kept == 0);
    rx_clipped_mean(v, 40, 3.0, NULL, NULL, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_median_small), cmocka_unit_test(test_against_sorting),
        cmocka_unit_test(test_numpy_values), cmocka_unit_test(test_sigma_of_normal),
        cmocka_unit_test(test_clipped_mean),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
