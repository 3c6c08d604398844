/* Completeness magnitudes. */
#include "validate/completeness.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "validate/bootstrap.h"

int rx_bins_index(const rx_bins *bins, double mag)
{
    if (!(mag >= bins->edge[0]) || !(mag < bins->edge[bins->n]))
        return -1;
    int i = 0;
    while (mag >= bins->edge[i + 1])
        i++;
    return i;
}

static double centre(const rx_bins *bins, int i)
{
    return 0.5 * (bins->edge[i] + bins->edge[i + 1]);
}

double rx_completeness_mag(const rx_bins *bins, const double *found, const double *total, double share,
                           int *beyond)
{
    int fainter = -1;
    *beyond = 0;
    for (int i = bins->n - 1; i >= 0; i--) {
        if (total[i] < RX_COMPLETENESS_MIN)
            continue;
        double here = found[i] / total[i];
        if (here >= share && fainter < 0) {
            *beyond = 1;
            return bins->edge[i + 1];
        }
        if (here >= share) {
            double there = found[fainter] / total[fainter];
            double way = (here - share) / (here - there);
            return centre(bins, i) + way * (centre(bins, fainter) - centre(bins, i));
        }
        fainter = i;
    }
    *beyond = fainter >= 0 ? -1 : 0;
    return fainter >= 0 ? bins->edge[fainter] : NAN;
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

/* References that fall into a bin, in catalogue order. */
typedef struct reference_data {
    const rx_bins *bins;
    long n;
    const int *bin;
    const unsigned char *found;
    double share;
} reference_data;

static double resampled_mag(const void *data, const uint32_t *counts)
{
    const reference_data *in = data;
    double found[RX_MAX_BINS] = {0}, total[RX_MAX_BINS] = {0};
    int beyond;
    for (long i = 0; i < in->n; i++) {
        total[in->bin[i]] += counts[i];
        if (in->found[i])
            found[in->bin[i]] += counts[i];
    }
    double value = rx_completeness_mag(in->bins, found, total, in->share, &beyond);
    return isnan(value) ? in->bins->edge[0] - LIMIT : value + beyond * LIMIT;
}

rx_status rx_completeness(const rx_bins *bins, long n, const double *mag, const unsigned char *found,
                          double share, double level, unsigned long seed, rx_estimate *dst, rx_error *err)
{
    rx_status status = RX_OK;
    double nfound[RX_MAX_BINS] = {0}, total[RX_MAX_BINS] = {0};
    int beyond;
    *dst = (rx_estimate){NAN, -INFINITY, INFINITY, 0};
    int *bin = RX_NEW(int, (size_t)n);
    unsigned char *hit = RX_NEW(unsigned char, (size_t)n);
    if (bin == NULL || hit == NULL) {
        status = rx_error_memory(err, (size_t)n * sizeof *bin);
        goto exit;
    }
    for (long i = 0; i < n; i++) {
        int b = rx_bins_index(bins, mag[i]);
        if (b < 0)
            continue;
        bin[dst->n] = b;
        hit[dst->n++] = found[i] != 0;
        total[b] += 1;
        nfound[b] += found[i] != 0;
    }
    dst->value = rx_completeness_mag(bins, nfound, total, share, &beyond);
    if (isnan(dst->value) || dst->n < RX_BOOTSTRAP_FEWEST)
        goto exit;
    reference_data data = {.bins = bins, .n = dst->n, .bin = bin, .found = hit, .share = share};
    status = rx_bootstrap_interval(seed, 2, dst->n, resampled_mag, &data, level, dst, err);
    if (status == RX_OK)
        open_ends(dst);
exit:
    free(bin);
    free(hit);
    return status;
}
