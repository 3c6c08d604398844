/* Student's t, limits of counts, box plots. p-values are two-sided and hold their relative accuracy down to the smallest
 * double, ln_p far beyond: against 60-digit arithmetic 3e-13 for up to 10^4 degrees of freedom, 4e-11 for 10^6.
 *
 * A spread at the level of rounding, 4 eps times the largest value, counts as none: t is then +-infinity with p = 0, or 0
 * with p = 1 when there is no difference either. Errors of the tests: RX_USAGE (too few values), RX_INPUT (a value that is
 * not finite). */
#ifndef RX_QUALITY_HYPOTHESIS_H
#define RX_QUALITY_HYPOTHESIS_H

#include "base/error.h"
#include "quality/binomial.h"

typedef struct rx_test {
    double statistic, dof;
    double p; /* 0 when below the smallest double, then see ln_p */
    double ln_p;
} rx_test;

/* Student's two-sample t with pooled variance, as the paper's tables (dof = na + nb - 2); na, nb >= 2. */
rx_status rx_test_two_sample(long na, const double *a, long nb, const double *b, rx_test *dst, rx_error *err);
/* Student's t of a[i] - b[i]; n >= 2. */
rx_status rx_test_paired(long n, const double *a, const double *b, rx_test *dst, rx_error *err);
/* The mean of n finite values with its t interval, whose ends are not known for n < 2; n = 0: all NAN. */
rx_estimate rx_mean_estimate(long n, const double *values, double level);

/* Interval of a Poisson mean from `count` events (exact, Garwood 1936, Biometrika 28, 437), two-sided at
 * `level`; and the one-sided upper limit at `level`. Accuracy 1e-11 relative for counts up to 1e6. n of the
 * estimate is the count. */
rx_estimate rx_poisson_interval(long count, double level);
/* The same of a rate, count events in `extent` of whatever it is. */
rx_estimate rx_poisson_rate(long count, double extent, double level);
double rx_poisson_upper(long count, double level);

/* Box plot: quartiles (linear interpolation, as numpy's default), whiskers at the last value within 1.5 IQR
 * of the box (Tukey 1977). Errors: RX_USAGE n < 1, RX_INPUT a value that is not finite, RX_SYSTEM memory. */
typedef struct rx_five_numbers {
    double low, q1, median, q3, high;
    long n, outliers;
    double mean;
} rx_five_numbers;
rx_status rx_five_numbers_of(long n, const double *values, rx_five_numbers *dst, rx_error *err);

#endif
