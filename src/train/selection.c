/* Eq. 4 and the order of an epoch. */
#include "train/selection.h"

#include <math.h>

#include "base/memory.h"
#include "base/random.h"
#include "num/stats.h"

enum { LEAST_TOTAL = RX_TEST_LEAST + 2 };

/* Shuffles are apart from every other use of the training's seed. */
#define SHUFFLE_SEED 0x6f72646572000000u

/* Without active learning the test needs no more images than a steady dictionary does. */
static const double UNIFORM_LIST = 0.9;

/* train = (total - 10) list to the nearest integer, what is left goes to the test. */
static void count(rx_selection *selection)
{
    for (int b = 0; b < selection->nbins; b++) {
        const double list = selection->active ? selection->list[b] : UNIFORM_LIST;
        selection->train[b] = (int)lround((selection->total - RX_TEST_LEAST) * list);
        selection->test[b] = selection->total - selection->train[b];
    }
}

static rx_status check_range(const char *what, const double range[2], rx_error *err)
{
    return isfinite(range[0]) && isfinite(range[1]) && range[0] < range[1] && range[0] > 0.0
               ? RX_OK
               : rx_error_set(err, RX_USAGE, "%s from %g to %g: the smaller comes first, above 0", what,
                              range[0], range[1]);
}

rx_status rx_selection_begin(const int bins[2], const double fwhm[2], const double sigma[2], int total,
                             int active, rx_selection *dst, rx_error *err)
{
    const int nfwhm = bins[0], nsigma = bins[1];
    if (nfwhm < 1 || nsigma < 1 || nfwhm > RX_BINS_MAX || nsigma > RX_BINS_MAX / nfwhm)
        return rx_error_set(err, RX_USAGE, "a grid of %d x %d bins: 1 to %d bins in all are possible", nfwhm,
                            nsigma, (int)RX_BINS_MAX);
    if (total < LEAST_TOTAL)
        return rx_error_set(err, RX_USAGE, "%d images per bin: at least %d, as %d of them are for the test",
                            total, (int)LEAST_TOTAL, (int)RX_TEST_LEAST);
    RX_TRY(check_range("FWHM", fwhm, err));
    RX_TRY(check_range("noise", sigma, err));
    *dst = (rx_selection){.nfwhm = nfwhm,
                          .nsigma = nsigma,
                          .nbins = nfwhm * nsigma,
                          .fwhm = {fwhm[0], fwhm[1]},
                          .sigma = {sigma[0], sigma[1]},
                          .total = total,
                          .active = active};
    for (int b = 0; b < dst->nbins; b++) {
        dst->loss[b] = NAN;
        dst->list[b] = active ? 0.5 : UNIFORM_LIST;
    }
    count(dst);
    return RX_OK;
}

/* NAN when there is no such thing. */
static double mean_of(double sum, long number)
{
    double mean = number > 0 ? sum / (double)number : NAN;
    return isfinite(mean) && mean >= 0.0 ? mean : NAN;
}

void rx_selection_update(rx_selection *selection, const double *sum, const long *number)
{
    double means[RX_BINS_MAX];
    size_t n = 0;
    for (int b = 0; b < selection->nbins; b++) {
        const double mean = mean_of(sum[b], number[b]);
        if (isnan(mean))
            continue;
        selection->loss[b] = mean;
        means[n++] = mean;
    }
    const double median = n > 0 ? rx_median(means, n) : 0;
    for (int b = 0; b < selection->nbins && median > 0; b++) {
        const double mean = mean_of(sum[b], number[b]);
        if (!isnan(mean))
            selection->list[b] = fmin(1, mean / (2 * median));
    }
    count(selection);
}

static void cell(const double range[2], int n, int i, double dst[2])
{
    dst[0] = range[0] + (range[1] - range[0]) * i / n;
    dst[1] = i + 1 == n ? range[1] : range[0] + (range[1] - range[0]) * (i + 1) / n;
}

void rx_selection_bin(const rx_selection *selection, int bin, double fwhm[2], double sigma[2])
{
    cell(selection->fwhm, selection->nfwhm, bin % selection->nfwhm, fwhm);
    cell(selection->sigma, selection->nsigma, bin / selection->nfwhm, sigma);
}

rx_status rx_selection_order(const rx_selection *selection, uint64_t seed, uint32_t epoch, rx_pick **order,
                             long *n, rx_error *err)
{
    long total = 0, at = 0;
    *order = NULL;
    *n = 0;
    for (int b = 0; b < selection->nbins; b++)
        total += selection->train[b];
    rx_pick *list;
    RX_TRY(RX_MAKE(list, (size_t)total, err));
    for (int b = 0; b < selection->nbins; b++)
        for (int i = 0; i < selection->train[b]; i++)
            list[at++] = (rx_pick){.bin = (uint32_t)b, .index = (uint32_t)i};
    /* Fisher and Yates; the products of 52-bit uniforms with n are even to 1e-11 for any n here */
    for (long i = total - 1; i > 0; i--) {
        const double uniform = rx_random_uniform(seed ^ SHUFFLE_SEED, epoch, (uint64_t)i);
        const long j = (long)(uniform * (double)(i + 1));
        const rx_pick held = list[i];
        list[i] = list[j];
        list[j] = held;
    }
    *order = list;
    *n = total;
    return RX_OK;
}
