/* Active learning, Eq. 4 of the paper: how many training and test images each bin of (FWHM, sigma) gets.
 *
 *   test = (total - 10) (1 - list) + 10,   train = (total - 10) list
 *   list = mean test loss / (2 medians of the bins' mean test losses), at most 1
 *
 * rounded so that train + test = total. The paper says "normalised" and not by what; by the largest mean, one
 * bin with one bad image would leave all others nearly without training, while with the median the usual bin
 * stays at 1/2, and bins twice as bad and worse get all there is. Uniform sampling takes list = 9/10
 * everywhere.
 */
#ifndef RX_TRAIN_SELECTION_H
#define RX_TRAIN_SELECTION_H

#include <stdint.h>

#include "base/error.h"

enum { RX_TEST_LEAST = 10, RX_BINS_MAX = 400 };

typedef struct rx_selection {
    int nfwhm, nsigma, nbins; /* bin = isigma * nfwhm + ifwhm */
    double fwhm[2], sigma[2]; /* range of the grid; cells of equal width, FWHM linear; sigma linear too */
    int total;                /* images per bin and epoch, >= 12 */
    int active;               /* 0: uniform */
    double loss[RX_BINS_MAX]; /* mean test loss of each bin in the last epoch; NAN: none yet */
    double list[RX_BINS_MAX]; /* normalised; active: 1/2 before the first epoch */
    int train[RX_BINS_MAX], test[RX_BINS_MAX]; /* counts of the next epoch */
} rx_selection;

/* Counts before any loss is known; bins: nfwhm, nsigma. Errors: RX_USAGE. */
rx_status rx_selection_begin(const int bins[2], const double fwhm[2], const double sigma[2], int total,
                             int active, rx_selection *dst, rx_error *err);

/* Dictionary and counts from the sums over the epoch's test images: sum[b] of count[b] images. A bin without
 * a finite mean keeps its list. */
void rx_selection_update(rx_selection *selection, const double *sum, const long *count);

/* Limits of a bin. */
void rx_selection_bin(const rx_selection *selection, int bin, double fwhm[2], double sigma[2]);

/* The epoch's order of training samples: order[n], n = sum of train, each naming bin and index; a permutation
 * that depends on (seed, epoch) only. Caller frees. */
typedef struct rx_pick {
    uint32_t bin, index;
} rx_pick;
rx_status rx_selection_order(const rx_selection *selection, uint64_t seed, uint32_t epoch, rx_pick **order,
                             long *n, rx_error *err);

#endif
