/* Noise that is correlated (data/noise_correlation.h) in fits whose weights w do not know of it. Of noise
 * n_i = u_i / sqrt(w_i), u of that correlation, the sums a fit goes by have
 *
 *   Cov(sum_i w_i S_i n_i, sum_j w_j T_j n_j) = sum_ij S_i sqrt(w_i) at(i - j) sqrt(w_j) T_j
 *
 * where independent pixels have sum_i w_i S_i T_i: B for A, and unknowns have the covariance A^-1 B A^-1. */
#ifndef RX_TEMPLATE_CORRELATED_H
#define RX_TEMPLATE_CORRELATED_H

#include "base/error.h"
#include "template/fit_image.h"

/* What one template contributes: sqrt(w_i) sum_j at(i - j) sqrt(w_j) T_j, in its window. */
typedef struct rx_correlated {
    rx_window window;
    double *values; /* owned */
} rx_correlated;

/* Of the pixels of `within`, which are shown. image->correlation must be given. Free what it owns with
 * rx_correlated_clear(). Errors: RX_SYSTEM. */
rx_status rx_correlated_new(const rx_fit_image *image, const rx_footprint *footprint, const rx_window *within,
                            rx_correlated *dst, rx_error *err);
void rx_correlated_clear(rx_correlated *grain);

/* The covariance with the sum of another template. */
double rx_correlated_covariance(const rx_correlated *grain, const rx_footprint *footprint);

#endif
