/* The curve and AP by hand, ties, and the bootstrap interval. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "quality/bootstrap.h"
#include "quality/pr.h"

#define BY ((rx_resampling){.seed = 5, .nthreads = 2})

static void by_hand_with_ties(void **state)
{
    /* in no order; 9 references; thresholds and sums worked out by hand */
    const double score[] = {0.1, 0.9, 0.5, 0.8, 0.7, 0.5, 0.8, 0.6, 0.5, 0.3};
    const unsigned char matched[] = {1, 1, 0, 1, 1, 1, 0, 0, 1, 0};
    const double recall[] = {1 / 9.0, 2 / 9.0, 3 / 9.0, 3 / 9.0, 5 / 9.0, 5 / 9.0, 6 / 9.0};
    const double precision[] = {1, 2 / 3.0, 3 / 4.0, 3 / 5.0, 5 / 8.0, 5 / 9.0, 6 / 10.0};
    rx_pr pr;
    (void)state;
    assert_int_equal(rx_pr_make(10, score, matched, 9, &pr, NULL), RX_OK);
    assert_int_equal(pr.n, 7);
    for (int i = 0; i < 7; i++) {
        assert_near(pr.point[i].recall, recall[i], 1e-15);
        assert_near(pr.point[i].precision, precision[i], 1e-15);
    }
    assert_near(pr.ap.value, 0.474074074074074, 1e-14);
    rx_pr_free(&pr);
}

static void perfect_and_worst(void **state)
{
    const double score[] = {3, 2, 1};
    const unsigned char all[] = {1, 1, 1}, none[] = {0, 0, 0};
    rx_pr pr;
    (void)state;
    assert_int_equal(rx_pr_make(3, score, all, 3, &pr, NULL), RX_OK);
    assert_near(pr.ap.value, 1, 1e-15);
    rx_pr_free(&pr);
    assert_int_equal(rx_pr_make(3, score, none, 3, &pr, NULL), RX_OK);
    assert_near(pr.ap.value, 0, 0);
    rx_pr_free(&pr);
    assert_int_equal(rx_pr_make(0, NULL, NULL, 3, &pr, NULL), RX_OK);
    assert_near(pr.ap.value, 0, 0);
    rx_pr_free(&pr);
    assert_int_equal(rx_pr_make(3, score, none, 0, &pr, NULL), RX_OK);
    assert_true(isnan(pr.ap.value));
    rx_pr_free(&pr);
}

/* Detections without a score come last, whatever they are. */
static void unknown_score_is_last(void **state)
{
    const double score[] = {NAN, -1e9};
    const unsigned char matched[] = {0, 1};
    rx_pr pr;
    (void)state;
    assert_int_equal(rx_pr_make(2, score, matched, 1, &pr, NULL), RX_OK);
    assert_near(pr.ap.value, 1, 1e-15);
    rx_pr_free(&pr);
}

static void interval(void **state)
{
    enum { N = 300, REFERENCES = 260 };
    double score[N];
    unsigned char matched[N];
    rx_estimate first, second, narrow;
    rx_pr pr;
    (void)state;
    for (int i = 0; i < N; i++) {
        score[i] = rx_random_uniform(3, 0, (uint64_t)i);
        matched[i] = rx_random_uniform(3, 1, (uint64_t)i) < 0.3 + 0.6 * score[i];
    }
    assert_int_equal(rx_pr_make(N, score, matched, REFERENCES, &pr, NULL), RX_OK);
    assert_int_equal(rx_pr_interval(&pr, REFERENCES, 0.95, BY, &first, NULL), RX_OK);
    assert_int_equal(rx_pr_interval(&pr, REFERENCES, 0.95, BY, &second, NULL), RX_OK);
    assert_int_equal(rx_pr_interval(&pr, REFERENCES, 0.6, BY, &narrow, NULL), RX_OK);
    assert_memory_equal(&first, &second, sizeof first);
    assert_true(first.low < first.value);
    assert_true(first.value < first.high);
    assert_true(first.low < narrow.low);
    assert_true(narrow.high < first.high);
    assert_true(first.high - first.low > 0.04);
    assert_true(first.high - first.low < 0.2);
    /* too few references to resample: no bound at all */
    assert_int_equal(rx_pr_interval(&pr, RX_BOOTSTRAP_FEWEST - 1, 0.95, BY, &narrow, NULL), RX_OK);
    assert_near(narrow.low, 0, 0);
    assert_near(narrow.high, 1, 0);
    rx_pr_free(&pr);
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
    uint32_t counts[500], sum = 0;
    rx_estimate e = {0};
    (void)state;
    for (int i = 0; i < 500; i++) {
        values[i] = rx_random_normal(4, 0, (uint64_t)i);
        mean += values[i] / 500;
        square += values[i] * values[i] / 500;
    }
    rx_bootstrap_counts(9, 1, 17, 500, counts);
    for (int i = 0; i < 500; i++)
        sum += counts[i];
    assert_int_equal(sum, 500);
    assert_int_equal(
        rx_bootstrap_interval((rx_resampling){9, 2, 1}, 500, weighted_mean, values, 0.95, &e, NULL), RX_OK);
    double half = 1.96 * sqrt((square - mean * mean) / 500);
    assert_near(e.low, mean - half, 0.15 * half);
    assert_near(e.high, mean + half, 0.15 * half);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(by_hand_with_ties),     cmocka_unit_test(perfect_and_worst),
        cmocka_unit_test(unknown_score_is_last), cmocka_unit_test(interval),
        cmocka_unit_test(bootstrap_of_a_mean),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
