/* An epoch's images: which, made by which rank, for which one. */
#include "train/feed.h"

#include <stdlib.h>

#include "base/memory.h"
#include "base/threads.h"
#include "par/ranks.h"

struct rx_feed {
    int batch, side; /* images of a step, pixels of an image */
    rx_samples *samples;
    long n, all;       /* training images of the epoch, all images */
    rx_sample **image; /* [all] by position; NULL where it is not here */
    long made;
    double seconds;
};

typedef struct job {
    rx_sample_id id;
    long at;
} job;

rx_status rx_feed_new(const rx_feed_params *par, int nthreads, rx_log *log, rx_feed **dst, rx_error *err)
{
    rx_feed *feed;
    *dst = NULL;
    RX_TRY(RX_MAKE(feed, 1, err));
    feed->batch = par->batch;
    feed->side = par->samples.side;
    const rx_status status =
        rx_samples_new(&par->samples, &par->grid, par->sim, nthreads, log, &feed->samples, err);
    if (status == RX_OK)
        *dst = feed;
    else
        free(feed);
    return status;
}

static void drop_images(rx_feed *feed)
{
    for (long at = 0; at < feed->all && feed->image != NULL; at++)
        rx_sample_free(feed->image[at]);
    free(feed->image);
    feed->image = NULL;
    feed->n = feed->all = 0;
}

void rx_feed_free(rx_feed *feed)
{
    if (feed == NULL)
        return;
    drop_images(feed);
    rx_samples_free(feed->samples);
    free(feed);
}

/* The rank that needs the image at a position. */
static int user_of(const rx_feed *feed, long at)
{
    const long within = (at < feed->n ? at : at - feed->n) % feed->batch;
    return (int)(within * rx_par_processes() / feed->batch);
}

/* Images, by set, bin and index. */
static int compare_jobs(const void *a, const void *b)
{
    const rx_sample_id *p = &((const job *)a)->id, *q = &((const job *)b)->id;
    if (p->set != q->set)
        return p->set < q->set ? -1 : 1;
    if (p->bin != q->bin)
        return p->bin < q->bin ? -1 : 1;
    return (p->index > q->index) - (p->index < q->index);
}

/* jobs[all] in the order of positions. */
static void list_jobs(const rx_selection *selection, uint32_t epoch, const rx_pick *order, long n, job *jobs)
{
    long at = 0;
    for (; at < n; at++)
        jobs[at] = (job){{epoch, RX_SET_TRAIN, order[at].bin, order[at].index}, at};
    for (int bin = 0; bin < selection->nbins; bin++)
        for (int i = 0; i < selection->test[bin]; i++, at++)
            jobs[at] = (job){{epoch, RX_SET_TEST, (uint32_t)bin, (uint32_t)i}, at};
}

/* This rank's share; images of one field are made together. */
static rx_status make_share(rx_feed *feed, const job *jobs, long from, rx_error *err)
{
    job *mine = NULL;
    rx_sample_id *ids = NULL;
    rx_sample **samples = NULL;
    long n = 0;
    const double begun = rx_seconds();
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(mine, (size_t)feed->all, err));
    RX_TRY_EXIT(RX_MAKE(ids, (size_t)feed->all, err));
    RX_TRY_EXIT(RX_MAKE(samples, (size_t)feed->all, err));
    for (long at = from; at < feed->all; at++)
        if (rx_samples_owner(feed->samples, jobs[at].id, rx_par_processes()) == rx_par_rank())
            mine[n++] = jobs[at];
    qsort(mine, (size_t)n, sizeof *mine, compare_jobs);
    for (long i = 0; i < n; i++)
        ids[i] = mine[i].id;
    status = rx_samples_make(feed->samples, ids, n, samples, err);
    for (long i = 0; i < n; i++)
        feed->image[mine[i].at] = samples[i];
    feed->made += n;
    feed->seconds += rx_seconds() - begun;
exit:
    free(mine);
    free(ids);
    free(samples);
    return status;
}

/* Every image to the rank that needs it, in the same order everywhere: no two ranks wait for each other. */
static rx_status hand_over(rx_feed *feed, const job *jobs, long from, rx_error *err)
{
    const int side = feed->side;
    for (long at = from; at < feed->all; at++) {
        const int maker = rx_samples_owner(feed->samples, jobs[at].id, rx_par_processes()),
                  user = user_of(feed, at);
        if (maker == user)
            continue;
        if (rx_par_rank() == maker) {
            RX_TRY(rx_par_send(user, feed->image[at], rx_sample_bytes(side), err));
            rx_sample_free(feed->image[at]);
            feed->image[at] = NULL;
        } else if (rx_par_rank() == user) {
            feed->image[at] = rx_sample_new(side);
            if (feed->image[at] == NULL)
                return rx_error_memory(err, rx_sample_bytes(side));
            RX_TRY(rx_par_receive(maker, feed->image[at], rx_sample_bytes(side), NULL, err));
            rx_sample_attach(feed->image[at]);
        }
    }
    return RX_OK;
}

rx_status rx_feed_epoch(rx_feed *feed, uint32_t epoch, const rx_selection *selection, const rx_pick *order,
                        long n, long from, rx_error *err)
{
    job *jobs = NULL;
    drop_images(feed);
    feed->all = feed->n = n;
    for (int bin = 0; bin < selection->nbins; bin++)
        feed->all += selection->test[bin];
    rx_status status = RX_MAKE(feed->image, (size_t)feed->all, err);
    if (status == RX_OK)
        status = RX_MAKE(jobs, (size_t)feed->all, err);
    if (status == RX_OK) {
        list_jobs(selection, epoch, order, n, jobs);
        status = make_share(feed, jobs, from, err);
    }
    status = rx_par_agree(status, err);
    if (status == RX_OK)
        status = hand_over(feed, jobs, from, err);
    free(jobs);
    return status;
}

rx_sample *rx_feed_take(rx_feed *feed, long at)
{
    rx_sample *sample = feed->image[at];
    feed->image[at] = NULL;
    return sample;
}

void rx_feed_made(const rx_feed *feed, long *images, double *seconds)
{
    *images = feed->made;
    *seconds = feed->seconds;
}
