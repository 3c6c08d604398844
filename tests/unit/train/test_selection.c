/* Eq. 4: counts per bin, and the order of an epoch. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "train/selection.h"

static const double FWHM[2] = {2.0, 8.0}, SIGMA[2] = {1.0, 15.0};

static rx_selection begin(int nfwhm, int nsigma, int total, int active)
{
    rx_selection s;
    assert_int_equal(rx_selection_begin((const int[]){nfwhm, nsigma}, FWHM, SIGMA, total, active, &s, NULL),
                     RX_OK);
    return s;
}

static void test_equation(void **state)
{
    (void)state;
    rx_selection s = begin(2, 2, 110, 1);
    for (int b = 0; b < 4; b++) {
        assert_int_equal(s.train[b], 50);
        assert_int_equal(s.test[b], 60);
        assert_true(s.list[b] == 0.5);
        assert_true(isnan(s.loss[b]));
    }
    /* means 0.5, 2.5, 1.5, 0: median 1, lists 0.25, 1, 0.75, 0 */
    const double sum[4] = {5.0, 25.0, 15.0, 0.0};
    const long count[4] = {10, 10, 10, 10};
    rx_selection_update(&s, sum, count);
    const int train[4] = {25, 100, 75, 0}, test[4] = {85, 10, 35, 110};
    for (int b = 0; b < 4; b++) {
        assert_int_equal(s.train[b], train[b]);
        assert_int_equal(s.test[b], test[b]);
    }
    assert_true(fabs(s.list[0] - 0.25) < 1e-15);
    assert_true(s.list[1] == 1.0);
    assert_true(s.loss[2] == 1.5);
}

static void test_bins_without_a_mean_keep_their_list(void **state)
{
    (void)state;
    rx_selection s = begin(3, 1, 50, 1);
    rx_selection_update(&s, (const double[]){1.0, 4.0, 2.0}, (const long[]){1, 1, 1});
    rx_selection_update(&s, (const double[]){NAN, 0.0, 3.0}, (const long[]){2, 0, 3});
    assert_true(s.list[0] == 0.25);
    assert_true(s.list[1] == 1.0);
    assert_true(s.list[2] == 0.5);
    assert_true(s.loss[0] == 1.0);
    assert_true(s.loss[1] == 4.0);
    assert_true(s.loss[2] == 1.0);
    rx_selection before = s;
    rx_selection_update(&s, (const double[]){NAN, INFINITY, 1.0}, (const long[]){1, 1, 0});
    assert_memory_equal(s.train, before.train, sizeof s.train);
    rx_selection_update(&s, (const double[]){0.0, 0.0, 0.0}, (const long[]){1, 1, 1});
    for (int b = 0; b < 3; b++) /* nothing is worst where nothing is wrong */
    {
        assert_true(s.list[b] == before.list[b]);
        assert_true(s.loss[b] == 0.0);
    }
}

static void test_uniform(void **state)
{
    (void)state;
    rx_selection s = begin(2, 1, 41, 0);
    rx_selection_update(&s, (const double[]){1.0, 9.0}, (const long[]){1, 1});
    assert_true(s.list[0] != s.list[1]); /* the dictionary is kept, it is only not obeyed */
    for (int b = 0; b < 2; b++) {
        assert_int_equal(s.train[b], 28);
        assert_int_equal(s.test[b], 13);
    }
}

static void test_invariants(void **state)
{
    (void)state;
    for (int total = 12; total < 400; total += 37)
        for (uint64_t trial = 0; trial < 50; trial++) {
            rx_selection s = begin(5, 5, total, 1);
            double sum[25];
            long count[25], most = 0;
            for (int b = 0; b < 25; b++) {
                sum[b] = exp(3.0 * rx_random_normal(1, trial, (uint64_t)b));
                count[b] = 1;
            }
            rx_selection_update(&s, sum, count);
            for (int b = 0; b < 25; b++) {
                assert_int_equal(s.train[b] + s.test[b], total);
                assert_true(s.test[b] >= RX_TEST_LEAST);
                assert_true(s.train[b] >= 0);
                assert_true(fabs(s.train[b] - (total - 10) * s.list[b]) <= 0.5 + 1e-9);
                most = s.train[b] > most ? s.train[b] : most;
            }
            assert_int_equal(most, total - 10);
        }
}

static void test_limits_of_bins(void **state)
{
    (void)state;
    rx_selection s = begin(5, 4, 40, 1);
    double covered = 0.0;
    for (int b = 0; b < s.nbins; b++) {
        double fwhm[2], sigma[2];
        rx_selection_bin(&s, b, fwhm, sigma);
        assert_true(fabs(fwhm[0] - (2.0 + 1.2 * (b % 5))) < 1e-12);
        assert_true(fabs(sigma[0] - (1.0 + 3.5 * (b / 5))) < 1e-12);
        covered += (fwhm[1] - fwhm[0]) * (sigma[1] - sigma[0]);
        if (b == s.nbins - 1) {
            assert_true(fwhm[1] == 8.0);
            assert_true(sigma[1] == 15.0);
        }
    }
    assert_true(fabs(covered - 6.0 * 14.0) < 1e-9);
}

static void test_order(void **state)
{
    (void)state;
    rx_selection s = begin(3, 2, 60, 1);
    rx_selection_update(&s, (const double[]){1, 2, 3, 4, 5, 0}, (const long[]){1, 1, 1, 1, 1, 1});
    rx_pick *order, *again, *next, *other;
    long n, m, expected = 0;
    int seen[6][60] = {{0}};
    for (int b = 0; b < 6; b++)
        expected += s.train[b];
    assert_int_equal(rx_selection_order(&s, 7, 3, &order, &n, NULL), RX_OK);
    assert_int_equal(n, expected);
    for (long i = 0; i < n; i++) {
        assert_true(order[i].bin < 6);
        assert_true(order[i].index < (uint32_t)s.train[order[i].bin]);
        assert_int_equal(seen[order[i].bin][order[i].index]++, 0);
    }
    assert_int_equal(rx_selection_order(&s, 7, 3, &again, &m, NULL), RX_OK);
    assert_memory_equal(order, again, (size_t)n * sizeof *order);
    assert_int_equal(rx_selection_order(&s, 7, 4, &next, &m, NULL), RX_OK);
    assert_memory_not_equal(order, next, (size_t)n * sizeof *order);
    assert_int_equal(rx_selection_order(&s, 8, 3, &other, &m, NULL), RX_OK);
    assert_memory_not_equal(order, other, (size_t)n * sizeof *order);
    free(order);
    free(again);
    free(next);
    free(other);
}

/* Each image is as likely in each place: chi^2 of 12 images in 12 places over 6000 epochs, 121 degrees of
 * freedom, mean 121 and width 15.6. */
static void test_order_is_even(void **state)
{
    (void)state;
    rx_selection s = begin(1, 1, 34, 1);
    double hits[12][12] = {{0.0}}, chi2 = 0.0;
    for (uint32_t epoch = 0; epoch < 6000; epoch++) {
        rx_pick *order;
        long n;
        assert_int_equal(rx_selection_order(&s, 5, epoch, &order, &n, NULL), RX_OK);
        assert_int_equal(n, 12);
        for (long i = 0; i < n; i++)
            hits[i][order[i].index] += 1.0;
        free(order);
    }
    for (int i = 0; i < 12; i++)
        for (int j = 0; j < 12; j++)
            chi2 += (hits[i][j] - 500.0) * (hits[i][j] - 500.0) / 500.0;
    assert_true(fabs(chi2 - 121.0) < 5.0 * 15.6);
}

static void test_errors(void **state)
{
    (void)state;
    rx_selection s;
    const double turned[2] = {8.0, 2.0}, negative[2] = {-1.0, 2.0}, nan[2] = {NAN, 2.0};
    assert_int_equal(rx_selection_begin((const int[]){0, 5}, FWHM, SIGMA, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){21, 20}, FWHM, SIGMA, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){5, 5}, FWHM, SIGMA, 11, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){5, 5}, turned, SIGMA, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){5, 5}, FWHM, negative, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){5, 5}, nan, SIGMA, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){20, 20}, FWHM, SIGMA, 12, 1, &s, NULL), RX_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equation),       cmocka_unit_test(test_bins_without_a_mean_keep_their_list),
        cmocka_unit_test(test_uniform),        cmocka_unit_test(test_invariants),
        cmocka_unit_test(test_limits_of_bins), cmocka_unit_test(test_order),
        cmocka_unit_test(test_order_is_even),  cmocka_unit_test(test_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
