/* Exact binomial statistics: intervals of a share, ranks around a median, a paired sign test.
 *
 * Intervals are Clopper-Pearson (Clopper & Pearson 1934, Biometrika 26, 404): the true share is inside
 * with at least the stated probability for every n, so a gate decided on a bound is never too lenient.
 * Accuracy: 1e-9 absolute against scipy for n up to 1e6.
 */
#ifndef RX_QUALITY_BINOMIAL_H
#define RX_QUALITY_BINOMIAL_H

/* A number with its interval; value, low and high may be NAN or infinite when n is too small. */
typedef struct rx_estimate {
    double value, low, high;
    long n; /* sources behind it */
} rx_estimate;

/* P(X <= k) for X ~ Binomial(n, p). */
double rx_binomial_below(long k, long n, double p);

/* k of n with the Clopper-Pearson interval at `level` (0.95). n = 0: NAN in [0, 1]. */
rx_estimate rx_binomial_interval(long k, long n, double level);

/* Rank r >= 1 such that the r-th smallest and the r-th largest of n values enclose the median of their
 * distribution with probability >= level; 0 when n is too small for that (below 6 at 0.95). */
long rx_median_rank(long n, double level);

/* Two-sided p of McNemar's exact test: b and c, pairs in which only the one or only the other succeeded. */
double rx_mcnemar(long b, long c);

#endif
