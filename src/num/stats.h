/* Robust statistics. Functions that need scratch work on a copy the caller gives up.
 * Values must be finite: one NAN makes every answer meaningless, so leave them out before. */
#ifndef RX_NUM_STATS_H
#define RX_NUM_STATS_H

#include <stddef.h>

/* Median of n values; reorders them. NAN for n = 0. Even n: mean of the two middle ones. */
double rx_median(double *values, size_t n);

/* Quantile q in 0..1 with linear interpolation (type 7 of Hyndman and Fan 1996, The American
 * Statistician 50, 361; numpy's default); reorders. NAN for n = 0. */
double rx_quantile(double *values, size_t n, double q);

/* 1.4826 * median(|v - median|), the sigma of a normal distribution; reorders and overwrites.
 * *median may be NULL. NAN for n = 0. */
double rx_sigma_mad(double *values, size_t n, double *median);

/* Into rising order. */
void rx_sort(double *values, size_t n);

/* Things in an order of their values, rising or falling, equal ones by their number. */
typedef struct rx_ranked {
    double value;
    int index;
} rx_ranked;
void rx_rank(rx_ranked *list, size_t n);
void rx_rank_falling(rx_ranked *list, size_t n);

#endif
