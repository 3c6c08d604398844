/* Normal equations A x = b, A symmetric and positive definite: x minimises x^T A x - 2 b^T x. Cholesky's
 * factorisation by GSL, dense, in double. */
#ifndef RX_NUM_NORMAL_H
#define RX_NUM_NORMAL_H

#include <stddef.h>

#include "base/error.h"

/* x [n] and, unless NULL, covariance [n][n] = A^-1 of a [n][n] (lower triangle read), b [n].
 * *singular = 1: A is not positive definite to 1e-10 of its diagonal (after scaling the diagonal to 1); then
 * 1e-8 was added to the scaled diagonal. Diagonal elements must be > 0. Errors: RX_SYSTEM memory, RX_INPUT
 * numbers that are not finite or a diagonal element <= 0. */
rx_status rx_normal_solve(const double *a, const double *b, size_t n, double *x, double *covariance,
                          int *singular, rx_error *err);

/* The same under x[j] >= 0 for all j with bounded[j] != 0 (NULL: for all): Lawson and Hanson's active set
 * (Solving Least Squares Problems, 1974, ch. 23) on the normal equations. at_bound [n]: 1 where x[j] was held
 * at 0; rows and columns of the covariance of those are 0. */
typedef struct rx_normal_bounded {
    size_t n;
    const double *a, *b;
    const int *bounded;
} rx_normal_bounded;
rx_status rx_normal_nonnegative(const rx_normal_bounded *equations, double *x, double *covariance,
                                int *at_bound, int *singular, rx_error *err);

/* For a few unknowns in a loop: memory of the caller, a [n] rows at distances of `stride`, only the lower triangle read.
 * The factor L with L L^T = a takes its place; 0 where a is not positive definite. Then b becomes a^-1 b. */
int rx_cholesky(double *a, int n, int stride);
void rx_cholesky_solve(const double *factor, int n, int stride, double *b);

#endif
