/* What the two sides of the feed say to each other, and how an epoch is laid out. */
#ifndef RX_TRAIN_FEED_PROTOCOL_H
#define RX_TRAIN_FEED_PROTOCOL_H

#include "train/feed.h"

/* Tags. EPOCH: rx_feed_counts and order[n]; PROGRESS: rx_feed_progress; END: nothing; IMAGE: the bytes of an
 * rx_sample; COMPLETE: rx_feed_done. */
enum { RX_FEED_EPOCH = 3, RX_FEED_PROGRESS, RX_FEED_END, RX_FEED_IMAGE, RX_FEED_COMPLETE };

/* Places of an epoch's images: of training image (bin, index) first[RX_SET_TRAIN][bin] + index, of a test
 * image first[RX_SET_TEST][bin] + index; test images follow all training images and their place is also their
 * position. */
typedef struct rx_feed_counts {
    uint32_t epoch;
    int nbins, active;
    int count[2][RX_BINS_MAX];
    long first[2][RX_BINS_MAX];
    long n, all; /* training images, all images */
} rx_feed_counts;

typedef struct rx_feed_progress {
    uint32_t epoch;
    long used; /* images taken, over all training ranks */
} rx_feed_progress;

typedef struct rx_feed_done {
    uint32_t epoch;
    long made;
    long drawn;     /* images made since the last such message, those for the next epoch included */
    double seconds; /* that took */
} rx_feed_done;

/* Fill first, n and all from count and nbins. */
void rx_feed_lay_out(rx_feed_counts *counts);
/* Place of an image, -1 when the epoch has none of that name. */
long rx_feed_place(const rx_feed_counts *counts, rx_sample_id id);
/* position[n] of the training image in each place; the training rank of an image is its position modulo the
 * number of them. Errors: RX_USAGE when order[n] is no permutation of the training images. */
rx_status rx_feed_positions(const rx_feed_counts *counts, const rx_pick *order, long n, long *position,
                            rx_error *err);

/* Which generator (0 .. generators-1) makes an image: images of one field are made by one of them. */
int rx_feed_owner(const rx_feed_params *par, rx_sample_id id, int generators);

/* rx_feed_generate() with any maker of images. */
typedef rx_status rx_feed_maker(void *user, rx_sample_id id, rx_sample *dst, rx_error *err);
rx_status rx_feed_generate_with(const rx_feed_params *par, rx_ranks *ranks, rx_feed_maker *make, void *user,
                                rx_error *err);

#endif
