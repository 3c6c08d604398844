/* Samples, for folders that see no num/. */
#include "quality/sample.h"

#include "num/stats.h"

double rx_sample_sigma(double *values, long n, double *median)
{
    return rx_sigma_mad(values, (size_t)n, median);
}

double rx_sample_quantile(double *values, long n, double q)
{
    return rx_quantile(values, (size_t)n, q);
}
