/* Two kinds of rank, as in the paper: generators make images, the trainer takes them (par/ranks.h).
 *
 * For each epoch the trainer sends the counts per bin as soon as Eq. 4 gives them. Each generator makes its
 * share of the epoch's images, a field's worth of one bin after the other (cheapest), in the order in which
 * the trainer will first need one of them, signals ("TRUE" in the paper) when its share is complete, and goes
 * on at once with images that the next epoch will probably need (the counts of this one and an eighth more,
 * low indices of every bin), which it keeps until the next counts are known, then sends or drops.
 *
 * Every image of an epoch may be needed before its end, so one epoch must fit: `ahead` bounds the images that
 * wait at the trainer and those made for the next epoch together; the trainer says how far it is. Twice an
 * epoch's images never hold a generator up.
 *
 * The validation images are asked for once, before the first epoch, as an epoch of its own that has test
 * images alone: RX_EPOCH_VALIDATION. Their seed is apart from SEED, so that trainings of the same sky and
 * another SEED are judged by the same images.
 *
 * Nothing of what the trainer receives depends on timing: image and order follow from ids. The trainer never
 * waits while an image it needs next has come. */
#ifndef RX_TRAIN_FEED_H
#define RX_TRAIN_FEED_H

#include "base/error.h"
#include "base/log.h"
#include "par/ranks.h"
#include "train/scenes.h"

typedef struct rx_feed rx_feed;

typedef struct rx_feed_params {
    rx_scenes_params scenes;       /* set is ignored: both are made */
    rx_selection grid;             /* its counts are not used */
    const rx_simulate_config *sim; /* same on all ranks; read only */
    int ahead; /* images kept ready at most, over all ranks; at least an epoch's: grid.nbins * grid.total */
} rx_feed_params;

/* Trainer's side. Generators (ranks that par says are generators) run rx_feed_generate() meanwhile. `ranks`
 * must outlive the feed. Errors: RX_USAGE (ahead below an epoch), RX_SYSTEM. */
rx_status rx_feed_new(const rx_feed_params *par, rx_ranks *ranks, rx_feed **dst, rx_error *err);
void rx_feed_free(rx_feed *feed); /* makes generators end */

/* Begin an epoch, any number: its counts (selection->train, test) and its order of training images, order[n],
 * a permutation of all of selection->train. With several training ranks all call it alike. Images of an epoch
 * before that were not taken are dropped. Errors: RX_USAGE (no permutation), RX_SYSTEM or a failed rank's. */
rx_status rx_feed_epoch(rx_feed *feed, uint32_t epoch, const rx_selection *selection, const rx_pick *order,
                        long n, rx_error *err);

/* The image at position `at` of the epoch: first the n training images in order, then from n the test images,
 * bin by bin. Waits for it if it must. With several training ranks each asks for its own, at mod trainers ==
 * its rank. Each is given once, in any order (rising is quickest). Free with rx_sample_free().
 * Errors: RX_USAGE (not this rank's, or taken already), RX_INTERRUPTED (single trainer), RX_SYSTEM or a
 * failed generator's. */
rx_status rx_feed_next(rx_feed *feed, long at, rx_sample **dst, rx_error *err);
double rx_feed_waited(const rx_feed *feed); /* seconds spent waiting for images */
/* Rank 0 knows, of what generators have reported so far: generators whose share of this epoch is complete; images
 * made for a next epoch that did not need them. */
/* What rank 0 knows of the generators' work: images, and the seconds of all generators that they
 * took. */
void rx_feed_drawn(const rx_feed *feed, long *images, double *seconds);

/* A generator's whole life. Returns RX_OK when the trainer is done or gone; an error of its own has been reported
 * to the training ranks (it is what they return). */
rx_status rx_feed_generate(const rx_feed_params *par, rx_ranks *ranks, rx_log *log, rx_error *err);

#endif
