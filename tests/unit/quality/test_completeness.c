/* Completeness magnitudes: hand-made bins, limits, and the truth of a simulated error function. */

#include "../near.h"
#include "base/random.h"
#include "quality/metrics.h"

static const rx_bins bins = {.n = 5, .edge = {18, 19, 20, 21, 22, 23}};

/* Of references of these magnitudes, found or not: the magnitude of 50 or 90 %. */
static rx_estimate depth_of(const rx_bins *in, long n, double *mag, const unsigned char *found,
                            rx_metric metric)
{
    unsigned char role[1000];
    const rx_qa_run run = {.name = "A"};
    const rx_qa_input input = {.truth = {.n = n}};
    const rx_evaluation e = {
        .input = &input, .run = &run, .bins = *in, .truth_mag = mag, .truth_role = role, .level = 0.95};
    rx_estimate m[RX_METRIC_COUNT];
    for (long i = 0; i < n; i++)
        role[i] = found[i] ? RX_ROLE_MATCHED : RX_ROLE_UNMATCHED;
    assert_int_equal(rx_metrics_measure(&e, (rx_mag_range){.whole = 1}, 0.95,
                                        (rx_resampling){.seed = 3, .nthreads = 2}, metric, m, NULL),
                     RX_OK);
    return m[metric];
}

/* found[i] of total[i] references, all of magnitude mag[i]. */
static rx_estimate of_counts(int n, const double *mag, const int *found, const int *total, double share)
{
    double m[200];
    unsigned char f[200];
    long all = 0;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < total[i]; k++, all++) {
            m[all] = mag[i];
            f[all] = k < found[i];
        }
    return depth_of(&bins, all, m, f, share < 0.7 ? RX_METRIC_MAG50 : RX_METRIC_MAG90);
}

static void interpolates(void **state)
{
    const double mag[] = {18.5, 19.5, 20.5, 21.5, 22.5};
    const int total[] = {10, 10, 10, 10, 10}, falls[] = {10, 8, 6, 2, 0}, dips[] = {10, 4, 8, 2, 0};
    assert_near(of_counts(5, mag, falls, total, 0.5).value, 20.5 + 0.1 / 0.4, 1e-9);
    assert_near(of_counts(5, mag, falls, total, 0.9).value, 18.5 + 0.1 / 0.2, 1e-9);
    /* a rise is levelled: 0.4 and 0.8 are 0.6 twice */
    assert_near(of_counts(5, mag, dips, total, 0.5).value, 20.5 + 0.1 / 0.4, 1e-9);
    assert_near(of_counts(5, mag, dips, total, 0.9).value, 18.5 + 0.1 / 0.4, 1e-9);
}

/* Steep curves, few references, wide bins of the tables: neither biased nor surer than it may be. */
static void holds_the_truth(void **state)
{
    enum { ROUNDS = 120 };
    static const int sizes[] = {100, 400, 1000};
    static const rx_bins wide = {.n = 3, .edge = {-3, -1.5, 0, 1.5}};
    static double mag[1000];
    static unsigned char found[1000];
    const double truth = 0.12 * log(0.985 / 0.9 - 1); /* 0.985 / (1 + exp(m / 0.12)) = 0.9 */
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        double sum = 0, inside = 0;
        for (uint64_t round = 0; round < ROUNDS; round++) {
            rx_estimate e;
            for (int i = 0; i < sizes[s]; i++) {
                mag[i] = -3 + 4.5 * rx_random_uniform(7 + s, round, 2 * (uint64_t)i);
                found[i] =
                    rx_random_uniform(7 + s, round, 2 * (uint64_t)i + 1) < 0.985 / (1 + exp(mag[i] / 0.12));
            }
            e = depth_of(&wide, sizes[s], mag, found, RX_METRIC_MAG90);
            sum += e.value / ROUNDS;
            inside += (e.low <= truth && truth <= e.high) / (double)ROUNDS;
        }
        assert_near(sum, truth, 0.05);
        assert_true(inside >= 0.8); /* percentile intervals are a little short, statistics.h */
    }
}

/* What is complete to the end of the reference has a lower limit, and no upper one. */
static void open_interval(void **state)
{
    double mag[100];
    unsigned char found[100];
    rx_estimate e;
    for (int i = 0; i < 100; i++) {
        mag[i] = 18 + 0.05 * i;
        found[i] = 1;
    }
    e = depth_of(&bins, 100, mag, found, RX_METRIC_MAG90);
    assert_near(e.value, 23, 1e-9);
    assert_true(e.low > 22.5);
    assert_true(isinf(e.high));
    assert_true(e.high > 0);
    for (int i = 0; i < 100; i++)
        found[i] = 0;
    e = depth_of(&bins, 100, mag, found, RX_METRIC_MAG90);
    assert_near(e.value, 18, 1e-9);
    assert_true(e.high < 18.5);
    assert_true(isinf(e.low));
    assert_true(e.low < 0);
    e = depth_of(&bins, 3, mag, found, RX_METRIC_MAG90);
    assert_true(isnan(e.value));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(interpolates),
        cmocka_unit_test(open_interval),
        cmocka_unit_test(holds_the_truth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
