/* Numbers of repeatability. */
#include "survey/repeat.h"

#include <math.h>
#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "quality/evaluate.h"
#include "quality/sample.h"

static const double LEVEL = 0.95, MAGS = 1.0857362047581296; /* 2.5 / ln 10 */
static const double AM1_LOW = 240, AM1_HIGH = 360;           /* arcsec */

int rx_repeat_photometry(const double mag[2], const double error[2], double zero_point, rx_repeat_pair *dst)
{
    double flux[2], sigma[2];
    dst->dm = mag[1] - mag[0] - zero_point;
    for (int i = 0; i < 2; i++) {
        if (!isfinite(mag[i]) || !(error[i] > 0) || !isfinite(error[i]))
            return 0;
        flux[i] = pow(10, i == 0 ? 0.2 * dst->dm : -0.2 * dst->dm); /* in units of the geometric mean */
        sigma[i] = flux[i] * error[i] / MAGS;
    }
    const double both = hypot(sigma[0], sigma[1]);
    dst->error = hypot(error[0], error[1]);
    dst->pull = (flux[0] - flux[1]) / both;
    dst->snr = 0.5 * (flux[0] + flux[1]) / (M_SQRT1_2 * both);
    return 1;
}

static bool is_chosen(const rx_repeat_cut *cut, const rx_repeat_pair *p)
{
    return p->snr >= cut->snr_low && p->snr < cut->snr_high && (cut->star < 0 || p->star == cut->star);
}

static void widen(rx_estimate *e, double times)
{
    e->low = e->value - times * (e->value - e->low);
    e->high = e->value + times * (e->high - e->value);
}

/* Median and scatter of values[n] over `by`; none of fewer than RX_REPEAT_FEW. */
static void describe(double *values, long n, double by, int visits, rx_estimate *median, rx_estimate *sigma)
{
    for (long i = 0; i < n; i++)
        values[i] /= by;
    rx_robust_estimates(values, n, LEVEL, median, sigma);
    if (n < RX_REPEAT_FEW) {
        *median = (rx_estimate){NAN, -INFINITY, INFINITY, n};
        *sigma = (rx_estimate){NAN, 0, INFINITY, n};
        return;
    }
    widen(median, sqrt(0.5 * visits));
    widen(sigma, sqrt(0.5 * visits));
    sigma->low = fmax(sigma->low, 0);
}

rx_status rx_repeat_measure(const rx_repeat_cut *cut, long n, const rx_repeat_pair *pairs,
                            rx_repeat_numbers *dst, rx_error *err)
{
    enum { DM, ERROR, PULL, EAST, NORTH, COLUMNS };
    double *values = RX_NEW(double, COLUMNS *(size_t)n + 1), *column[COLUMNS], sum = 0;
    rx_estimate median;
    long outliers = 0, m = 0;
    if (values == NULL)
        return rx_error_memory(err, 0);
    *dst = (rx_repeat_numbers){.separation = NAN};
    for (int k = 0; k < COLUMNS; k++)
        column[k] = values + k * n;
    for (long i = 0; i < n; i++) {
        const rx_repeat_pair *p = &pairs[i];
        if (!is_chosen(cut, p))
            continue;
        const double of[COLUMNS] = {p->dm, p->error, p->pull, p->dx, p->dy};
        for (int k = 0; k < COLUMNS; k++)
            column[k][m] = of[k];
        outliers += fabs(p->dm) > M_SQRT2 * cut->outlier;
        sum += p->dm * p->dm;
        m++;
    }
    dst->n = m;
    dst->rms = m >= RX_REPEAT_FEW ? sqrt(0.5 * sum / (double)m) : NAN;
    dst->claimed = m > 0 ? rx_sample_quantile(column[ERROR], m, 0.5) / M_SQRT2 : NAN;
    /* as many as are independent */
    dst->outliers = rx_binomial_interval(lround(2.0 * (double)outliers / cut->visits),
                                         lround(2.0 * (double)m / cut->visits), LEVEL);
    dst->outliers.value = m > 0 ? (double)outliers / (double)m : NAN;
    dst->outliers.n = m;
    describe(column[DM], m, M_SQRT2, cut->visits, &median, &dst->scatter);
    describe(column[PULL], m, 1, cut->visits, &dst->pull_median, &dst->pull);
    for (int k = 0; k < 2; k++)
        describe(column[EAST + k], m, M_SQRT2, cut->visits, &median, &dst->axis[k]);
    free(values);
    return RX_OK;
}

static int brighter(const void *a, const void *b)
{
    const rx_repeat_pair *x = a, *y = b;
    return x->snr != y->snr ? (x->snr < y->snr ? 1 : -1) : (x->x > y->x) - (x->x < y->x);
}

rx_status rx_repeat_separations(const rx_repeat_cut *cut, long n, const rx_repeat_pair *pairs,
                                rx_repeat_numbers *dst, rx_error *err)
{
    rx_repeat_pair *chosen = RX_NEW(rx_repeat_pair, (size_t)n + 1);
    double *change = NULL;
    long m = 0, count = 0;
    rx_status status = chosen != NULL ? RX_OK : rx_error_memory(err, 0);
    for (long i = 0; i < n && status == RX_OK; i++)
        if (is_chosen(cut, &pairs[i]))
            chosen[m++] = pairs[i];
    if (m > 1)
        qsort(chosen, (size_t)m, sizeof *chosen, brighter);
    m = m < RX_REPEAT_STARS ? m : RX_REPEAT_STARS;
    if (status == RX_OK)
        status = RX_MAKE(change, (size_t)(m * m) / 2 + 1, err);
    for (long i = 0; i < m && status == RX_OK; i++) {
        const rx_repeat_pair *a = &chosen[i];
        for (long j = 0; j < i; j++) {
            const rx_repeat_pair *b = &chosen[j];
            const double x = b->x - a->x, y = b->y - a->y, apart = hypot(x, y);
            if (apart >= AM1_LOW && apart < AM1_HIGH)
                change[count++] = (hypot(x + b->dx - a->dx, y + b->dy - a->dy) - apart) / M_SQRT2;
        }
        status = rx_interrupt_check(err);
    }
    double median;
    dst->separations = count;
    dst->separation = count >= RX_REPEAT_FEW ? rx_sample_sigma(change, count, &median) : NAN;
    free(change);
    free(chosen);
    return status;
}
