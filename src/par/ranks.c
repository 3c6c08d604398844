/* Messages and sums, whatever carries them. */
#include "par/transport.h"

#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"

void rx_parcels_add(rx_parcels *list, rx_parcel *parcel)
{
    parcel->next = NULL;
    if (list->last)
        list->last->next = parcel;
    else
        list->first = parcel;
    list->last = parcel;
}

void rx_parcel_free(rx_parcel *parcel)
{
    if (parcel)
        free(parcel->message.data);
    free(parcel);
}

void rx_parcels_free(rx_parcels *list)
{
    while (list->first) {
        rx_parcel *next = list->first->next;
        rx_parcel_free(list->first);
        list->first = next;
    }
    list->last = NULL;
}

rx_status rx_ranks_start(int trainers, int generators, rx_rank_run run, void *user, rx_ranks **dst,
                         rx_error *err)
{
    *dst = NULL;
    int processes = rx_par_processes();
    if (processes > 1 && trainers >= processes)
        return rx_error_set(
            err, RX_USAGE,
            "%d training ranks of %d processes leave none to make images; start mpiexec -n %d or "
            "more, or lower TRAIN_RANKS",
            trainers, processes, trainers + 1);
    if (processes > 1)
        return rx_ranks_start_mpi(trainers, dst, err);
    if (trainers > 1)
        return rx_error_set(
            err, RX_USAGE,
            "%d training ranks need as many processes; start mpiexec -n %d or more (with a build "
            "that has MPI), or set TRAIN_RANKS 1",
            trainers, trainers + 1);
    return rx_ranks_start_threads(generators < 1 ? 1 : generators, run, user, dst, err);
}

void rx_ranks_stop(rx_ranks *ranks)
{
    if (!ranks)
        return;
    ranks->via->stop(ranks);
    rx_parcels_free(&ranks->arrived);
    free(ranks);
}

int rx_ranks_rank(const rx_ranks *ranks)
{
    return ranks->rank;
}

int rx_ranks_count(const rx_ranks *ranks)
{
    return ranks->count;
}

int rx_ranks_trainers(const rx_ranks *ranks)
{
    return ranks->trainers;
}

bool rx_ranks_over(const rx_ranks *ranks)
{
    return ranks->failed.status != RX_OK;
}

rx_status rx_ranks_give(rx_ranks *ranks, int to, int tag, void *data, size_t size, rx_error *err)
{
    rx_parcel *parcel = RX_NEW(rx_parcel, 1);
    if (!parcel) {
        free(data);
        return rx_error_memory(err, sizeof *parcel);
    }
    parcel->message = (rx_message){.from = ranks->rank, .tag = tag, .size = size, .data = data};
    return ranks->via->send(ranks, to, parcel, err);
}

rx_status rx_ranks_send(rx_ranks *ranks, int to, int tag, const void *data, size_t size, rx_error *err)
{
    void *copy = rx_alloc(size, 1);
    if (!copy)
        return rx_error_memory(err, size);
    if (size > 0)
        memcpy(copy, data, size);
    return rx_ranks_give(ranks, to, tag, copy, size, err);
}

/* To the first `count` ranks, once; a rank that cannot be reached will see that this rank is gone. */
static void tell_failure(rx_ranks *ranks, const rx_error *why, int count)
{
    if (ranks->announced)
        return;
    ranks->announced = true;
    for (int to = 0; to < count; to++)
        if (to != ranks->rank)
            rx_ranks_send(ranks, to, RX_TAG_FAIL, why, sizeof *why, NULL);
}

void rx_ranks_fail(rx_ranks *ranks, const rx_error *why)
{
    if (!rx_ranks_over(ranks))
        tell_failure(ranks, why, ranks->count);
}

/* The error that another rank has brought about, again. */
static rx_status say_failed(const rx_ranks *ranks, rx_error *err)
{
    rx_error_take(err, &ranks->failed);
    return ranks->failed.status;
}

/* A rank that is gone while this one waits, -1 if none is. A sum, and whatever a generator waits for, needs
 * training ranks only. */
static int find_gone(rx_ranks *ranks, int tag)
{
    bool all = ranks->rank < ranks->trainers && tag != RX_TAG_SUM;
    int count = all ? ranks->count : ranks->trainers;
    for (int rank = 0; rank < count; rank++)
        if (rank != ranks->rank && ranks->via->gone(ranks, rank))
            return rank;
    return -1;
}

static bool wanted(const rx_parcel *parcel, int from, int tag)
{
    if (tag >= 0) /* any of the callers' tags */
        return parcel->message.tag >= 0;
    return parcel->message.tag == tag && parcel->message.from == from;
}

/* The first of the arrived parcels that is wanted leaves the list; NULL. */
static rx_parcel *take(rx_parcels *list, int from, int tag)
{
    rx_parcel *before = NULL, *parcel = list->first;
    while (parcel && !wanted(parcel, from, tag)) {
        before = parcel;
        parcel = parcel->next;
    }
    if (!parcel)
        return NULL;
    if (before)
        before->next = parcel->next;
    else
        list->first = parcel->next;
    if (list->last == parcel)
        list->last = before;
    return parcel;
}

/* Move one parcel from the transport to the arrived ones; *got says whether there was one. */
static rx_status fetch(rx_ranks *ranks, bool *got, rx_error *err)
{
    rx_parcel *parcel = NULL;
    rx_status status = ranks->via->poll(ranks, &parcel, err);
    *got = parcel != NULL;
    if (status != RX_OK || !parcel)
        return status;
    if (parcel->message.tag != RX_TAG_FAIL) {
        rx_parcels_add(&ranks->arrived, parcel);
        return RX_OK;
    }
    if (parcel->message.size == sizeof ranks->failed)
        memcpy(&ranks->failed, parcel->message.data, sizeof ranks->failed);
    if (ranks->failed.status == RX_OK)
        rx_error_set(&ranks->failed, RX_SYSTEM, "rank %d failed", parcel->message.from);
    rx_parcel_free(parcel);
    /* This rank will end now. Who trains must hear why before it sees that. */
    tell_failure(ranks, &ranks->failed, ranks->trainers);
    return say_failed(ranks, err);
}

/* tag < 0: that tag from that rank; otherwise any of the callers'. *dst NULL when nothing came and wait 0. */
static rx_status next_parcel(rx_ranks *ranks, int from, int tag, bool wait, rx_parcel **dst, rx_error *err)
{
    bool interruptible = tag >= 0 && ranks->rank == 0 && ranks->trainers == 1;
    *dst = NULL;
    if (rx_ranks_over(ranks))
        return say_failed(ranks, err);
    for (long round = 0;; round++) {
        *dst = take(&ranks->arrived, from, tag);
        if (*dst)
            return RX_OK;
        int gone = wait ? find_gone(ranks, tag) : -1; /* before the poll: what it had sent comes first */
        bool got = false;
        rx_status status = fetch(ranks, &got, err);
        if (status != RX_OK)
            return status;
        if (got) {
            round = -1;
            continue;
        }
        if (!wait)
            return RX_OK;
        if (gone >= 0) {
            rx_error_set(&ranks->failed, RX_SYSTEM, "rank %d ended while it was still needed", gone);
            if (ranks->rank < ranks->trainers)
                tell_failure(ranks, &ranks->failed, ranks->trainers);
            return say_failed(ranks, err);
        }
        if (interruptible && rx_interrupt_check(err) != RX_OK)
            return RX_INTERRUPTED;
        ranks->via->sleep(ranks, round);
    }
}

rx_status rx_ranks_receive(rx_ranks *ranks, int wait, rx_message *dst, rx_error *err)
{
    rx_parcel *parcel = NULL;
    *dst = (rx_message){.from = -1};
    rx_status status = next_parcel(ranks, RX_ANY_RANK, 0, wait != 0, &parcel, err);
    if (parcel)
        *dst = parcel->message;
    free(parcel); /* its data belong to the caller now */
    return status;
}

/* --- sums: to rank 0 in rank order, and back --- */

typedef void add_values(void *sum, const void *part, long n);

static void add_floats(void *sum, const void *part, long n)
{
    float *s = sum;
    const float *p = part;
    for (long i = 0; i < n; i++)
        s[i] += p[i];
}

static void add_doubles(void *sum, const void *part, long n)
{
    double *s = sum;
    const double *p = part;
    for (long i = 0; i < n; i++)
        s[i] += p[i];
}

static rx_status receive_values(rx_ranks *ranks, int from, size_t size, rx_parcel **dst, rx_error *err)
{
    RX_TRY(next_parcel(ranks, from, RX_TAG_SUM, true, dst, err));
    if ((*dst)->message.size != size)
        RX_TRY(rx_error_set(err, RX_SYSTEM, "rank %d sums %zu bytes where rank %d sums %zu", from,
                            (*dst)->message.size, ranks->rank, size));
    return RX_OK;
}

static rx_status sum(rx_ranks *ranks, void *values, long n, size_t each, add_values *add, rx_error *err)
{
    size_t size = (size_t)n * each;
    rx_parcel *parcel = NULL;
    rx_status status = RX_OK;
    if (ranks->trainers == 1)
        return RX_OK;
    if (ranks->rank > 0) {
        status = rx_ranks_send(ranks, 0, RX_TAG_SUM, values, size, err);
        if (status == RX_OK)
            status = receive_values(ranks, 0, size, &parcel, err);
        if (status == RX_OK && size > 0)
            memcpy(values, parcel->message.data, size);
        rx_parcel_free(parcel);
        return status;
    }
    for (int from = 1; from < ranks->trainers && status == RX_OK; from++) {
        status = receive_values(ranks, from, size, &parcel, err);
        if (status == RX_OK)
            add(values, parcel->message.data, n);
        rx_parcel_free(parcel);
        parcel = NULL;
    }
    RX_TRY(status);
    for (int to = 1; to < ranks->trainers; to++)
        RX_TRY(rx_ranks_send(ranks, to, RX_TAG_SUM, values, size, err));
    return RX_OK;
}

rx_status rx_ranks_sum(rx_ranks *ranks, float *values, long n, rx_error *err)
{
    return sum(ranks, values, n, sizeof *values, add_floats, err);
}

rx_status rx_ranks_sum_double(rx_ranks *ranks, double *values, long n, rx_error *err)
{
    return sum(ranks, values, n, sizeof *values, add_doubles, err);
}
