/* Completeness magnitudes. */
#include "quality/completeness.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "quality/statistics.h"

int rx_bins_index(const rx_bins *bins, double mag)
{
    if (!(mag >= bins->edge[0]) || !(mag < bins->edge[bins->n]))
        return -1;
    int i = 0;
    while (mag >= bins->edge[i + 1])
        i++;
    return i;
}

/* Fine bins that the references are counted in: narrow against the fall of a completeness curve, which linear
 * interpolation between wide ones would move. */
enum { FINE = 36 };

typedef struct counts {
    double low, width;                          /* of the range, and of a fine bin */
    double mag[FINE], found[FINE], total[FINE]; /* sums */
} counts;

static unsigned char fine_bin(const counts *c, double mag)
{
    const int i = (int)((mag - c->low) / c->width);
    return (unsigned char)(i < 0 ? 0 : i >= FINE ? FINE - 1 : i);
}

static void count(counts *c, int i, double mag, int found, double times)
{
    c->mag[i] += times * mag;
    c->total[i] += times;
    c->found[i] += found ? times : 0.0;
}

/* The falling curve nearest to the shares, in place: where one rises, it and its neighbours take their mean.
 */
static void make_fall(int n, double *share, const double *weight)
{
    double value[FINE], sum[FINE];
    int length[FINE], pools = 0;
    for (int i = 0; i < n; i++) {
        value[pools] = share[i];
        sum[pools] = weight[i];
        length[pools++] = 1;
        for (; pools > 1 && value[pools - 2] < value[pools - 1]; pools--) {
            double both = sum[pools - 2] + sum[pools - 1];
            value[pools - 2] = (value[pools - 2] * sum[pools - 2] + value[pools - 1] * sum[pools - 1]) / both;
            sum[pools - 2] = both;
            length[pools - 2] += length[pools - 1];
        }
    }
    for (int p = 0, i = 0; p < pools; p++)
        for (int k = 0; k < length[p]; k++)
            share[i++] = value[p];
}

/* beyond: 0 the curve crosses `wanted`; +1 it is above it to the end, which is returned; -1 below from the
 * beginning. NAN with fewer than RX_COMPLETENESS_MIN references. */
static double crossing(const counts *c, double wanted, int *beyond)
{
    double mag[FINE], share[FINE], weight[FINE], all = 0.0;
    int bin[FINE], n = 0, last = -1;
    *beyond = 0;
    for (int i = 0; i < FINE; i++) {
        if (!(c->total[i] > 0.0))
            continue;
        bin[n] = i;
        mag[n] = c->mag[i] / c->total[i];
        share[n] = c->found[i] / c->total[i];
        weight[n++] = c->total[i];
        all += c->total[i];
    }
    if (all < RX_COMPLETENESS_MIN)
        return NAN;
    make_fall(n, share, weight);
    while (last + 1 < n && share[last + 1] >= wanted)
        last++;
    *beyond = last < 0 ? -1 : last == n - 1 ? 1 : 0;
    if (last < 0)
        return c->low + bin[0] * c->width;
    if (last == n - 1)
        return c->low + (bin[last] + 1) * c->width;
    return mag[last] + (share[last] - wanted) / (share[last] - share[last + 1]) * (mag[last + 1] - mag[last]);
}

/* Replicates that are only "at least" or "at most" are moved by this many magnitudes, so that they sort to
 * their end and are known there. */
static const double LIMIT = 1e6;

/* A limit can bound the interval only on the side it speaks of. */
static void open_ends(rx_estimate *dst)
{
    if (dst->low > 0.5 * LIMIT)
        dst->low -= LIMIT;
    else if (dst->low < -0.5 * LIMIT)
        dst->low = -INFINITY;
    if (dst->high < -0.5 * LIMIT)
        dst->high += LIMIT;
    else if (dst->high > 0.5 * LIMIT)
        dst->high = INFINITY;
}

/* References inside the range, in catalogue order. */
typedef struct reference_data {
    double low, width;
    long n;
    const double *mag;
    const unsigned char *bin, *found; /* bin: the fine one, which a thousand replicates ask for */
    double share;
} reference_data;

static double resampled_mag(const void *data, const uint32_t *drawn)
{
    const reference_data *in = data;
    counts c = {.low = in->low, .width = in->width};
    int beyond;
    for (long i = 0; i < in->n; i++)
        if (drawn[i] > 0)
            count(&c, in->bin[i], in->mag[i], in->found[i], drawn[i]);
    double value = crossing(&c, in->share, &beyond);
    return isnan(value) ? in->low - LIMIT : value + beyond * LIMIT;
}

rx_status rx_completeness(const rx_bins *bins, const rx_found *list, double share, double level,
                          rx_resampling by, rx_estimate *dst, rx_error *err)
{
    rx_status status = RX_OK;
    const long n = list->n;
    const double *mag = list->mag;
    counts c = {.low = bins->edge[0], .width = (bins->edge[bins->n] - bins->edge[0]) / FINE};
    int beyond;
    *dst = (rx_estimate){NAN, -INFINITY, INFINITY, 0};
    double *inside = RX_NEW(double, (size_t)n);
    unsigned char *hit = RX_NEW(unsigned char, (size_t)n), *bin = RX_NEW(unsigned char, (size_t)n);
    if (inside == NULL || hit == NULL || bin == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)n * sizeof *inside));
    for (long i = 0; i < n; i++) {
        if (rx_bins_index(bins, mag[i]) < 0)
            continue;
        inside[dst->n] = mag[i];
        hit[dst->n] = list->found[i] != 0;
        bin[dst->n] = fine_bin(&c, mag[i]);
        count(&c, bin[dst->n], mag[i], hit[dst->n], 1.0);
        dst->n++;
    }
    dst->value = crossing(&c, share, &beyond);
    if (isnan(dst->value) || dst->n < RX_BOOTSTRAP_FEWEST)
        goto exit;
    reference_data data = {
        .low = c.low, .width = c.width, .n = dst->n, .mag = inside, .bin = bin, .found = hit, .share = share};
    by.stream = 2;
    status = rx_bootstrap_interval(by, dst->n, resampled_mag, &data, level, dst, err);
    if (status == RX_OK)
        open_ends(dst);
exit:
    free(inside);
    free(hit);
    free(bin);
    return status;
}
