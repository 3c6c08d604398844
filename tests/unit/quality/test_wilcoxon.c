/* Wilcoxon's test against scipy, all sign patterns and all pairs. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "../near.h"
#include "base/random.h"
#include "num/stats.h"
#include "quality/hypothesis.h"

enum { MOST = 1000 };

/* x = [((i*37+11)%101)/7 + i*i/1000003 ...] + shift, without the second term and rounded to quarters for
 * ties; y = [((i*53+29)%103)/8 + i%3 ...], for ties round(7y)/7 rounded to quarters; the first `zeros` equal.
 */
static void fill(long n, double shift, int ties, int zeros, double *x, double *y)
{
    for (long i = 0; i < n; i++) {
        x[i] = (double)((i * 37 + 11) % 101) / 7 + (ties ? 0 : (double)(i * i) / 1000003) + shift;
        y[i] = (double)((i * 53 + 29) % 103) / 8 + (double)(i % 3);
        if (ties) {
            x[i] = rint(4 * x[i]) / 4;
            y[i] = rint(4 * (rint(7 * y[i]) / 7)) / 4;
        }
        if (i < zeros)
            x[i] = y[i];
    }
}

/* d = x - y; d = d[d != 0]; scipy.stats.wilcoxon(d, correction=True, method='exact' for up to 50 without
 * ties, else 'approx'); effect from scipy.stats.rankdata(abs(d)). */
static void as_scipy(void **state)
{
    static const struct {
        long n;
        double shift;
        int ties, zeros;
        double w, used, p, effect;
    } expected[] = {
        {10, 3, 0, 0, 22, 10, 0.625, 0.2},
        {50, 1, 0, 0, 598, 50, 0.7089524432753507, 0.06196078431372549},
        {51, 1, 0, 0, 607, 51, 0.6029050822891624, 0.08446455505279035},
        {200, 2, 0, 0, 6658, 200, 3.500302381386409e-05, 0.3375124378109453},
        {30, 1, 1, 0, 174, 29, 0.3523491901876842, 0.2},
        {60, 1, 1, 1, 688.5, 58, 0.1972101902478623, 0.1952074810052601},
        {40, 0.5, 0, 5, 300, 35, 0.8145777874160558, 0.04761904761904762},
    };
    double x[MOST], y[MOST];
    rx_test test, back;
    (void)state;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        long n = expected[i].n;
        fill(n, expected[i].shift, expected[i].ties, expected[i].zeros, x, y);
        assert_int_equal(rx_test_wilcoxon(n, x, y, &test, NULL), RX_OK);
        assert_near(test.statistic, expected[i].w, 0);
        assert_near(test.dof, expected[i].used, 0);
        assert_near(test.p, expected[i].p, 1e-13);
        assert_near(test.ln_p, log(test.p), 1e-12);
        assert_near(test.effect, expected[i].effect, 1e-14);
        assert_int_equal(rx_test_wilcoxon(n, y, x, &back, NULL), RX_OK);
        assert_near(back.p, test.p, 0);
        assert_near(back.effect, -test.effect, 0);
        assert_near(back.difference.value, -test.difference.value, 1e-14);
        assert_near(back.difference.low, -test.difference.high, 1e-14);
    }
}

/* Far out in the tail: scipy.special.log_ndtr(z) + log 2, z = (-n(n+1)/4 + 1/2) / sqrt(n(n+1)(2n+1)/24). */
static void far_tail(void **state)
{
    double x[MOST], y[MOST];
    rx_test test;
    (void)state;
    for (int i = 0; i < MOST; i++) {
        x[i] = i + 1;
        y[i] = 0.25;
    }
    assert_int_equal(rx_test_wilcoxon(MOST, x, y, &test, NULL), RX_OK);
    assert_near(test.statistic, 0, 0);
    assert_near(test.ln_p, -378.72331108005926, 1e-9);
    assert_near(test.effect, 1, 0);
}

/* p of every rank sum from all 2^10 sign patterns. */
static void exact_by_enumeration(void **state)
{
    enum { N = 10 };
    (void)state;
    for (unsigned pattern = 0; pattern < 1u << N; pattern += 37) {
        double x[N], y[N] = {0};
        int sum = 0, all = N * (N + 1) / 2, as_extreme = 0;
        for (int i = 0; i < N; i++) {
            int positive = pattern >> i & 1;
            x[i] = positive ? i + 1 : -(i + 1);
            sum += positive ? i + 1 : 0;
        }
        int smaller = sum < all - sum ? sum : all - sum;
        for (unsigned other = 0; other < 1u << N; other++) {
            int s = 0;
            for (int i = 0; i < N; i++)
                s += other >> i & 1 ? i + 1 : 0;
            as_extreme += s <= smaller || all - s <= smaller;
        }
        rx_test test;
        assert_int_equal(rx_test_wilcoxon(N, x, y, &test, NULL), RX_OK);
        assert_near(test.statistic, smaller, 0);
        assert_near(test.p, as_extreme / 1024.0, 1e-15);
    }
}

/* All means of pairs, sorted; ranks of the interval as R's qsignrank(0.025, n) has them. */
static void median_of_all_pairs(void **state)
{
    static const long cases[][2] = {{6, 1}, {10, 9}, {20, 53}, {50, 435}, {5, 0}, {1, 0}};
    static double pair[MOST * (MOST + 1) / 2];
    double x[MOST], y[MOST];
    (void)state;
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++)
        for (int ties = 0; ties < 2; ties++) {
            long n = cases[c][0], rank = cases[c][1];
            size_t m = 0;
            rx_test test;
            fill(n, -1, ties, ties, x, y);
            for (long i = 0; i < n; i++)
                for (long j = i; j < n; j++)
                    pair[m++] = 0.5 * (x[i] - y[i]) + 0.5 * (x[j] - y[j]);
            rx_sort(pair, m);
            assert_int_equal(rx_test_wilcoxon(n, x, y, &test, NULL), RX_OK);
            assert_near(test.difference.value, 0.5 * (pair[(m - 1) / 2] + pair[m / 2]), 1e-14);
            assert_int_equal(test.difference.n, n);
            if (rank == 0) {
                assert_true(isinf(test.difference.low));
                assert_true(isinf(test.difference.high));
                continue;
            }
            assert_near(test.difference.low, pair[rank - 1], 0);
            assert_near(test.difference.high, pair[m - (size_t)rank], 0);
        }
}

/* The interval of the median holds the shift in 95 % of cases, exact and normal alike. */
static void interval_covers(void **state)
{
    enum { TRIALS = 1000 };
    static const int sizes[] = {12, 80};
    (void)state;
    for (size_t k = 0; k < 2; k++) {
        int covered = 0;
        for (uint64_t trial = 0; trial < TRIALS; trial++) {
            double x[80], y[80];
            rx_test test;
            for (uint64_t i = 0; i < (uint64_t)sizes[k]; i++) {
                y[i] = rx_random_uniform(11, trial, i);
                x[i] = y[i] + 0.5 + rx_random_normal(12 + k, trial, i);
            }
            assert_int_equal(rx_test_wilcoxon(sizes[k], x, y, &test, NULL), RX_OK);
            covered += test.difference.low <= 0.5 && 0.5 <= test.difference.high;
        }
        assert_in_range(covered, 930, 970);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_scipy),
        cmocka_unit_test(far_tail),
        cmocka_unit_test(exact_by_enumeration),
        cmocka_unit_test(median_of_all_pairs),
        cmocka_unit_test(interval_covers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
