/* Tests by Student's t, Holm's correction, Poisson limits, box plots. Wilcoxon is in wilcoxon.c. */
#include "quality/hypothesis.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/special.h"
#include "num/stats.h"
#include "quality/bootstrap.h"
#include "quality/sample.h"

static const double LEVEL = 0.95;

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

/* t of `difference` with standard error `error` and all that follows from it. */
static void finish(double difference, double error, double spread, double rounding, double dof, long n,
                   rx_test *dst)
{
    *dst = (rx_test){.dof = dof};
    if (error > 0) {
        double reach = rx_student_quantile(1 - LEVEL, dof) * error;
        dst->statistic = difference / error;
        dst->effect = difference / spread;
        dst->difference = (rx_estimate){difference, difference - reach, difference + reach, n};
    } else {
        if (fabs(difference) <= rounding)
            difference = 0;
        dst->statistic = dst->effect = difference == 0 ? 0 : copysign(INFINITY, difference);
        dst->difference = (rx_estimate){difference, difference, difference, n};
    }
    dst->p = rx_student_p(dst->statistic, dof, &dst->ln_p);
}

static rx_status check_two(long na, const double *a, long nb, const double *b, rx_error *err)
{
    rx_status status = rx_sample_check(na, a, 2, "first", err);
    return status == RX_OK ? rx_sample_check(nb, b, 2, "second", err) : status;
}

rx_status rx_test_two_sample(long na, const double *a, long nb, const double *b, rx_test *dst, rx_error *err)
{
    RX_TRY(check_two(na, a, nb, b, err));
    moments u = moments_of(na, a, NULL), v = moments_of(nb, b, NULL);
    double dof = u.n + v.n - 2, spread = sqrt((u.squares + v.squares) / dof);
    finish(u.mean - v.mean, spread * sqrt(1 / u.n + 1 / v.n), spread, fmax(u.rounding, v.rounding), dof,
           na + nb, dst);
    return RX_OK;
}

rx_status rx_test_paired(long n, const double *a, const double *b, rx_test *dst, rx_error *err)
{
    RX_TRY(check_two(n, a, n, b, err));
    moments d = moments_of(n, a, b);
    double spread = sqrt(d.squares / (d.n - 1));
    finish(d.mean, spread / sqrt(d.n), spread, d.rounding, d.n - 1, n, dst);
    return RX_OK;
}

typedef struct pairs {
    long n;
    const double *difference;
} pairs;

static double resampled_mean(const void *data, const uint32_t *counts)
{
    const pairs *p = data;
    double sum = 0;
    for (long i = 0; i < p->n; i++)
        sum += counts[i] * p->difference[i];
    return sum / (double)p->n;
}

rx_status rx_paired_bootstrap(long n, const double *a, const double *b, double level, uint64_t seed,
                              rx_estimate *dst, rx_error *err)
{
    const rx_resampling by = {seed, 1, 17}; /* apart from the streams of metrics.c */
    double *difference = NULL;
    rx_status status = RX_OK;
    RX_TRY(rx_sample_difference(n, a, b, 1, &difference, err));
    *dst = (rx_estimate){moments_of(n, a, b).mean, -INFINITY, INFINITY, n};
    if (n >= RX_BOOTSTRAP_FEWEST)
        status = rx_bootstrap_interval(by, n, resampled_mean, &(pairs){n, difference}, level, dst, err);
    free(difference);
    return status;
}

typedef struct ranked {
    double value;
    long index;
} ranked;

static int by_value(const void *left, const void *right)
{
    const ranked *l = left, *r = right;
    if (l->value != r->value)
        return l->value > r->value ? 1 : -1;
    return (l->index > r->index) - (l->index < r->index);
}

/* The smallest p is multiplied by n, the next by n - 1 ..., and none may fall below the one before it. */
rx_status rx_holm(long n, const double *p, double *adjusted, rx_error *err)
{
    double highest = 0;
    for (long i = 0; i < n; i++)
        if (!(p[i] >= 0 && p[i] <= 1))
            return rx_error_set(err, RX_INPUT, "p %g of test %ld is not that of a probability", p[i], i + 1);
    ranked *order = RX_NEW(ranked, (size_t)(n > 0 ? n : 0));
    if (order == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *order);
    for (long i = 0; i < n; i++)
        order[i] = (ranked){p[i], i};
    if (n > 0)
        qsort(order, (size_t)n, sizeof *order, by_value);
    for (long i = 0; i < n; i++) {
        highest = fmax(highest, fmin(order[i].value * (double)(n - i), 1));
        adjusted[order[i].index] = highest;
    }
    free(order);
    return RX_OK;
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
    rx_status status = rx_sample_check(n, values, 1, "only", err);
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
