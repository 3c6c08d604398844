/* Distributions: beta, gamma (Poisson), Student's t; Lambert's function; a rule of integration. GSL's
 * functions behind one header; their inverses are found by bisection to neighbouring doubles, since GSL's own
 * (gsl_cdf_*_Pinv of 2.7) end without a root for shapes of some hundred and more. No function has state; of a distribution an
 * argument outside of the range gives NAN. */
#ifndef RX_NUM_SPECIAL_H
#define RX_NUM_SPECIAL_H

#include "base/error.h"

/* Regularised incomplete beta function I_x(a, b), a, b > 0: 0 below x = 0, 1 above x = 1. Accuracy 1e-11 for
 * a, b up to 1e6. */
double rx_beta_inc(double a, double b, double x);
/* x in 0..1 with I_x(a, b) = q. */
double rx_beta_inverse(double a, double b, double q);

/* Regularised incomplete gamma function P(a, x), a > 0; 0 below x = 0. Relative accuracy 1e-12 for a up to 100. */
double rx_gamma_p(double a, double x);
/* x >= 0 with P(a, x) = p or with Q(a, x) = 1 - P = q, p and q between 0 and 1. */
double rx_gamma_p_inverse(double a, double p);
double rx_gamma_q_inverse(double a, double q);
/* Logarithm of the gamma function, a > 0; unlike lgamma() it writes no variable that threads share. */
double rx_gamma_log(double a);
/* Of a complex number, not 0 or a negative whole one: ln |Gamma| and the angle. */
void rx_gamma_log_complex(double re, double im, double *ln_size, double *angle);

/* Principal branch of Lambert's function: w >= -1 with w e^w = x, x >= -1/e. */
double rx_lambert_w(double x);

/* t > 0 that Student's t exceeds, either way, with probability p, 0 <= p < 1: half width of intervals in standard errors. */
double rx_student_quantile(double p, double dof);

/* The n >= 1 places and weights of Gauss and Legendre's rule on -1..1, which is exact for polynomials of degree 2 n - 1.
 * Errors: RX_SYSTEM memory. */
rx_status rx_gauss_legendre(int n, double *places, double *weights, rx_error *err);

#endif
