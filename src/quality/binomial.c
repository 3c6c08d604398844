/* Exact binomial statistics. */
#include "quality/binomial.h"

#include <math.h>

double rx_beta_fraction(double a, double b, double x)
{
    const double tiny = 1e-300;
    double c = 1, d = 1 - (a + b) * x / (a + 1);
    if (fabs(d) < tiny)
        d = tiny;
    d = 1 / d;
    double value = d;
    for (int m = 1; m <= 20000; m++) {
        double step = 1;
        for (int half = 0; half < 2; half++) {
            double k = half == 0 ? m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
                                 : -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
            d = 1 + k * d;
            c = 1 + k / c;
            if (fabs(d) < tiny)
                d = tiny;
            if (fabs(c) < tiny)
                c = tiny;
            d = 1 / d;
            step = c * d;
            value *= step;
        }
        if (fabs(step - 1) < 1e-15)
            break;
    }
    return value;
}

double rx_incomplete_beta(double a, double b, double x)
{
    int sign;
    if (!(x > 0))
        return 0;
    if (x >= 1)
        return 1;
    double front =
        exp(lgamma_r(a + b, &sign) - lgamma_r(a, &sign) - lgamma_r(b, &sign) + a * log(x) + b * log1p(-x));
    if (x < (a + 1) / (a + b + 2))
        return front * rx_beta_fraction(a, b, x) / a;
    return 1 - front * rx_beta_fraction(b, a, 1 - x) / b;
}

double rx_binomial_below(long k, long n, double p)
{
    if (k < 0)
        return 0;
    if (k >= n)
        return 1;
    return rx_incomplete_beta((double)(n - k), (double)k + 1, 1 - p);
}

/* x with I_x(a, b) = q, by bisection: the function grows with x. */
static double inverse_beta(double a, double b, double q)
{
    double low = 0, high = 1;
    for (int i = 0; i < 60; i++) {
        double middle = 0.5 * (low + high);
        if (middle <= low || middle >= high) /* no number lies between */
            break;
        if (rx_incomplete_beta(a, b, middle) < q)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

rx_estimate rx_binomial_interval(long k, long n, double level)
{
    double tail = 0.5 * (1 - level);
    rx_estimate out = {.value = NAN, .low = 0, .high = 1, .n = n};
    if (n <= 0)
        return out;
    out.value = (double)k / (double)n;
    if (k > 0)
        out.low = inverse_beta((double)k, (double)(n - k) + 1, tail);
    if (k < n)
        out.high = inverse_beta((double)k + 1, (double)(n - k), 1 - tail);
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
