/* Linear least squares, by the normal equations. */
#ifndef RX_TESTS_LEAST_SQUARES_H
#define RX_TESTS_LEAST_SQUARES_H

#include <stdlib.h>

#include "num/normal.h"

/* x [columns] that minimises sum_i w_i (b_i - sum_j a_ij x_j)^2, and its covariance for w = 1/sigma^2. */
static inline void least_squares(size_t rows, size_t columns, const double *a, const double *b,
                                 const double *w, double *x, double *covariance)
{
    double *m = calloc(columns * columns, sizeof *m), *v = calloc(columns, sizeof *v);
    int singular = 1;
    for (size_t i = 0; i < rows; i++)
        for (size_t j = 0; j < columns; j++) {
            v[j] += w[i] * a[i * columns + j] * b[i];
            for (size_t k = 0; k < columns; k++)
                m[j * columns + k] += w[i] * a[i * columns + j] * a[i * columns + k];
        }
    assert_int_equal(rx_normal_solve(m, v, columns, x, covariance, &singular, NULL), RX_OK);
    assert_int_equal(singular, 0);
    free(m);
    free(v);
}

#endif
