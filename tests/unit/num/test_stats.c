/* Robust statistics against sorting and against values that numpy gives. */
#include "../near.h"

#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "num/stats.h"

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

enum { MOST = 1202 };

/* Every length up to 200 and some beyond, with many ties, against a sorted copy. */
static void test_against_sorting(void **state)
{
    for (size_t n = 1; n <= MOST; n += n < 200 ? 1 : 167)
        for (int kind = 0; kind < 4; kind++) {
            double v[MOST], sorted[MOST], scratch[MOST];
            for (size_t i = 0; i < n; i++) {
                double u = rx_random_uniform(1, n, i);
                v[i] = kind == 0 ? u : kind == 1 ? floor(4.0 * u) : kind == 2 ? (double)i : (double)(n - i);
            }
            memcpy(sorted, v, sizeof v);
            qsort(sorted, n, sizeof *sorted, ascending);
            memcpy(scratch, v, sizeof v);
            rx_sort(scratch, n);
            assert_memory_equal(scratch, sorted, n * sizeof *sorted);
            double expected = 0.5 * (sorted[n / 2] + sorted[(n - 1) / 2]);
            memcpy(scratch, v, sizeof v);
            assert_true(fabs(rx_median(scratch, n) - expected) < 1e-14 * (1.0 + expected));
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

/* Meaningless, but an answer. */
static void test_nan_ends(void **state)
{
    double values[3000];
    for (int first = 0; first < 3000; first += 97) {
        for (int i = 0; i < 3000; i++)
            values[i] = i == first || i % 300 == 0 ? NAN : (double)(i * 7919 % 3001);
        rx_median(values, 3000);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_nan_ends),
                                       cmocka_unit_test(test_against_sorting),
                                       cmocka_unit_test(test_numpy_values)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
