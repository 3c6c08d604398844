/* Samples: fit for a test or not. */
#include "quality/sample.h"

#include <math.h>

#include "base/memory.h"
#include "num/stats.h"

rx_status rx_sample_check(long n, const double *values, long fewest, const char *which, rx_error *err)
{
    if (n < fewest)
        return rx_error_set(err, RX_USAGE, "a test needs %ld values or more, the %s sample has %ld", fewest,
                            which, n);
    for (long i = 0; i < n; i++)
        if (!isfinite(values[i]))
            return rx_error_set(err, RX_INPUT,
                                "value %ld of the %s sample is not finite; leave it out before the test",
                                i + 1, which);
    return RX_OK;
}

rx_status rx_sample_difference(long n, const double *a, const double *b, long fewest, double **dst,
                               rx_error *err)
{
    *dst = NULL;
    RX_TRY(rx_sample_check(n, a, fewest, "first", err));
    RX_TRY(rx_sample_check(n, b, fewest, "second", err));
    double *difference = RX_NEW(double, (size_t)n);
    if (difference == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *difference);
    for (long i = 0; i < n; i++)
        difference[i] = a[i] - b[i];
    *dst = difference;
    return RX_OK;
}

double rx_sample_sigma(double *values, long n, double *median)
{
    return rx_sigma_mad(values, (size_t)n, median);
}

double rx_sample_quantile(double *values, long n, double q)
{
    return rx_quantile(values, (size_t)n, q);
}
