/* Counts of one run that add up over tiles: whole numbers only, so that the sum over a survey has the same
 * bits however the tiles were shared out and in whatever order they are added.
 *
 * Magnitude bins are those of a fixed grid, half a magnitude wide: bin k holds k/2 <= magnitude < (k + 1)/2.
 * Errors go into a histogram each: the median and sigma_MAD of all tiles come from it to a fraction of its
 * step, which medians of medians would not give. Its steps are 0.005 mag wide up to 0.5 mag from 0, then 0.05
 * up to 3, then 0.5 up to 50: a zero point that is wrong is reported as well.
 */
#ifndef RX_QUALITY_TALLY_H
#define RX_QUALITY_TALLY_H

#include <stdint.h>

#include "base/error.h"
#include "quality/evaluate.h"

enum {
    RX_TALLY_LOW =
        -60, /* first bin: magnitude -30; what lies outside of the grid counts in the bin at its end */
    RX_TALLY_BINS = 140,
    RX_TALLY_SIDE = 100 + 50 + 94,         /* steps on each side of 0 */
    RX_TALLY_STEPS = 2 * RX_TALLY_SIDE + 2 /* of a histogram: below, from -50 to 50 mag, above */
};

typedef struct rx_tally_bin {
    long references, found; /* by magnitude of the reference */
    long detections, right; /* by measured magnitude */
    uint32_t *dmag;         /* [RX_TALLY_STEPS] of m - m0, by magnitude of the reference; NULL: no pair */
} rx_tally_bin;

typedef struct rx_tally {
    rx_tally_bin bin[RX_TALLY_BINS];
} rx_tally;

/* Add what one evaluation counts (those without a magnitude belong to no bin, as in the report). */
rx_status rx_tally_evaluation(rx_tally *dst, const rx_evaluation *evaluation, rx_error *err);

rx_status rx_tally_add(rx_tally *dst, const rx_tally *src, rx_error *err);
void rx_tally_free(rx_tally *tally); /* content only */

/* The same of one bin; dst begins as {0}, and its dmag is the caller's to free. */
rx_status rx_tally_add_bin(rx_tally_bin *dst, const rx_tally_bin *src, rx_error *err);

/* Median of m - m0 and its sigma_MAD, mag; NAN without a pair, or where they lie outside of the histogram. */
void rx_tally_errors(const rx_tally_bin *bin, long *n, double *median, double *sigma);

#endif
