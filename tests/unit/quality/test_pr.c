/* The curve and AP by hand, ties, and the bootstrap interval. */
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "quality/pr.h"
#include "quality/statistics.h"

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

/* Detections without a score come last, whatever they are; without references there is no AP. */
static void ends(void **state)
{
    const double score[] = {NAN, -1e9};
    const unsigned char matched[] = {0, 1};
    rx_pr pr;
    (void)state;
    assert_int_equal(rx_pr_make(2, score, matched, 1, &pr, NULL), RX_OK);
    assert_near(pr.ap.value, 1, 1e-15);
    rx_pr_free(&pr);
    assert_int_equal(rx_pr_make(0, NULL, NULL, 3, &pr, NULL), RX_OK);
    assert_near(pr.ap.value, 0, 0);
    rx_pr_free(&pr);
    assert_int_equal(rx_pr_make(2, score, matched, 0, &pr, NULL), RX_OK);
    assert_true(isnan(pr.ap.value));
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
    assert_between(first.high - first.low, 0.04, 0.2);
    /* too few references to resample: no bound at all */
    assert_int_equal(rx_pr_interval(&pr, RX_BOOTSTRAP_FEWEST - 1, 0.95, BY, &narrow, NULL), RX_OK);
    assert_near(narrow.low, 0, 0);
    assert_near(narrow.high, 1, 0);
    rx_pr_free(&pr);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(by_hand_with_ties), cmocka_unit_test(ends),
                                       cmocka_unit_test(interval)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
