/* Samples as the tests of hypothesis.h take them. */
#ifndef RX_QUALITY_SAMPLE_H
#define RX_QUALITY_SAMPLE_H

#include "base/error.h"

/* RX_USAGE for fewer than `fewest` values, RX_INPUT where one is not finite; `which` names the sample. */
rx_status rx_sample_check(long n, const double *values, long fewest, const char *which, rx_error *err);

/* Both checked, then *dst = a[i] - b[i], to be freed by the caller; NULL on error. */
rx_status rx_sample_difference(long n, const double *a, const double *b, long fewest, double **dst,
                               rx_error *err);

/* For folders that see no num/: rx_sigma_mad() and rx_quantile() of num/stats.h. */
double rx_sample_sigma(double *values, long n, double *median);
double rx_sample_quantile(double *values, long n, double q);

#endif
