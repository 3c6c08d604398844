/* Samples, for folders that see no num/: rx_sigma_mad() and rx_quantile() of num/stats.h. */
#ifndef RX_QUALITY_SAMPLE_H
#define RX_QUALITY_SAMPLE_H

double rx_sample_sigma(double *values, long n, double *median);
double rx_sample_quantile(double *values, long n, double q);

#endif
