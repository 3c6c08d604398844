/* Intervals and tests against scipy and brute force.
 *
 * Samples, the same in python: a = [((i*37+11)%101)/7 ...], b = [((i*53+29)%103)/8 + i%3 ...]. */
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "quality/statistics.h"

enum { MOST = 1001 };

static void shares_as_scipy(void **state)
{
    static const struct {
        long k, n;
        double level, low, high;
    } expected[] = {
        {9, 10, 0.95, 0.554983882972, 0.997471421456},
        {0, 10, 0.95, 0, 0.308497107819},
        {10, 10, 0.95, 0.691502892181, 1},
        {500, 1000, 0.99, 0.458852553307, 0.541147446693},
        {999999, 1000000, 0.95, 0.999994428369, 0.999999974682},
        {123456, 200000, 0.9, 0.615488555549, 0.619068933722},
        {3, 7, 0.5, 0.253073975774, 0.621151559358},
    };
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

/* The promise of the exact intervals: never below their level, summed over all outcomes. */
static void intervals_cover(void **state)
{
    for (int n = 1; n <= 40; n += 13)
        for (double p = 0.05; p < 1; p += 0.1) {
            double covered = 0, probability = pow(1 - p, n);
            for (long k = 0; k <= n; k++) {
                const rx_estimate e = rx_binomial_interval(k, n, 0.95);
                covered += e.low <= p && p <= e.high ? probability : 0;
                probability *= (double)(n - k) / (double)(k + 1) * p / (1 - p);
            }
            assert_true(covered >= 0.95);
        }
    for (double mean = 0.1; mean < 30; mean *= 1.5) {
        double probability = exp(-mean), covered = 0, below = 0;
        for (long k = 0; k < 150; k++) {
            const rx_estimate e = rx_poisson_rate(k, 1, 0.9);
            covered += e.low <= mean && mean <= e.high ? probability : 0;
            below += mean <= rx_poisson_upper(k, 1, 0.9) ? probability : 0;
            probability *= mean / (double)(k + 1);
        }
        assert_true(covered >= 0.9 - 1e-12);
        assert_true(below >= 0.9 - 1e-12);
    }
}

/* scipy: chi2.ppf(t, 2k)/2, chi2.isf(t, 2k+2)/2 with t = (1-level)/2, and chi2.isf(1-level, 2k+2)/2. */
static void poisson_as_scipy(void **state)
{
    static const struct {
        long count;
        double level, low, high, upper;
    } expected[] = {
        {0, 0.95, 0, 3.68887945411394, 2.99573227355399},
        {1, 0.95, 0.0253178079842899, 5.5716433909389, 4.74386451839058},
        {3, 0.9, 0.817691447163953, 7.75365652793273, 6.68078306825586},
        {10, 0.6827, 6.89125205575691, 14.2670354646433, 12.2927900708623},
        {100, 0.95, 81.3639912509231, 121.626793792426, 118.079272782097},
        {12345, 0.99, 12060.6831323998, 12634.0850241564, 12605.9561543197},
        {1000000, 0.95, 998040.983340294, 1001961.91194543, 1001646.42276762},
    };
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        rx_estimate e = rx_poisson_rate(expected[i].count, 2, expected[i].level);
        assert_near(2 * e.value, (double)expected[i].count, 0);
        assert_close(2 * e.low, expected[i].low, 1e-12);
        assert_close(2 * e.high, expected[i].high, 1e-12);
        assert_close(2 * rx_poisson_upper(expected[i].count, 2, expected[i].level), expected[i].upper, 1e-12);
    }
    assert_true(isnan(rx_poisson_upper(-1, 1, 0.95)));
    assert_true(isnan(rx_poisson_rate(3, 1, 1).high));
}

/* Ranks as scipy's binom.cdf has them: the interval of the median of 0, 1 ... n - 1, without ends where n is too small. */
static void medians(void **state)
{
    static const struct {
        long n;
        double level;
        long rank;
    } expected[] = {{1, 0.95, 0},  {5, 0.95, 0},    {6, 0.95, 1},    {6, 0.99, 0},      {10, 0.95, 2},
                    {25, 0.99, 6}, {100, 0.95, 40}, {100, 0.99, 37}, {1001, 0.95, 470}, {1001, 0.99, 460}};
    double values[MOST], few[] = {9, 1, 4, 2, 8, 3, 7, 2, 5, 1};
    rx_estimate median, sigma;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        const long n = expected[i].n, rank = expected[i].rank;
        for (long k = 0; k < n; k++)
            values[k] = (double)(n - 1 - k);
        rx_robust_estimates(values, n, expected[i].level, &median, &sigma);
        assert_near(median.value, 0.5 * (double)(n - 1), 0);
        assert_true(rank > 0 ? median.low == (double)(rank - 1) && median.high == (double)(n - rank)
                             : isinf(median.low) && isinf(median.high));
    }
    /* numpy: median 3.5; scipy: median_abs_deviation 2 */
    rx_robust_estimates(few, 10, 0.95, &median, &sigma);
    assert_near(median.value, 3.5, 1e-15);
    assert_near(sigma.value, 1.4826 * 2, 1e-12);
    assert_near(sigma.low, 1.4826 * 0.5, 1e-12);
    assert_near(sigma.high, 1.4826 * 4.5, 1e-12);
    rx_robust_estimates(few, 0, 0.95, &median, &sigma);
    assert_true(isnan(median.value));
    assert_true(isnan(sigma.value));
}

static void fill_a(long n, double shift, double *dst)
{
    for (long i = 0; i < n; i++)
        dst[i] = (double)((i * 37 + 11) % 101) / 7 + shift;
}

static void fill_b(long n, double *dst)
{
    for (long i = 0; i < n; i++)
        dst[i] = (double)((i * 53 + 29) % 103) / 8 + (double)(i % 3);
}

/* scipy.stats.ttest_rel(x, y).confidence_interval(), x = a(n) + shift: t intervals of the means of differences. */
static void mean_as_scipy(void **state)
{
    static const struct {
        long n;
        double shift, low, high;
    } cases[] = {{70, 3, 1.522452784193601, 4.01071048111252},
                 {2, 0, -18.08493589707683, 11.63850732564825},
                 {400, 1, 0.2095360164354734, 1.301178269278812}};
    double a[MOST], b[MOST];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        fill_a(i == 2 ? 1000 : cases[i].n, cases[i].shift, a);
        fill_b(i == 1 ? 3 : cases[i].n, b);
        for (long k = 0; k < cases[i].n; k++)
            a[k] -= b[k];
        const rx_estimate mean = rx_mean_estimate(cases[i].n, a, 0.95);
        assert_near(mean.low, cases[i].low, 1e-8);
        assert_near(mean.high, cases[i].high, 1e-8);
        assert_int_equal(mean.n, cases[i].n);
    }
    for (long k = 0; k < 20; k++) /* values that agree but for rounding have no spread */
        a[k] = 0.1;
    const rx_estimate even = rx_mean_estimate(20, a, 0.95);
    assert_near(even.high - even.low, 0, 0);
    assert_true(isnan(rx_mean_estimate(0, a, 0.95).value));
    assert_true(isnan(rx_mean_estimate(1, a, 0.95).low));
}

/* matplotlib.cbook.boxplot_stats(a(70)**2), which takes numpy's quartiles; and values far out. */
static void box_as_matplotlib(void **state)
{
    static const double far[] = {1, 2, 2.5, 3, 3.5, 4, 50, -40};
    double a[70];
    rx_five_numbers box;
    fill_a(70, 0, a);
    for (long k = 0; k < 70; k++)
        a[k] *= a[k];
    assert_int_equal(rx_five_numbers_of(70, a, &box, NULL), RX_OK);
    assert_near(box.low, 0, 1e-12);
    assert_near(box.q1, 12.265306122449, 1e-12);
    assert_near(box.median, 49.0204081632653, 1e-12);
    assert_near(box.q3, 111.005102040816, 1e-12);
    assert_near(box.high, 204.081632653061, 1e-12);
    assert_near(box.mean, 67.4644314868805, 1e-12);
    assert_int_equal(rx_five_numbers_of(8, far, &box, NULL), RX_OK);
    assert_near(box.low, 1, 0);
    assert_near(box.high, 4, 0);
    assert_near(box.q1, 1.75, 1e-15);
}

static double weighted_mean(const void *data, const uint32_t *counts)
{
    const double *values = data;
    double sum = 0;
    for (int i = 0; i < 500; i++)
        sum += counts[i] * values[i];
    return sum / 500;
}

/* The bootstrap interval of a mean is known: 1.96 sigma / sqrt(n). */
static void bootstrap_of_a_mean(void **state)
{
    double values[500], mean = 0, square = 0;
    rx_estimate e = {0};
    for (int i = 0; i < 500; i++) {
        values[i] = rx_random_normal(4, 0, (uint64_t)i);
        mean += values[i] / 500;
        square += values[i] * values[i] / 500;
    }
    assert_int_equal(
        rx_bootstrap_interval((rx_resampling){9, 2, 1}, 500, weighted_mean, values, 0.95, &e, NULL), RX_OK);
    double half = 1.96 * sqrt((square - mean * mean) / 500);
    assert_near(e.low, mean - half, 0.15 * half);
    assert_near(e.high, mean + half, 0.15 * half);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shares_as_scipy),     cmocka_unit_test(intervals_cover),
        cmocka_unit_test(poisson_as_scipy),    cmocka_unit_test(medians),
        cmocka_unit_test(mean_as_scipy),       cmocka_unit_test(box_as_matplotlib),
        cmocka_unit_test(bootstrap_of_a_mean),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
