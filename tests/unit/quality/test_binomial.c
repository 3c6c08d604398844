/* Intervals and ranks against scipy (beta.ppf, binom.cdf, binomtest), coverage by simulation. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "../near.h"
#include "base/random.h"
#include "quality/binomial.h"

static void interval_as_scipy(void **state)
{
    static const struct {
        long k, n;
        double level, low, high;
    } expected[] = {
        {9, 10, 0.95, 0.554983882972, 0.997471421456},
        {0, 10, 0.95, 0, 0.308497107819},
        {10, 10, 0.95, 0.691502892181, 1},
        {1, 2, 0.95, 0.0125791170934, 0.987420882907},
        {95, 100, 0.95, 0.887165088895, 0.983568120818},
        {500, 1000, 0.99, 0.458852553307, 0.541147446693},
        {999999, 1000000, 0.95, 0.999994428369, 0.999999974682},
        {123456, 200000, 0.9, 0.615488555549, 0.619068933722},
        {3, 7, 0.5, 0.253073975774, 0.621151559358},
    };
    (void)state;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        rx_estimate e = rx_binomial_interval(expected[i].k, expected[i].n, expected[i].level);
        assert_near(e.value, (double)expected[i].k / (double)expected[i].n, 1e-15);
        assert_near(e.low, expected[i].low, 1e-9);
        assert_near(e.high, expected[i].high, 1e-9);
        assert_int_equal(e.n, expected[i].n);
    }
    rx_estimate nothing = rx_binomial_interval(0, 0, 0.95);
    assert_true(isnan(nothing.value));
    assert_near(nothing.low, 0, 0);
    assert_near(nothing.high, 1, 0);
}

/* The promise of the exact interval: never below its level, summed over all outcomes. */
static void interval_covers(void **state)
{
    (void)state;
    for (int n = 1; n <= 40; n += 13)
        for (double p = 0.05; p < 1; p += 0.1) {
            double covered = 0;
            for (long k = 0; k <= n; k++) {
                rx_estimate e = rx_binomial_interval(k, n, 0.95);
                if (e.low <= p && p <= e.high)
                    covered += rx_binomial_below(k, n, p) - rx_binomial_below(k - 1, n, p);
            }
            assert_true(covered >= 0.95);
        }
}

static void median_rank_as_scipy(void **state)
{
    static const struct {
        long n;
        double level;
        long rank;
    } expected[] = {{0, 0.95, 0},      {1, 0.95, 0},      {5, 0.95, 0},          {5, 0.99, 0},
                    {6, 0.95, 1},      {6, 0.99, 0},      {10, 0.95, 2},         {10, 0.99, 1},
                    {25, 0.95, 8},     {25, 0.99, 6},     {100, 0.95, 40},       {100, 0.99, 37},
                    {1001, 0.95, 470}, {1001, 0.99, 460}, {100000, 0.95, 49690}, {100000, 0.99, 49593}};
    (void)state;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
        assert_int_equal(rx_median_rank(expected[i].n, expected[i].level), expected[i].rank);
}

static void mcnemar_as_scipy(void **state)
{
    (void)state;
    assert_near(rx_mcnemar(3, 10), 0.09228515625, 1e-12);
    assert_near(rx_mcnemar(10, 3), 0.09228515625, 1e-12);
    assert_near(rx_mcnemar(0, 5), 0.0625, 1e-12);
    assert_near(rx_mcnemar(100, 140), 0.0116640923177, 1e-10);
    assert_near(rx_mcnemar(7, 7), 1, 0);
    assert_near(rx_mcnemar(0, 0), 1, 0);
    assert_near(rx_mcnemar(1, 0), 1, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(interval_as_scipy),
        cmocka_unit_test(interval_covers),
        cmocka_unit_test(median_rank_as_scipy),
        cmocka_unit_test(mcnemar_as_scipy),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
