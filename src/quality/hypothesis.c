/* Student's t, Poisson limits, box plots. */
#include "quality/hypothesis.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/special.h"
#include "num/stats.h"

static rx_status check(long n, const double *values, long fewest, rx_error *err)
{
    if (n < fewest)
        return rx_error_set(err, RX_USAGE, "a sample needs %ld values or more, it has %ld", fewest, n);
    for (long i = 0; i < n; i++)
        if (!isfinite(values[i]))
            return rx_error_set(err, RX_INPUT, "value %ld of a sample is not finite; leave it out", i + 1);
    return RX_OK;
}

/* A sample reduced to what t tests need. */
typedef struct moments {
    double n, mean;
    double squares;  /* sum of squared deviations, 0 when they are mere rounding */
    double rounding; /* of the mean: below it a difference is none */
} moments;

/* a - b where b is not NULL. Two passes, the second also mends the mean. */
static moments moments_of(long n, const double *a, const double *b)
{
    double start = a[0] - (b != NULL ? b[0] : 0), sum = 0, rest = 0, squares = 0, largest = 0;
    for (long i = 0; i < n; i++) {
        double v = a[i] - (b != NULL ? b[i] : 0);
        sum += v - start;
        largest = fmax(largest, fmax(fabs(a[i]), b != NULL ? fabs(b[i]) : 0));
    }
    double mean = start + sum / (double)n;
    for (long i = 0; i < n; i++) {
        double d = a[i] - (b != NULL ? b[i] : 0) - mean;
        rest += d;
        squares += d * d;
    }
    mean += rest / (double)n;
    squares = fmax(squares - rest * rest / (double)n, 0);
    double rounding = 4 * DBL_EPSILON * largest;
    if (squares <= (double)n * rounding * rounding)
        squares = 0;
    return (moments){(double)n, mean, squares, rounding};
}

static rx_test student(double difference, double error, double rounding, double dof)
{
    rx_test test = {.dof = dof};
    if (error > 0)
        test.statistic = difference / error;
    else if (fabs(difference) > rounding)
        test.statistic = copysign(INFINITY, difference);
    test.p = rx_student_p(test.statistic, dof, &test.ln_p);
    return test;
}

rx_status rx_test_two_sample(long na, const double *a, long nb, const double *b, rx_test *dst, rx_error *err)
{
    RX_TRY(check(na, a, 2, err));
    RX_TRY(check(nb, b, 2, err));
    const moments u = moments_of(na, a, NULL), v = moments_of(nb, b, NULL);
    const double dof = u.n + v.n - 2, error = sqrt((u.squares + v.squares) / dof * (1 / u.n + 1 / v.n));
    *dst = student(u.mean - v.mean, error, fmax(u.rounding, v.rounding), dof);
    return RX_OK;
}

rx_status rx_test_paired(long n, const double *a, const double *b, rx_test *dst, rx_error *err)
{
    RX_TRY(check(n, a, 2, err));
    RX_TRY(check(n, b, 2, err));
    const moments d = moments_of(n, a, b);
    *dst = student(d.mean, sqrt(d.squares / (d.n - 1) / d.n), d.rounding, d.n - 1);
    return RX_OK;
}

rx_estimate rx_mean_estimate(long n, const double *values, double level)
{
    if (n < 1)
        return (rx_estimate){NAN, NAN, NAN, 0};
    const moments m = moments_of(n, values, NULL);
    const double reach =
        n > 1 ? rx_student_quantile(1 - level, m.n - 1) * sqrt(m.squares / (m.n - 1) / m.n) : NAN;
    return (rx_estimate){m.mean, m.mean - reach, m.mean + reach, n};
}

/* P(N >= k) of a Poisson mean is P(k, mean), P(N <= k) is Q(k + 1, mean): num/special.h. */
rx_estimate rx_poisson_interval(long count, double level)
{
    double tail = 0.5 * (1 - level);
    rx_estimate e = {(double)count, 0, INFINITY, count};
    if (count < 0 || !(level > 0 && level < 1))
        return (rx_estimate){NAN, NAN, NAN, count};
    if (count > 0)
        e.low = rx_gamma_p_inverse((double)count, tail);
    e.high = rx_gamma_q_inverse((double)count + 1, tail);
    return e;
}

rx_estimate rx_poisson_rate(long count, double extent, double level)
{
    rx_estimate e = rx_poisson_interval(count, level);
    e.value /= extent;
    e.low /= extent;
    e.high /= extent;
    return e;
}

double rx_poisson_upper(long count, double level)
{
    return count >= 0 ? rx_gamma_q_inverse((double)count + 1, 1 - level) : NAN;
}

rx_status rx_five_numbers_of(long n, const double *values, rx_five_numbers *dst, rx_error *err)
{
    rx_status status = check(n, values, 1, err);
    double *sorted = status == RX_OK ? RX_NEW(double, (size_t)n) : NULL;
    if (sorted == NULL)
        return status != RX_OK ? status : rx_error_memory(err, (size_t)n * sizeof *sorted);
    memcpy(sorted, values, (size_t)n * sizeof *sorted);
    rx_sort(sorted, (size_t)n);
    *dst = (rx_five_numbers){.n = n, .mean = moments_of(n, sorted, NULL).mean};
    dst->q1 = rx_quantile(sorted, (size_t)n, 0.25); /* sorted input stays sorted */
    dst->median = rx_quantile(sorted, (size_t)n, 0.5);
    dst->q3 = rx_quantile(sorted, (size_t)n, 0.75);
    double reach = 1.5 * (dst->q3 - dst->q1);
    dst->low = dst->q1; /* a quartile between two values may have none within its reach */
    dst->high = dst->q3;
    for (long i = 0; i < n; i++) {
        if (sorted[i] < dst->q1 - reach || sorted[i] > dst->q3 + reach) {
            dst->outliers++;
            continue;
        }
        dst->low = fmin(dst->low, sorted[i]);
        dst->high = fmax(dst->high, sorted[i]);
    }
    free(sorted);
    return RX_OK;
}
