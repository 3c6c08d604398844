/* Least squares against a NIST reference problem. */
#include "../near.h"

#include <string.h>

#include "num/lsq.h"

/* NIST StRD Misra1a: y = b1 (1 - exp(-b2 x)). */
static const double misra_y[14] = {10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02,
                                   44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78};
static const double misra_x[14] = {77.6,  114.9, 141.1, 190.8, 239.9, 289.0, 332.8,
                                   378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0};

static int misra(void *user, const double *p, double *residuals, double *jacobian)
{
    for (int i = 0; i < 14; i++) {
        double e = exp(-p[1] * misra_x[i]);
        residuals[i] = p[0] * (1.0 - e) - misra_y[i];
        jacobian[2 * i] = 1.0 - e;
        jacobian[2 * i + 1] = p[0] * misra_x[i] * e;
    }
    return 0;
}

static void test_misra1a(void **state)
{
    double p[2] = {500.0, 0.0001}, errors[2];
    rx_lsq_result result;
    const rx_lsq_problem problem = {
        .nresiduals = 14, .nparameters = 2, .model = misra, .max_iterations = 100, .tolerance = 1e-8};
    assert_int_equal(rx_lsq_fit(&problem, p, errors, &result, NULL), RX_OK);
    assert_true(result.converged);
    assert_close(p[0], 2.3894212918e+02, 1e-6);
    assert_close(p[1], 5.5015643181e-04, 1e-6);
    assert_close(result.chi2, 1.2455138894e-01, 1e-8);
    /* NIST's deviations carry the residual standard deviation */
    const double sigma = sqrt(result.chi2 / 12.0);
    assert_close(errors[0] * sigma, 2.7070075241, 1e-3);
    assert_close(errors[1] * sigma, 7.2668688436e-06, 1e-3);
}

static int refuses(void *user, const double *p, double *residuals, double *jacobian)
{
    residuals[0] = residuals[1] = p[0];
    return 1;
}

/* Two parameters of which one does nothing: a best fit, an infinite error, no abort. */
static int blind(void *user, const double *p, double *residuals, double *jacobian)
{
    for (int i = 0; i < 4; i++) {
        residuals[i] = p[0] - i;
        jacobian[2 * i] = 1.0;
        jacobian[2 * i + 1] = 0.0;
    }
    return 0;
}

static void test_failures(void **state)
{
    double p[2] = {1.0, 1.0}, errors[2];
    rx_lsq_result result;
    rx_lsq_problem problem = {
        .nresiduals = 2, .nparameters = 2, .model = refuses, .max_iterations = 100, .tolerance = 1e-8};
    assert_int_equal(rx_lsq_fit(&problem, p, NULL, &result, NULL), RX_INPUT);
    problem.nresiduals = 1;
    assert_int_equal(rx_lsq_fit(&problem, p, NULL, &result, NULL), RX_INPUT);
    problem.nresiduals = 4;
    problem.model = blind;
    assert_int_equal(rx_lsq_fit(&problem, p, errors, &result, NULL), RX_OK);
    assert_true(fabs(p[0] - 1.5) < 1e-6);
    assert_true(p[1] == 1.0);
    assert_true(errors[1] == HUGE_VAL);
    assert_true(fabs(result.chi2 - 5.0) < 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_misra1a), cmocka_unit_test(test_failures)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
