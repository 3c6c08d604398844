/* Tests between two restorers, and what belongs to them. p-values are two-sided and hold their relative
 * accuracy down to 1e-300 (ln_p beyond). GSL's distributions. */
#ifndef RX_VALIDATE_HYPOTHESIS_H
#define RX_VALIDATE_HYPOTHESIS_H

#include <stdint.h>

#include "base/error.h"
#include "validate/binomial.h"

typedef struct rx_test {
    double statistic; /* t, or W (the smaller rank sum) */
    double dof;       /* t tests; n of non-zero differences for Wilcoxon */
    double p;         /* two-sided; 0 when below the smallest double, then see ln_p */
    double ln_p;
    double effect; /* Cohen's d (pooled), d_z (paired), or the rank-biserial correlation */
    rx_estimate
        difference; /* mean (t) or median (Wilcoxon, Hodges-Lehmann) of a - b with its 95 % interval */
} rx_test;

/* Student's two-sample t with pooled variance, as the paper's tables (dof = na + nb - 2). */
rx_status rx_test_two_sample(long na, const double *a, long nb, const double *b, rx_test *dst, rx_error *err);
/* Welch's, unequal variances. */
rx_status rx_test_welch(long na, const double *a, long nb, const double *b, rx_test *dst, rx_error *err);
/* Student's t of a[i] - b[i]. */
rx_status rx_test_paired(long n, const double *a, const double *b, rx_test *dst, rx_error *err);
/* Wilcoxon's signed ranks of a[i] - b[i]: zeros left out, exact for n <= 50 without ties, else normal with
 * tie and continuity correction (as scipy.stats.wilcoxon does with the same settings; stated in the .c). */
rx_status rx_test_wilcoxon(long n, const double *a, const double *b, rx_test *dst, rx_error *err);

/* Bootstrap interval of the mean of a[i] - b[i] (percentile). */
rx_status rx_paired_bootstrap(long n, const double *a, const double *b, double level, uint64_t seed,
                              rx_estimate *dst, rx_error *err);

/* Holm (1979, Scand. J. Stat. 6, 65): adjusted p of n tests, adjusted[i] >= p[i]. */
rx_status rx_holm(long n, const double *p, double *adjusted, rx_error *err);

/* Interval of a Poisson mean from `count` events (exact, Garwood 1936), two-sided at `level`; and the
 * one-sided upper limit at `level`. */
rx_estimate rx_poisson_interval(long count, double level);
double rx_poisson_upper(long count, double level);

/* p of Student's t, two-sided, and its logarithm: for the numbers that papers print. */
double rx_student_p(double t, double dof, double *ln_p);

/* Box plot: quartiles (linear interpolation, as numpy's default), whiskers at the last value within 1.5 IQR.
 */
typedef struct rx_box {
    double low, q1, median, q3, high;
    long n, outliers;
    double mean;
} rx_box;
rx_status rx_box_make(long n, const double *values, rx_box *dst, rx_error *err);

#endif
