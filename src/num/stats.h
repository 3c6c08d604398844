/* Robust statistics. Functions that need scratch work on a copy the caller gives up.
 * Values must be finite: one NAN makes every answer meaningless, so leave them out before. */
#ifndef RX_NUM_STATS_H
#define RX_NUM_STATS_H

#include <stddef.h>

/* Median of n values; reorders them. NAN for n = 0. Even n: mean of the two middle ones. */
float rx_median_float(float *values, size_t n);
double rx_median(double *values, size_t n);

/* Quantile q in 0..1 with linear interpolation (type 7 of Hyndman and Fan 1996, The American
 * Statistician 50, 361; numpy's default); reorders. NAN for n = 0. */
double rx_quantile(double *values, size_t n, double q);

/* 1.4826 * median(|v - median|), the sigma of a normal distribution; reorders and overwrites.
 * *median may be NULL. NAN for n = 0. */
double rx_sigma_mad(double *values, size_t n, double *median);

/* Iterated mean and sigma (divided by the number kept, not by one less), values beyond k sigma
 * of the mean left out, until nothing changes (at most 50 rounds). The outputs may be NULL;
 * NAN and 0 kept for n = 0. */
void rx_clipped_mean(const double *values, size_t n, double k, double *mean, double *sigma, size_t *kept);

#endif
