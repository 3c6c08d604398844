/* Exact binomial statistics. */
#include "quality/binomial.h"

#include <math.h>

#include "num/special.h"

double rx_binomial_below(long k, long n, double p)
{
    if (k < 0)
        return 0;
    if (k >= n)
        return 1;
    return rx_beta_inc((double)(n - k), (double)k + 1, 1 - p);
}

rx_estimate rx_binomial_interval(long k, long n, double level)
{
    double tail = 0.5 * (1 - level);
    rx_estimate out = {.value = NAN, .low = 0, .high = 1, .n = n};
    if (n <= 0)
        return out;
    out.value = (double)k / (double)n;
    if (k > 0)
        out.low = rx_beta_inverse((double)k, (double)(n - k) + 1, tail);
    if (k < n)
        out.high = rx_beta_inverse((double)k + 1, (double)(n - k), 1 - tail);
    return out;
}

long rx_median_rank(long n, double level)
{
    double tail = 0.5 * (1 - level);
    long low = 0, high = (n + 1) / 2; /* P(X <= rank - 1) <= tail holds at low, not beyond high */
    while (low < high) {
        long middle = low + (high - low + 1) / 2;
        if (rx_binomial_below(middle - 1, n, 0.5) <= tail)
            low = middle;
        else
            high = middle - 1;
    }
    return low;
}

double rx_mcnemar(long b, long c)
{
    double p = 2 * rx_binomial_below(b < c ? b : c, b + c, 0.5);
    return p < 1 ? p : 1;
}
