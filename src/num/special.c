/* Distributions by GSL's special functions. */
#include "num/special.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_integration.h>
#include <gsl/gsl_sf_gamma.h>
#include <gsl/gsl_sf_lambert.h>
#include <math.h>
#include <stdbool.h>

double rx_beta_inc(double a, double b, double x)
{
    if (!(a > 0 && b > 0) || isnan(x))
        return NAN;
    if (x <= 0 || x >= 1)
        return x >= 1;
    gsl_set_error_handler_off(); /* a tail that underflows is 0, which serves */
    return gsl_sf_beta_inc(a, b, x);
}

double rx_gamma_p(double a, double x)
{
    if (!(a > 0) || isnan(x))
        return NAN;
    gsl_set_error_handler_off();
    return x > 0 ? gsl_sf_gamma_inc_P(a, x) : 0;
}

double rx_lambert_w(double x)
{
    gsl_sf_result w;
    gsl_set_error_handler_off();
    return gsl_sf_lambert_W0_e(x, &w) == GSL_SUCCESS ? w.val : NAN;
}

double rx_gamma_log(double a)
{
    int sign;
    return lgamma_r(a, &sign);
}

void rx_gamma_log_complex(double re, double im, double *ln_size, double *angle)
{
    gsl_sf_result size = {NAN, 0}, turn = {NAN, 0};
    gsl_set_error_handler_off();
    gsl_sf_lngamma_complex_e(re, im, &size, &turn);
    *ln_size = size.val;
    *angle = turn.val;
}

/* p of Student's t, two-sided: DLMF 8.17 and Abramowitz & Stegun 26.7.1. */
static double student_p(double dof, double unused, double t)
{
    (void)unused;
    return rx_beta_inc(0.5 * dof, 0.5, dof / (dof + t * t));
}

static double gamma_p(double a, double unused, double x)
{
    (void)unused;
    return rx_gamma_p(a, x);
}

static double gamma_q(double a, double unused, double x)
{
    (void)unused;
    gsl_set_error_handler_off();
    return x > 0 ? gsl_sf_gamma_inc_Q(a, x) : 1;
}

/* x >= 0 with f(a, b, x) = target, f growing with x or falling: the bracket from 0 to high is first doubled
 * until it holds the root, then halved until no double lies between its ends. */
static double root(double (*f)(double, double, double), double a, double b, double target, bool grows,
                   double high)
{
    double low = 0;
    while (high < 1e300 && (grows ? f(a, b, high) < target : f(a, b, high) > target))
        high *= 2;
    for (;;) {
        double middle = 0.5 * (low + high);
        if (middle <= low || middle >= high)
            return middle;
        if (grows ? f(a, b, middle) < target : f(a, b, middle) > target)
            low = middle;
        else
            high = middle;
    }
}

double rx_beta_inverse(double a, double b, double q)
{
    if (!(a > 0 && b > 0 && q >= 0 && q <= 1))
        return NAN;
    return root(rx_beta_inc, a, b, q, true, 1);
}

double rx_gamma_p_inverse(double a, double p)
{
    return a > 0 && p > 0 && p < 1 ? root(gamma_p, a, 0, p, true, 2 * a + 10) : NAN;
}

double rx_gamma_q_inverse(double a, double q)
{
    return a > 0 && q > 0 && q < 1 ? root(gamma_q, a, 0, q, false, 2 * a + 10) : NAN;
}

double rx_student_quantile(double p, double dof)
{
    if (!(p >= 0 && p <= 1) || !(dof > 0))
        return NAN;
    return p == 0 ? INFINITY : root(student_p, dof, 0, p, false, 1);
}

rx_status rx_gauss_legendre(int n, double *places, double *weights, rx_error *err)
{
    gsl_set_error_handler_off();
    gsl_integration_glfixed_table *table = gsl_integration_glfixed_table_alloc((size_t)n);
    if (table == NULL)
        return rx_error_memory(err, 2 * (size_t)n * sizeof(double));
    for (int i = 0; i < n; i++)
        gsl_integration_glfixed_point(-1.0, 1.0, (size_t)i, &places[i], &weights[i], table);
    gsl_integration_glfixed_table_free(table);
    return RX_OK;
}
