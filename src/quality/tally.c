/* Counts that add up. */
#include "quality/tally.h"

#include <math.h>
#include <stdlib.h>

#include "base/constants.h"
#include "base/memory.h"

static const double END = 50; /* mag, of the histogram on each side */

static rx_tally_bin *bin_of(rx_tally *tally, double magnitude)
{
    int k = (int)floor(2 * fmax(-1e6, fmin(1e6, magnitude))) - RX_TALLY_LOW;
    k = k < 0 ? 0 : k >= RX_TALLY_BINS ? RX_TALLY_BINS - 1 : k;
    return &tally->bin[k];
}

/* How many steps of the histogram an error of so many mag is away from 0. */
static double steps_of(double dmag)
{
    static const struct {
        double from, step;
    } zones[] = {{0, 0.005}, {0.5, 0.05}, {3, 0.5}, {50, 1}};
    const double size = fmin(fabs(dmag), END);
    double n = 0;
    for (int z = 0; z < 3 && size > zones[z].from; z++)
        n += (fmin(size, zones[z + 1].from) - zones[z].from) / zones[z].step;
    return copysign(n, dmag);
}

static rx_status make_room(rx_tally_bin *bin, rx_error *err)
{
    return bin->dmag != NULL ? RX_OK : RX_MAKE(bin->dmag, RX_TALLY_STEPS, err);
}

rx_status rx_tally_evaluation(rx_tally *dst, const rx_evaluation *e, rx_error *err)
{
    for (long i = 0; i < e->input->truth.n; i++) {
        if (e->truth_role[i] == RX_ROLE_IGNORED || !isfinite(e->truth_mag[i]))
            continue;
        rx_tally_bin *bin = bin_of(dst, e->truth_mag[i]);
        bin->references++;
        bin->found += e->truth_role[i] == RX_ROLE_MATCHED;
    }
    for (long j = 0; j < e->run->list.n; j++) {
        if (e->run_role[j] == RX_ROLE_IGNORED || !isfinite(e->run_mag[j]))
            continue;
        rx_tally_bin *bin = bin_of(dst, e->run_mag[j]);
        bin->detections++;
        bin->right += e->run_role[j] == RX_ROLE_MATCHED;
        if (e->run_role[j] != RX_ROLE_MATCHED || !isfinite(e->dmag[j]))
            continue;
        bin = bin_of(dst, e->truth_mag[e->origin[j]]);
        RX_TRY(make_room(bin, err));
        bin->dmag[e->dmag[j] < -END   ? 0
                  : e->dmag[j] >= END ? RX_TALLY_STEPS - 1
                                      : 1 + RX_TALLY_SIDE + (int)floor(steps_of(e->dmag[j]))]++;
    }
    return RX_OK;
}

rx_status rx_tally_add_bin(rx_tally_bin *dst, const rx_tally_bin *src, rx_error *err)
{
    dst->references += src->references;
    dst->found += src->found;
    dst->detections += src->detections;
    dst->right += src->right;
    if (src->dmag == NULL)
        return RX_OK;
    RX_TRY(make_room(dst, err));
    for (int k = 0; k < RX_TALLY_STEPS; k++)
        dst->dmag[k] += src->dmag[k];
    return RX_OK;
}

rx_status rx_tally_add(rx_tally *dst, const rx_tally *src, rx_error *err)
{
    for (int b = 0; b < RX_TALLY_BINS; b++)
        RX_TRY(rx_tally_add_bin(&dst->bin[b], &src->bin[b], err));
    return RX_OK;
}

void rx_tally_free(rx_tally *tally)
{
    for (int b = 0; b < RX_TALLY_BINS; b++) {
        free(tally->bin[b].dmag);
        tally->bin[b].dmag = NULL;
    }
}

/* Count of pairs with an error below `at`, the pairs of a step spread evenly over it; sum[k]: those of the
 * steps before k. */
static double below(const uint32_t *steps, const double *sum, double at)
{
    if (at <= -END)
        return 0;
    if (at >= END)
        return sum[RX_TALLY_STEPS - 1];
    const double u = steps_of(at) + RX_TALLY_SIDE;
    const int k = (int)u + 1;
    return sum[k] + (u - (k - 1)) * (double)steps[k];
}

/* By bisection: the error that `wanted` pairs lie below or, folded, the distance from `centre` that they lie
 * within. */
static double middle(const uint32_t *steps, const double *sum, double centre, int folded, double wanted)
{
    double low = folded ? 0 : -END, high = folded ? 2 * END : END;
    for (int i = 0; i < 60; i++) {
        const double x = 0.5 * (low + high);
        const double n =
            folded ? below(steps, sum, centre + x) - below(steps, sum, centre - x) : below(steps, sum, x);
        if (n < wanted)
            low = x;
        else
            high = x;
    }
    return 0.5 * (low + high);
}

void rx_tally_errors(const rx_tally_bin *bin, long *n, double *median, double *sigma)
{
    double sum[RX_TALLY_STEPS];
    *n = 0;
    *median = *sigma = NAN;
    for (int k = 0; bin->dmag != NULL && k < RX_TALLY_STEPS; k++) {
        sum[k] = (double)*n;
        *n += bin->dmag[k];
    }
    if (*n == 0)
        return;
    const double half = 0.5 * (double)*n;
    if ((double)bin->dmag[0] >= half || (double)bin->dmag[RX_TALLY_STEPS - 1] >= half)
        return;
    *median = middle(bin->dmag, sum, 0, 0, half);
    const double spread = middle(bin->dmag, sum, *median, 1, half);
    if (fabs(*median) + spread < END)
        *sigma = RX_MAD_SIGMA * spread;
}
