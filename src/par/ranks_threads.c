/* Ranks as threads of one process: a letter box for each behind one lock. */
#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/memory.h"
#include "par/transport.h"

typedef struct box {
    rx_parcels parcels;
    pthread_cond_t filled;
    bool gone; /* its rank has ended */
} box;

typedef struct hub hub;

typedef struct member {
    rx_ranks ranks; /* of a generator's thread; rank 0 has its own struct */
    hub *all;
    pthread_t thread;
} member;

struct hub {
    pthread_mutex_t lock;
    int count, running; /* boxes, threads */
    box *boxes;         /* [count] */
    member *members;    /* [count - 1] */
    rx_rank_run run;
    void *user;
};

static rx_status send_parcel(rx_ranks *ranks, int to, rx_parcel *parcel, rx_error *err)
{
    (void)err;
    hub *all = ranks->link;
    pthread_mutex_lock(&all->lock);
    bool keep = !all->boxes[to].gone;
    if (keep)
        rx_parcels_add(&all->boxes[to].parcels, parcel);
    pthread_cond_signal(&all->boxes[to].filled);
    pthread_mutex_unlock(&all->lock);
    if (!keep) /* no rank is there to read it */
        rx_parcel_free(parcel);
    return RX_OK;
}

static rx_status poll_parcel(rx_ranks *ranks, rx_parcel **dst, rx_error *err)
{
    (void)err;
    hub *all = ranks->link;
    pthread_mutex_lock(&all->lock);
    rx_parcels *list = &all->boxes[ranks->rank].parcels;
    *dst = list->first;
    if (*dst) {
        list->first = (*dst)->next;
        if (!list->first)
            list->last = NULL;
    }
    pthread_mutex_unlock(&all->lock);
    return RX_OK;
}

static bool is_gone(rx_ranks *ranks, int rank)
{
    hub *all = ranks->link;
    pthread_mutex_lock(&all->lock);
    bool gone = all->boxes[rank].gone;
    pthread_mutex_unlock(&all->lock);
    return gone;
}

/* Signals do not wake a thread that waits, so it looks up 20 times a second. */
static void wait_for_parcel(rx_ranks *ranks, long round)
{
    (void)round;
    hub *all = ranks->link;
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += 50 * 1000 * 1000;
    if (until.tv_nsec >= 1000 * 1000 * 1000) {
        until.tv_nsec -= 1000 * 1000 * 1000;
        until.tv_sec++;
    }
    pthread_mutex_lock(&all->lock);
    if (!all->boxes[ranks->rank].parcels.first)
        pthread_cond_timedwait(&all->boxes[ranks->rank].filled, &all->lock, &until);
    pthread_mutex_unlock(&all->lock);
}

/* The rank ends: everybody who waits looks up. */
static void leave(hub *all, int rank)
{
    pthread_mutex_lock(&all->lock);
    all->boxes[rank].gone = true;
    for (int i = 0; i < all->count; i++)
        pthread_cond_broadcast(&all->boxes[i].filled);
    pthread_mutex_unlock(&all->lock);
}

static void *live(void *arg)
{
    member *self = arg;
    self->all->run(self->all->user, &self->ranks);
    leave(self->all, self->ranks.rank);
    rx_parcels_free(&self->ranks.arrived);
    return NULL;
}

static void stop_threads(rx_ranks *ranks)
{
    hub *all = ranks->link;
    leave(all, 0);
    for (int i = 0; i < all->running; i++)
        pthread_join(all->members[i].thread, NULL);
    for (int i = 0; i < all->count; i++) {
        rx_parcels_free(&all->boxes[i].parcels);
        pthread_cond_destroy(&all->boxes[i].filled);
    }
    pthread_mutex_destroy(&all->lock);
    free(all->boxes);
    free(all->members);
    free(all);
}

static const rx_transport threads = {send_parcel, poll_parcel, is_gone, wait_for_parcel, stop_threads};

/* Signals are for the thread of rank 0. */
static int start_thread(member *self)
{
    sigset_t every, before;
    sigfillset(&every);
    pthread_sigmask(SIG_SETMASK, &every, &before);
    int failed = pthread_create(&self->thread, NULL, live, self);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return failed;
}

static hub *new_hub(int count, rx_rank_run run, void *user)
{
    hub *all = RX_NEW(hub, 1);
    box *boxes = RX_NEW(box, (size_t)count);
    member *members = RX_NEW(member, (size_t)(count - 1));
    if (!all || !boxes || !members) {
        free(all);
        free(boxes);
        free(members);
        return NULL;
    }
    *all = (hub){.count = count, .boxes = boxes, .members = members, .run = run, .user = user};
    pthread_mutex_init(&all->lock, NULL);
    for (int i = 0; i < count; i++)
        pthread_cond_init(&boxes[i].filled, NULL);
    return all;
}

rx_status rx_ranks_start_threads(int generators, rx_rank_run run, void *user, rx_ranks **dst, rx_error *err)
{
    int count = generators + 1;
    rx_ranks *ranks = RX_NEW(rx_ranks, 1);
    hub *all = ranks ? new_hub(count, run, user) : NULL;
    if (!all) {
        free(ranks);
        return rx_error_memory(err, (size_t)count * sizeof(member));
    }
    *ranks = (rx_ranks){.count = count, .trainers = 1, .via = &threads, .link = all, .failed = RX_ERROR_NONE};
    for (int i = 0; i < generators; i++) {
        all->members[i].ranks = *ranks;
        all->members[i].ranks.rank = i + 1;
        all->members[i].all = all;
        int failed = start_thread(&all->members[i]);
        if (failed) {
            rx_ranks_stop(ranks);
            return rx_error_set(err, RX_SYSTEM,
                                "thread %d of %d that make images cannot be started: %s; lower GENERATORS",
                                i + 1, generators, strerror(failed));
        }
        all->running++;
    }
    *dst = ranks;
    return RX_OK;
}
