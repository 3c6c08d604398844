/* The curve and AP by hand, ties, and the bootstrap interval. */
#include <string.h>

#include "../near.h"
#include "quality/pr.h"
#include "quality/statistics.h"

static void by_hand_with_ties(void **state)
{
    /* in no order; 9 references; thresholds and sums worked out by hand */
    const double score[] = {0.1, 0.9, 0.5, 0.8, 0.7, 0.5, 0.8, 0.6, 0.5, 0.3};
    const unsigned char matched[] = {1, 1, 0, 1, 1, 1, 0, 0, 1, 0};
    const double recall[] = {1 / 9.0, 2 / 9.0, 3 / 9.0, 3 / 9.0, 5 / 9.0, 5 / 9.0, 6 / 9.0};
    const double precision[] = {1, 2 / 3.0, 3 / 4.0, 3 / 5.0, 5 / 8.0, 5 / 9.0, 6 / 10.0};
    rx_estimate e;
    rx_pr pr;
    (void)state;
    assert_int_equal(rx_pr_make(10, score, matched, 9, &pr, NULL), RX_OK);
    assert_int_equal(pr.n, 7);
    for (int i = 0; i < 7; i++) {
        assert_near(pr.point[i].recall, recall[i], 1e-15);
        assert_near(pr.point[i].precision, precision[i], 1e-15);
    }
    assert_near(pr.ap.value, 0.474074074074074, 1e-14);
    assert_int_equal(rx_pr_interval(&pr, 9, 0.95, (rx_resampling){.seed = 5}, &e, NULL), RX_OK);
    assert_near(e.low, 0, 0); /* too few references to resample: no bound at all */
    assert_near(e.high, 1, 0);
    assert_int_equal(rx_pr_interval(&pr, 40, 0.95, (rx_resampling){.seed = 5}, &e, NULL), RX_OK);
    assert_between(e.low, 0.01, pr.ap.value);
    assert_true(e.high < 0.9);
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(by_hand_with_ties), cmocka_unit_test(ends)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
