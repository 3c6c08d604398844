/* The images of an epoch: each rank makes its share of them, and gets those that it trains on or tests.
 *
 * Ranks share the fields that images are cut from (train/samples.h), threads those of a rank. Every image of an epoch is
 * there before its first step: their order mixes all fields. What an image holds follows from its id, and which ranks
 * and threads there are decides nothing but where it is made.
 *
 * The validation images are an epoch of their own that has test images alone: RX_EPOCH_VALIDATION. */
#ifndef RX_TRAIN_FEED_H
#define RX_TRAIN_FEED_H

#include "base/error.h"
#include "base/log.h"
#include "train/samples.h"

typedef struct rx_feed rx_feed;

typedef struct rx_feed_params {
    rx_samples_params samples;
    rx_selection grid;             /* its counts are not used */
    const rx_simulate_config *sim; /* same on all ranks */
    int batch;                     /* images of a step, shared out in runs: the first run is rank 0's */
} rx_feed_params;

/* Errors: those of rx_samples_new(). */
rx_status rx_feed_new(const rx_feed_params *par, int nthreads, rx_log *log, rx_feed **dst, rx_error *err);
void rx_feed_free(rx_feed *feed); /* NULL is fine */

/* Make an epoch's images, on all ranks together: their counts (selection->train, test), and the order of the training
 * images, order[n]. Positions are those of the order, then from n the test images, bin by bin; training images before
 * `from` are not made. Images that were not taken before are dropped. Errors: those of rx_samples_make() on any rank. */
rx_status rx_feed_epoch(rx_feed *feed, uint32_t epoch, const rx_selection *selection, const rx_pick *order,
                        long n, long from, rx_error *err);
/* The image at a position, once; NULL where it is another rank's. Free with rx_sample_free(). */
rx_sample *rx_feed_take(rx_feed *feed, long at);

/* Images that this rank has made so far, and the seconds that it took. */
void rx_feed_made(const rx_feed *feed, long *images, double *seconds);

#endif
