/* The trainer's side: a place for each image of the epoch, filled as they come. */
#include "train/feed.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "train/feed_protocol.h"

enum { TELL_EVERY = 16 }; /* images between two messages that say how far the trainer is */

struct rx_feed {
    rx_ranks *ranks;
    int side, nbins, total;
    rx_feed_counts now;
    long *place_at;    /* [n] place of the training image at a position */
    long *position;    /* [n] and the other way round */
    rx_sample **image; /* [all] by place; NULL where not here */
    bool *taken;       /* [all] by place */
    long ready, used, drawn;
    double waited, drawing;
};

void rx_feed_lay_out(rx_feed_counts *counts)
{
    long place = 0;
    for (int set = RX_SET_TRAIN; set <= RX_SET_TEST; set++) {
        for (int bin = 0; bin < counts->nbins; bin++) {
            counts->first[set][bin] = place;
            place += counts->count[set][bin];
        }
        if (set == RX_SET_TRAIN)
            counts->n = place;
    }
    counts->all = place;
}

long rx_feed_place(const rx_feed_counts *counts, rx_sample_id id)
{
    if (id.epoch != counts->epoch || id.set > RX_SET_TEST || id.bin >= (uint32_t)counts->nbins ||
        id.index >= (uint32_t)counts->count[id.set][id.bin])
        return -1;
    return counts->first[id.set][id.bin] + (long)id.index;
}

rx_status rx_feed_positions(const rx_feed_counts *counts, const rx_pick *order, long n, long *position,
                            rx_error *err)
{
    if (n != counts->n)
        return rx_error_set(err, RX_USAGE, "an order of %ld images for an epoch of %ld training images", n,
                            counts->n);
    for (long place = 0; place < n; place++)
        position[place] = -1;
    for (long at = 0; at < n; at++) {
        rx_sample_id id = {counts->epoch, RX_SET_TRAIN, order[at].bin, order[at].index};
        long place = rx_feed_place(counts, id);
        if (place < 0 || position[place] >= 0)
            return rx_error_set(
                err, RX_USAGE,
                "the order of an epoch names image %u of bin %u, which is not in it or named twice",
                (unsigned)id.index, (unsigned)id.bin);
        position[place] = at;
    }
    return RX_OK;
}

rx_status rx_feed_new(const rx_feed_params *par, rx_ranks *ranks, rx_feed **dst, rx_error *err)
{
    long epoch = (long)par->grid.nbins * par->grid.total;
    *dst = NULL;
    if (par->ahead < epoch)
        return rx_error_set(
            err, RX_USAGE,
            "an epoch has %ld images and only %d may be kept ready; set IMAGES_AHEAD to at least %ld, "
            "better twice that",
            epoch, par->ahead, epoch);
    rx_feed *feed = RX_NEW(rx_feed, 1);
    if (!feed)
        return rx_error_memory(err, sizeof *feed);
    feed->ranks = ranks;
    feed->side = par->scenes.side;
    feed->nbins = par->grid.nbins;
    feed->total = par->grid.total;
    *dst = feed;
    return RX_OK;
}

/* What is left of an epoch goes. */
static void clear(rx_feed *feed)
{
    for (long place = 0; place < feed->now.all && feed->image; place++)
        rx_sample_free(feed->image[place]);
    free(feed->place_at);
    free(feed->position);
    free(feed->image);
    free(feed->taken);
    feed->place_at = feed->position = NULL;
    feed->image = NULL;
    feed->taken = NULL;
    feed->now = (rx_feed_counts){0};
    feed->ready = feed->used = 0;
}

/* To all generators. */
static rx_status tell(rx_feed *feed, int tag, const void *data, size_t size, rx_error *err)
{
    rx_status status = RX_OK;
    if (rx_ranks_rank(feed->ranks) != 0)
        return RX_OK;
    for (int to = rx_ranks_trainers(feed->ranks); to < rx_ranks_count(feed->ranks) && status == RX_OK; to++)
        status = rx_ranks_send(feed->ranks, to, tag, data, size, err);
    return status;
}

void rx_feed_free(rx_feed *feed)
{
    if (!feed)
        return;
    tell(feed, RX_FEED_END, NULL, 0, NULL); /* a generator that cannot be told sees that this rank is gone */
    clear(feed);
    free(feed);
}

/* --- an epoch begins --- */

static rx_status read_counts(rx_feed *feed, uint32_t epoch, const rx_selection *selection, rx_error *err)
{
    if (selection->nbins != feed->nbins || selection->total != feed->total)
        return rx_error_set(err, RX_USAGE,
                            "an epoch of %d bins and %d images in each where the feed has %d and %d",
                            selection->nbins, selection->total, feed->nbins, feed->total);
    feed->now.epoch = epoch;
    feed->now.nbins = selection->nbins;
    feed->now.active = selection->active;
    for (int bin = 0; bin < selection->nbins; bin++) {
        int train = selection->train[bin], test = selection->test[bin];
        if (train < 0 || test < 0 || train + test > selection->total)
            return rx_error_set(err, RX_USAGE, "bin %d has %d training and %d test images of %d", bin, train,
                                test, selection->total);
        feed->now.count[RX_SET_TRAIN][bin] = train;
        feed->now.count[RX_SET_TEST][bin] = test;
    }
    rx_feed_lay_out(&feed->now);
    return RX_OK;
}

static rx_status make_places(rx_feed *feed, const rx_pick *order, long n, rx_error *err)
{
    size_t all = (size_t)feed->now.all, training = (size_t)feed->now.n;
    feed->place_at = RX_NEW(long, training);
    feed->position = RX_NEW(long, training);
    feed->image = RX_NEW(rx_sample *, all);
    feed->taken = RX_NEW(bool, all);
    if (!feed->place_at || !feed->position || !feed->image || !feed->taken)
        return rx_error_memory(err, all * sizeof *feed->image);
    rx_status status = rx_feed_positions(&feed->now, order, n, feed->position, err);
    for (long place = 0; place < n && status == RX_OK; place++)
        feed->place_at[feed->position[place]] = place;
    return status;
}

static rx_status tell_epoch(rx_feed *feed, const rx_pick *order, rx_error *err)
{
    size_t size = sizeof feed->now + (size_t)feed->now.n * sizeof *order;
    unsigned char *text = RX_NEW(unsigned char, size);
    if (!text)
        return rx_error_memory(err, size);
    memcpy(text, &feed->now, sizeof feed->now);
    if (feed->now.n > 0)
        memcpy(text + sizeof feed->now, order, (size_t)feed->now.n * sizeof *order);
    rx_status status = tell(feed, RX_FEED_EPOCH, text, size, err);
    free(text);
    return status;
}

rx_status rx_feed_epoch(rx_feed *feed, uint32_t epoch, const rx_selection *selection, const rx_pick *order,
                        long n, rx_error *err)
{
    clear(feed);
    rx_status status = read_counts(feed, epoch, selection, err);
    if (status == RX_OK)
        status = make_places(feed, order, n, err);
    if (status == RX_OK)
        status = tell_epoch(feed, order, err);
    if (status != RX_OK)
        clear(feed);
    return status;
}

/* --- images come and go --- */

static bool is_mine(const rx_feed *feed, long place)
{
    long at = place < feed->now.n ? feed->position[place] : place;
    return at % rx_ranks_trainers(feed->ranks) == rx_ranks_rank(feed->ranks);
}

/* Images of an epoch that was left early, or that come a second time because it was begun again, are dropped;
 * what an image holds follows from its id, so it does not matter which one is kept. */
static rx_status keep_image(rx_feed *feed, const rx_message *message, rx_error *err)
{
    rx_sample *sample = message->data;
    if (message->size != rx_sample_bytes(feed->side) || sample->side != feed->side) {
        free(message->data);
        return rx_error_set(err, RX_SYSTEM,
                            "rank %d sent an image of %zu bytes, not %zu; all ranks must run the "
                            "same program with the same configuration",
                            message->from, message->size, rx_sample_bytes(feed->side));
    }
    rx_sample_attach(sample);
    long place = feed->image ? rx_feed_place(&feed->now, sample->id) : -1;
    if (place < 0 || !is_mine(feed, place) || feed->image[place] || feed->taken[place]) {
        rx_sample_free(sample);
        return RX_OK;
    }
    feed->image[place] = sample;
    feed->ready++;
    return RX_OK;
}

static rx_status take_message(rx_feed *feed, rx_message *message, rx_error *err)
{
    if (message->tag == RX_FEED_IMAGE)
        return keep_image(feed, message, err);
    if (message->tag == RX_FEED_COMPLETE && message->size == sizeof(rx_feed_done)) {
        const rx_feed_done *done = message->data;
        feed->drawn += done->drawn;
        feed->drawing += done->seconds;
    }
    free(message->data);
    return RX_OK;
}

/* All that has come; with wait at least one message. */
static rx_status take_messages(rx_feed *feed, int wait, rx_error *err)
{
    for (;;) {
        rx_message message;
        rx_status status = rx_ranks_receive(feed->ranks, wait, &message, err);
        if (status != RX_OK || message.from < 0)
            return status;
        status = take_message(feed, &message, err);
        if (status != RX_OK)
            return status;
        wait = 0;
    }
}

static rx_status tell_progress(rx_feed *feed, long used, rx_error *err)
{
    rx_feed_progress progress = {.epoch = feed->now.epoch, .used = used * rx_ranks_trainers(feed->ranks)};
    return tell(feed, RX_FEED_PROGRESS, &progress, sizeof progress, err);
}

static rx_status check_position(const rx_feed *feed, long at, long *place, rx_error *err)
{
    int trainers = rx_ranks_trainers(feed->ranks), rank = rx_ranks_rank(feed->ranks);
    if (!feed->image || at < 0 || at >= feed->now.all)
        return rx_error_set(err, RX_USAGE, "image %ld of an epoch of %ld", at, feed->now.all);
    *place = at < feed->now.n ? feed->place_at[at] : at;
    if (at % trainers != rank || feed->taken[*place])
        return rx_error_set(err, RX_USAGE, "image %ld of the epoch is not for rank %d, or was taken before",
                            at, rank);
    return RX_OK;
}

rx_status rx_feed_next(rx_feed *feed, long at, rx_sample **dst, rx_error *err)
{
    long place = 0;
    *dst = NULL;
    rx_status status = check_position(feed, at, &place, err);
    if (status == RX_OK)
        status = take_messages(feed, 0, err);
    if (status == RX_OK && !feed->image[place]) {
        double begun = rx_seconds();
        while (status == RX_OK && !feed->image[place])
            status = take_messages(feed, 1, err);
        feed->waited += rx_seconds() - begun;
    }
    if (status == RX_OK && (feed->used + 1) % TELL_EVERY == 0)
        status = tell_progress(feed, feed->used + 1, err);
    if (status != RX_OK)
        return status;
    *dst = feed->image[place];
    feed->image[place] = NULL;
    feed->taken[place] = true;
    feed->ready--;
    feed->used++;
    return RX_OK;
}

double rx_feed_waited(const rx_feed *feed)
{
    return feed->waited;
}

void rx_feed_drawn(const rx_feed *feed, long *images, double *seconds)
{
    *images = feed->drawn;
    *seconds = feed->drawing;
}
