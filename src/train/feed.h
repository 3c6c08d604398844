/* Two kinds of rank, as in the paper: generators make images, the trainer takes them (par/ranks.h).
 *
 * For each epoch the trainer tells the counts per bin as soon as Eq. 4 gives them. Generators make the images
 * of the epoch in the order in which they will be used, each its share, signal ("TRUE" in the paper) when
 * their share of the epoch is complete, and go on at once with those images of the next epoch that every
 * outcome of Eq. 4 will need (low indices of every bin), within a bound on memory. Nothing of what the
 * trainer receives depends on timing: image and order follow from ids. The trainer never waits while an image
 * it needs next has come. */
#ifndef RX_TRAIN_FEED_H
#define RX_TRAIN_FEED_H

#include "base/error.h"
#include "base/log.h"
#include "par/ranks.h"
#include "train/scenes.h"

typedef struct rx_feed rx_feed;

typedef struct rx_feed_params {
    rx_scenes_params scenes; /* set is ignored: both are made */
    rx_selection grid;
    const rx_simulate_config *sim; /* same on all ranks */
    int ahead;                     /* images kept ready at most, over all generators */
} rx_feed_params;

/* Trainer's side. Generators (ranks that par says are generators) run rx_feed_generate() meanwhile. */
rx_status rx_feed_new(const rx_feed_params *par, rx_ranks *ranks, rx_feed **dst, rx_error *err);
void rx_feed_free(rx_feed *feed); /* tells generators to end */

/* Begin an epoch: its counts (selection->train, test) and its order of training images. */
rx_status rx_feed_epoch(rx_feed *feed, uint32_t epoch, const rx_selection *selection, const rx_pick *order,
                        long n, rx_error *err);

/* The next image of the epoch in order: first the n training images, then the test images, bin by bin. Waits
 * for it if it must. With several training ranks each asks for its own (position `at` in the epoch).
 * Free with rx_sample_free(). */
rx_status rx_feed_next(rx_feed *feed, long at, rx_sample **dst, rx_error *err);
long rx_feed_ready(const rx_feed *feed);    /* images waiting, for the log */
double rx_feed_waited(const rx_feed *feed); /* seconds spent waiting for images */

/* A generator's whole life. Returns when the trainer is done or gone. */
rx_status rx_feed_generate(const rx_feed_params *par, rx_ranks *ranks, rx_log *log, rx_error *err);

#endif
