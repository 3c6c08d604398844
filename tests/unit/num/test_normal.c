/* Normal equations against what they say, and bounds against every choice of what is held. */
#include "../near.h"

#include <string.h>

#include "base/random.h"
#include "num/normal.h"

enum { ROWS = 12, COLUMNS = 5 };

typedef struct problem {
    double m[ROWS * COLUMNS], d[ROWS], w[ROWS], a[COLUMNS * COLUMNS], b[COLUMNS];
} problem;

static void make(problem *p, uint64_t seed)
{
    memset(p, 0, sizeof *p);
    for (int i = 0; i < ROWS; i++) {
        p->d[i] = rx_random_normal(seed, 1, (uint64_t)i);
        p->w[i] = 0.5 + rx_random_uniform(seed, 2, (uint64_t)i);
        for (int j = 0; j < COLUMNS; j++)
            p->m[i * COLUMNS + j] = 0.6 + rx_random_normal(seed, 3, (uint64_t)(i * COLUMNS + j));
    }
    for (int j = 0; j < COLUMNS; j++)
        for (int i = 0; i < ROWS; i++) {
            p->b[j] += p->w[i] * p->m[i * COLUMNS + j] * p->d[i];
            for (int k = 0; k < COLUMNS; k++)
                p->a[j * COLUMNS + k] += p->w[i] * p->m[i * COLUMNS + j] * p->m[i * COLUMNS + k];
        }
}

/* A x = b, and A times the covariance is one. */
static void test_solve(void **state)
{
    problem p;
    double x[COLUMNS], c[COLUMNS * COLUMNS];
    int singular = 1;
    for (uint64_t seed = 1; seed < 20; seed++) {
        make(&p, seed);
        assert_int_equal(rx_normal_solve(p.a, p.b, COLUMNS, x, c, &singular, NULL), RX_OK);
        assert_int_equal(singular, 0);
        for (int i = 0; i < COLUMNS; i++) {
            double left = -p.b[i];
            for (int j = 0; j < COLUMNS; j++) {
                double one = -(double)(i == j);
                for (int k = 0; k < COLUMNS; k++)
                    one += p.a[i * COLUMNS + k] * c[k * COLUMNS + j];
                assert_near(one, 0, 1e-9);
                left += p.a[i * COLUMNS + j] * x[j];
            }
            assert_near(left, 0, 1e-9);
        }
    }
}

/* x^T A x - 2 b^T x */
static double value(const problem *p, const double *x)
{
    double sum = 0;
    for (int i = 0; i < COLUMNS; i++) {
        sum -= 2 * p->b[i] * x[i];
        for (int j = 0; j < COLUMNS; j++)
            sum += x[i] * p->a[i * COLUMNS + j] * x[j];
    }
    return sum;
}

/* The lowest value over all sets of held unknowns whose solution is allowed; unknown 4 is free. */
static double brute(const problem *p, double *best_x)
{
    double best = HUGE_VAL;
    for (int set = 0; set < 1 << (COLUMNS - 1); set++) {
        double a[COLUMNS * COLUMNS], b[COLUMNS], y[COLUMNS], x[COLUMNS] = {0};
        int list[COLUMNS], n = 0, singular, allowed = 1;
        for (int i = 0; i < COLUMNS; i++)
            if (i == COLUMNS - 1 || (set >> i & 1))
                list[n++] = i;
        for (int i = 0; i < n; i++) {
            b[i] = p->b[list[i]];
            for (int j = 0; j < n; j++)
                a[i * n + j] = p->a[list[i] * COLUMNS + list[j]];
        }
        assert_int_equal(rx_normal_solve(a, b, (size_t)n, y, NULL, &singular, NULL), RX_OK);
        for (int i = 0; i < n; i++) {
            x[list[i]] = y[i];
            allowed = allowed && (list[i] == COLUMNS - 1 || y[i] >= 0);
        }
        if (allowed && value(p, x) < best) {
            best = value(p, x);
            memcpy(best_x, x, sizeof x);
        }
    }
    return best;
}

static void test_nonnegative(void **state)
{
    const int bounded[COLUMNS] = {1, 1, 1, 1, 0};
    int singular, held[COLUMNS], total = 0;
    for (uint64_t seed = 1; seed < 60; seed++) {
        problem p;
        double x[COLUMNS], c[COLUMNS * COLUMNS], want[COLUMNS];
        make(&p, seed);
        brute(&p, want);
        assert_int_equal(rx_normal_nonnegative(&(rx_normal_bounded){COLUMNS, p.a, p.b, bounded}, x, c, held,
                                               &singular, NULL),
                         RX_OK);
        for (int i = 0; i < COLUMNS; i++) {
            assert_true(fabs(x[i] - want[i]) < 1e-9 * (1 + fabs(want[i])));
            assert_true(!held[i] || (x[i] == 0 && c[i * COLUMNS + i] == 0));
            assert_true(held[i] || c[i * COLUMNS + i] > 0);
            total += held[i];
        }
        assert_int_equal(held[COLUMNS - 1], 0);
    }
    assert_true(total > 20);
}

static void test_singular(void **state)
{
    /* two equal columns: any split of 3 is as good; the ridge halves it */
    const double a[4] = {2, 2, 2, 2}, b[2] = {6, 6}, zero[4] = {1, 0, 0, 0}, bad[2] = {1, NAN};
    double x[2];
    int singular = 0;
    assert_int_equal(rx_normal_solve(a, b, 2, x, NULL, &singular, NULL), RX_OK);
    assert_int_equal(singular, 1);
    assert_true(fabs(x[0] - 1.5) < 1e-3);
    assert_true(fabs(x[1] - 1.5) < 1e-3);
    assert_int_equal(rx_normal_solve(zero, b, 2, x, NULL, &singular, NULL), RX_INPUT);
    assert_int_equal(rx_normal_solve(a, bad, 2, x, NULL, &singular, NULL), RX_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_solve), cmocka_unit_test(test_nonnegative),
                                       cmocka_unit_test(test_singular)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
