/* Tests between two restorers, and what belongs to them. p-values are two-sided and hold their relative
 * accuracy down to the smallest double, ln_p far beyond: against 60-digit arithmetic 3e-13 for up to 10^4
 * degrees of freedom, 4e-11 for 10^6.
 *
 * A spread at the level of rounding, 4 eps times the largest value, counts as none: the statistic is then
 * +-infinity with p = 0, or 0 with p = 1 when there is no difference either. Errors of all tests: RX_USAGE
 * (too few values), RX_INPUT (a value that is not finite), RX_SYSTEM (memory).
 */
#ifndef RX_QUALITY_HYPOTHESIS_H
#define RX_QUALITY_HYPOTHESIS_H

#include <stdint.h>

#include "base/error.h"
#include "quality/binomial.h"

typedef struct rx_test {
    double statistic; /* t, or W (the smaller rank sum) */
    double dof;       /* t tests; n of non-zero differences for Wilcoxon */
    double p;         /* two-sided; 0 when below the smallest double, then see ln_p */
    double ln_p;
    double effect; /* Cohen's d (pooled), d_z (paired), or the rank-biserial correlation (Kerby 2014):
                      positive when a is larger */
    rx_estimate
        difference; /* mean (t) or median (Wilcoxon, Hodges-Lehmann) of a - b with its 95 % interval */
} rx_test;

/* Student's two-sample t with pooled variance, as the paper's tables (dof = na + nb - 2); na, nb >= 2. */
rx_status rx_test_two_sample(long na, const double *a, long nb, const double *b, rx_test *dst, rx_error *err);
/* Student's t of a[i] - b[i]; n >= 2. */
rx_status rx_test_paired(long n, const double *a, const double *b, rx_test *dst, rx_error *err);
/* Wilcoxon's signed ranks of a[i] - b[i] (1945, Biometrics Bull. 1, 80): zeros left out; exact for 50 or
 * fewer without ties, else normal with tie and continuity correction, as scipy.stats.wilcoxon of the
 * differences that are not zero with correction=True. The Hodges-Lehmann median is that of the means of all
 * pairs of differences, zeros too; its interval (their order statistics, same distribution) has infinite ends
 * for n < 6. n >= 1; n^2 < 2^62. O(n log n). */
rx_status rx_test_wilcoxon(long n, const double *a, const double *b, rx_test *dst, rx_error *err);

/* Mean of a[i] - b[i] with its bootstrap percentile interval (bootstrap.h); infinite ends for n <
 * RX_BOOTSTRAP_FEWEST. n >= 1. */
rx_status rx_paired_bootstrap(long n, const double *a, const double *b, double level, uint64_t seed,
                              rx_estimate *dst, rx_error *err);

/* Holm (1979, Scand. J. Stat. 6, 65): adjusted p of n tests, adjusted[i] >= p[i], at most 1; may be the same
 * array. Errors: RX_INPUT a p that is not in 0..1. */
rx_status rx_holm(long n, const double *p, double *adjusted, rx_error *err);

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
