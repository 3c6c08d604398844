/* Tests between samples against scipy, the paper's tables, 60-digit arithmetic and brute force.
 *
 * Samples, the same in python: a = [((i*37+11)%101)/7 ...], b = [((i*53+29)%103)/8 + i%3 ...]. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "num/special.h"
#include "quality/hypothesis.h"

enum { MOST = 1000 };

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

/* Tables 1 to 4 of the paper: t and p as printed there. t has three or four digits, hence 5 %. */
static void p_values_of_the_paper(void **state)
{
    static const struct {
        double dof, t, p;
        int fits;
    } printed[] = {
        {138, 17.97, 5.96e-38, 1},  {138, 20.46, 1.23e-43, 1},   {138, 17.57, 5.08e-37, 1},
        {138, 20.27, 3.40e-43, 1},  {138, 20.76, 2.72e-44, 1},   {138, 18.79, 7.41e-40, 1},
        {138, 24.56, 3.21e-52, 1},  {138, 49.69, 6.02e-90, 1},   {138, 73.94, 6.82e-113, 1},
        {138, 56.31, 4.29e-97, 1},  {138, 75.21, 6.88e-114, 1},  {138, 76.49, 7.09e-115, 1},
        {138, 68.05, 4.77e-108, 1}, {138, 110.96, 8.31e-137, 1}, {78, 1.70, 4.88e-02, 0},
        {78, 17.81, 3.25e-29, 1},   {78, 26.46, 1.05e-40, 1},    {78, 32.40, 5.35e-47, 1},
        {78, 32.12, 1.00e-46, 1},   {78, 40.43, 4.40e-54, 1},    {78, 40.60, 3.24e-54, 1},
        {78, 43.98, 1.63e-54, 0},   {78, 6.66, 3.52e-09, 1},     {78, 34.76, 3.11e-49, 1},
        {78, 42.52, 1.02e-55, 1},   {78, 39.62, 1.98e-53, 1},    {78, 43.38, 2.27e-56, 1},
        {78, 50.09, 4.52e-61, 1},   {78, 47.96, 1.19e-59, 1},    {78, 59.78, 6.52e-67, 1},
    };
    (void)state;
    for (size_t i = 0; i < sizeof printed / sizeof *printed; i++) {
        double ratio = rx_student_p(printed[i].t, printed[i].dof, NULL) / printed[i].p;
        assert_int_equal(fabs(ratio - 1) < 0.05, printed[i].fits);
    }
}

typedef struct t_case {
    long na, nb;
    double shift;
    double pooled[4]; /* t, p, Cohen's d, half width of the interval */
    double paired[5]; /* t, p, d_z, interval */
} t_case;

/* scipy.stats.ttest_ind(x, y) and ttest_rel(...).confidence_interval(), x = a(na) + shift. */
static const t_case t_cases[] = {
    {70,
     70,
     3,
     {4.08809123165831, 7.348489199006372e-05, 0.6910135396308725, 1.338123674723803},
     {4.436179861195808, 3.379627208433953e-05, 0.5302249086254309, 1.522452784193601, 4.01071048111252}},
    {40,
     25,
     0.5,
     {0.03720046059497432, 0.9704427985069941, 0.009484293724420678, 2.110356547043091},
     {0.3920870737219709, 0.6984540627839835, 0.07841741474439419, -1.857832601792052, 2.729261173220623}},
    {2,
     3,
     0,
     {-0.7812082025920788, 0.4916598288925362, -0.7131422577795788, 11.17856184533964},
     {-2.755725190839695, 0.221609631696756, -1.948591969529341, -18.08493589707683, 11.63850732564825}},
    {1000,
     400,
     1,
     {3.105628313953485, 0.001936920971448557, 0.1837314488200196, 0.4724723234511487},
     {2.720629806044562, 0.006800809758190594, 0.1360314903022281, 0.2095360164354734, 1.301178269278812}},
};

static void check_t(const rx_test *test, double t, double p, double dof)
{
    assert_close(test->statistic, t, 1e-12);
    assert_close(test->p, p, 1e-12);
    assert_close(test->ln_p, log(p), 1e-11);
    assert_close(test->dof, dof, 1e-12);
}

static void t_tests_as_scipy(void **state)
{
    double a[MOST], b[MOST];
    (void)state;
    for (size_t i = 0; i < sizeof t_cases / sizeof *t_cases; i++) {
        const t_case *c = &t_cases[i];
        long n = c->na < c->nb ? c->na : c->nb;
        rx_test test;
        fill_a(c->na, c->shift, a);
        fill_b(c->nb, b);
        assert_int_equal(rx_test_two_sample(c->na, a, c->nb, b, &test, NULL), RX_OK);
        check_t(&test, c->pooled[0], c->pooled[1], (double)(c->na + c->nb - 2));
        assert_int_equal(rx_test_paired(n, a, b, &test, NULL), RX_OK);
        check_t(&test, c->paired[0], c->paired[1], (double)(n - 1));
        for (long k = 0; k < n; k++)
            a[k] -= b[k];
        const rx_estimate mean = rx_mean_estimate(n, a, 0.95);
        assert_near(mean.low, c->paired[3], 1e-8);
        assert_near(mean.high, c->paired[4], 1e-8);
        assert_int_equal(mean.n, n);
    }
}

static void samples_without_spread(void **state)
{
    double a[20], b[20];
    rx_test test;
    (void)state;
    for (int i = 0; i < 20; i++) {
        b[i] = 0.3 * i;
        a[i] = b[i] + 0.1; /* differences agree but for rounding */
    }
    assert_int_equal(rx_test_paired(20, a, b, &test, NULL), RX_OK);
    assert_true(isinf(test.statistic));
    assert_true(test.statistic > 0);
    assert_true(test.p == 0);
    assert_true(isinf(test.ln_p));
    assert_int_equal(rx_test_paired(20, b, b, &test, NULL), RX_OK);
    assert_true(test.statistic == 0);
    assert_true(test.p == 1);
    assert_true(test.ln_p == 0);
    for (int i = 0; i < 20; i++) {
        a[i] = 0.1;
        b[i] = 0.7;
    }
    assert_int_equal(rx_test_two_sample(20, a, 15, b, &test, NULL), RX_OK);
    assert_true(isinf(test.statistic));
    assert_true(test.statistic < 0);
    assert_true(test.p == 0);
    assert_int_equal(rx_test_two_sample(20, a, 15, a, &test, NULL), RX_OK);
    assert_true(test.statistic == 0);
    assert_true(test.p == 1);
}

/* A small difference on a large level keeps its digits: the same t as without the level. */
static void level_does_not_matter(void **state)
{
    double a[70], b[70];
    rx_test plain, high;
    (void)state;
    fill_a(70, 3, a);
    fill_b(70, b);
    for (int i = 0; i < 70; i++) { /* multiples of 2^-10: exact also on the level */
        a[i] = round(a[i] * 1024) / 1024;
        b[i] = round(b[i] * 1024) / 1024;
    }
    assert_int_equal(rx_test_two_sample(70, a, 70, b, &plain, NULL), RX_OK);
    for (int i = 0; i < 70; i++) {
        a[i] += 1e9;
        b[i] += 1e9;
    }
    assert_int_equal(rx_test_two_sample(70, a, 70, b, &high, NULL), RX_OK);
    assert_close(high.statistic, plain.statistic, 1e-7);
    assert_close(high.p, plain.p, 1e-6);
}

static void samples_that_do_not_do(void **state)
{
    double a[3] = {1, 2, 3}, b[3] = {4, NAN, 6};
    rx_test test;
    rx_five_numbers box;
    rx_error err = RX_ERROR_NONE;
    (void)state;
    assert_int_equal(rx_test_two_sample(1, a, 3, a, &test, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "2 values or more, it has 1"));
    assert_int_equal(rx_test_two_sample(3, a, 0, a, &test, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "it has 0"));
    assert_int_equal(rx_test_paired(1, a, a, &test, &err), RX_USAGE);
    assert_int_equal(rx_five_numbers_of(0, a, &box, &err), RX_USAGE);
    assert_int_equal(rx_test_paired(3, a, b, &test, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "value 2 of a sample is not finite"));
    assert_true(isnan(rx_mean_estimate(0, a, 0.95).value));
    assert_near(rx_mean_estimate(1, a, 0.95).value, 1, 0);
    assert_true(isnan(rx_mean_estimate(1, a, 0.95).low));
    assert_int_equal(rx_five_numbers_of(3, b, &box, &err), RX_INPUT);
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
    (void)state;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        rx_estimate e = rx_poisson_interval(expected[i].count, expected[i].level);
        assert_near(e.value, (double)expected[i].count, 0);
        assert_close(e.low, expected[i].low, 1e-12);
        assert_close(e.high, expected[i].high, 1e-12);
        assert_close(rx_poisson_upper(expected[i].count, expected[i].level), expected[i].upper, 1e-12);
    }
    assert_true(isnan(rx_poisson_upper(-1, 0.95)));
    assert_true(isnan(rx_poisson_interval(3, 1).high));
}

/* Exact limits: never below their level, summed over all outcomes. */
static void poisson_covers(void **state)
{
    (void)state;
    for (double mean = 0.1; mean < 30; mean *= 1.5) {
        double probability = exp(-mean), covered = 0, below = 0;
        for (long k = 0; k < 150; k++) {
            rx_estimate e = rx_poisson_interval(k, 0.9);
            if (e.low <= mean && mean <= e.high)
                covered += probability;
            if (mean <= rx_poisson_upper(k, 0.9))
                below += probability;
            probability *= mean / (double)(k + 1);
        }
        assert_true(covered >= 0.9 - 1e-12);
        assert_true(below >= 0.9 - 1e-12);
    }
}

/* matplotlib.cbook.boxplot_stats(a(n)**2), which takes numpy's quartiles. */
static void box_as_matplotlib(void **state)
{
    static const struct {
        long n;
        double low, q1, median, q3, high, mean;
    } expected[] = {
        {1, 2.46938775510204, 2.46938775510204, 2.46938775510204, 2.46938775510204, 2.46938775510204,
         2.46938775510204},
        {2, 2.46938775510204, 13.6071428571429, 24.7448979591837, 35.8826530612245, 47.0204081632653,
         24.7448979591837},
        {4, 2.46938775510204, 7.36734693877551, 28.0102040816327, 72.1275510204082, 147.448979591837,
         51.484693877551},
        {9, 0.326530612244898, 9, 47.0204081632653, 94.3673469387755, 184.183673469388, 63.6757369614512},
        {70, 0, 12.265306122449, 49.0204081632653, 111.005102040816, 204.081632653061, 67.4644314868805},
    };
    double a[MOST];
    rx_five_numbers box;
    (void)state;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        fill_a(expected[i].n, 0, a);
        for (long k = 0; k < expected[i].n; k++)
            a[k] *= a[k];
        assert_int_equal(rx_five_numbers_of(expected[i].n, a, &box, NULL), RX_OK);
        assert_near(box.low, expected[i].low, 1e-12);
        assert_near(box.q1, expected[i].q1, 1e-12);
        assert_near(box.median, expected[i].median, 1e-12);
        assert_near(box.q3, expected[i].q3, 1e-12);
        assert_near(box.high, expected[i].high, 1e-12);
        assert_near(box.mean, expected[i].mean, 1e-12);
        assert_int_equal(box.outliers, 0);
        assert_int_equal(box.n, expected[i].n);
    }
    static const double far[] = {1, 2, 2.5, 3, 3.5, 4, 50, -40};
    assert_int_equal(rx_five_numbers_of(8, far, &box, NULL), RX_OK);
    assert_near(box.low, 1, 0);
    assert_near(box.high, 4, 0);
    assert_near(box.q1, 1.75, 1e-15);
    assert_near(box.median, 2.75, 1e-15);
    assert_near(box.q3, 3.625, 1e-15);
    assert_int_equal(box.outliers, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(p_values_of_the_paper),  cmocka_unit_test(t_tests_as_scipy),
        cmocka_unit_test(samples_without_spread), cmocka_unit_test(level_does_not_matter),
        cmocka_unit_test(samples_that_do_not_do), cmocka_unit_test(poisson_as_scipy),
        cmocka_unit_test(poisson_covers),         cmocka_unit_test(box_as_matplotlib),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
