/* Errors from injected objects: ranks, groups, weights, what is too little, and what they cover. */
#include <math.h>
#include <stdlib.h>

#include "../near.h"
#include "base/random.h"
#include "check/conformal.h"

enum { MOST = 4000 };

static rx_conformal of(rx_conformal_case *cases, long n)
{
    rx_conformal conformal;
    rx_conformal_fit(cases, n, &conformal);
    return conformal;
}

static int groups(const rx_conformal *conformal)
{
    return conformal->places[0].n + conformal->places[1].n;
}

/* Scores 1 .. n, the brighter the smaller, at S/N up to n. */
static void steps(rx_conformal_case *cases, int n)
{
    for (int i = 0; i < n; i++)
        cases[i] = (rx_conformal_case){.snr = i + 1, .score = n - i, .weight = 1};
}

static void the_score_is_the_right_one_of_n(void **state)
{
    static const int counts[] = {1, 2, 3, 18, 19, 20, 100, 199};
    rx_conformal_case cases[200];
    double factor[2];
    for (size_t k = 0; k < sizeof counts / sizeof *counts; k++) {
        const int n = counts[k];
        steps(cases, n);
        const rx_conformal conformal = of(cases, n);
        assert_int_equal(conformal.n, n);
        assert_int_equal(groups(&conformal), 1);
        rx_conformal_at(&conformal, 0.5, 0, factor);
        static const double levels[] = {0.682689, 0.95};
        for (int level = 0; level < 2; level++) {
            const double rank = ceil((n + 1) * levels[level]);
            if (rank <= n)
                assert_near(factor[level], rank, 1e-12);
            else
                assert_true(isnan(factor[level]));
        }
        rx_conformal_at(&conformal, n + 0.1, 0, factor); /* brighter than all */
        assert_true(isnan(factor[0]));
    }
    rx_conformal_at(&(rx_conformal){0}, 5, 0, factor);
    assert_true(isnan(factor[0]));
    cases[0].score = NAN;
    cases[1].weight = 0;
    const rx_conformal none = of(cases, 2);
    assert_int_equal(none.n, 0);
    rx_conformal_at(&none, 1, 0, factor);
    assert_true(isnan(factor[0]));
}

static void groups_are_of_like_snr_and_blending(void **state)
{
    rx_conformal_case *cases = malloc(800 * sizeof *cases);
    double factor[2];
    assert_non_null(cases);
    steps(cases, 800);
    for (int i = 0; i < 800; i += 2)
        cases[i].blend = 0.5, cases[i].score += 10000;
    rx_conformal conformal = of(cases, 800);
    assert_int_equal(groups(&conformal), 4);
    rx_conformal_at(&conformal, 400, 0.09, factor); /* scores 799, 797 .. 401 */
    assert_near(factor[0], 401 + 2 * (ceil(201 * 0.682689) - 1), 1e-12);
    rx_conformal_at(&conformal, 401, 0.09, factor); /* 399 .. 1 */
    assert_near(factor[0], 1 + 2 * (ceil(201 * 0.682689) - 1), 1e-12);
    rx_conformal_at(&conformal, 10, 0.1, factor); /* 10800 .. 10402 */
    assert_near(factor[1], 10402 + 2 * (ceil(201 * 0.95) - 1), 1e-12);
    for (int i = 0; i < 800; i++)
        cases[i].blend = i < 59 ? 0.5 : 0; /* too few for themselves */
    conformal = of(cases, 800);
    assert_int_equal(groups(&conformal), 4);
    rx_conformal_at(&conformal, 3, 0.5, factor);
    assert_true(factor[0] > 10000);
    free(cases);
}

static void faint_ones_weigh_more(void **state)
{
    rx_conformal_case cases[101];
    double factor[2];
    steps(cases, 101);
    for (int i = 0; i < 101; i++)
        cases[i].weight = cases[i].score > 91 ? 100 : 1; /* ten of 1000 in all and 91 */
    const rx_conformal conformal = of(cases, 101);
    rx_conformal_at(&conformal, 1, 0, factor);
    const double mean = 1091 / 101.0;
    assert_near(factor[0], 91 + ceil((0.682689 * (1091 + mean) - 91) / 100), 1e-12);
}

/* Errors that are three times too small and of long tails, in the tile as among the injected: half that are injected say what
 * the other half is. */
static void intervals_hold_what_they_say(void **state)
{
    rx_conformal_case *cases = malloc(2 * MOST * sizeof *cases);
    assert_non_null(cases);
    for (int i = 0; i < 2 * MOST; i++) {
        const double snr = exp(log(3.0) + 3 * rx_random_uniform(5, 1, (uint64_t)i)),
                     tail = rx_random_uniform(5, 2, (uint64_t)i) < 0.1 ? 10 : 1;
        cases[i] = (rx_conformal_case){.snr = snr,
                                       .blend = rx_random_uniform(5, 3, (uint64_t)i),
                                       .score = fabs(rx_random_normal(5, 4, (uint64_t)i)) * 3 * tail *
                                                (1 + 10 / snr),
                                       .weight = 1 / snr};
    }
    const rx_conformal conformal = of(cases, MOST);
    double inside[2] = {0, 0};
    int n = 0;
    for (int i = MOST; i < 2 * MOST; i++) {
        double factor[2];
        rx_conformal_at(&conformal, cases[i].snr, cases[i].blend, factor);
        if (isnan(factor[1]))
            continue;
        n++;
        for (int level = 0; level < 2; level++)
            inside[level] += cases[i].score <= factor[level];
    }
    assert_true(n > 0.99 * MOST);
    assert_near(inside[0] / n, 0.6827, 0.02);
    assert_near(inside[1] / n, 0.95, 0.01);
    free(cases);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_score_is_the_right_one_of_n),
        cmocka_unit_test(groups_are_of_like_snr_and_blending),
        cmocka_unit_test(faint_ones_weigh_more),
        cmocka_unit_test(intervals_hold_what_they_say),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
