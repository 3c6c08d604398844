/* Ranks as processes under MPI; without it, the words for a single process.
 *
 * BYE is the last message of a process, sent by rx_par_end() and read by rx_par_end() alone: until then it can be
 * probed, which shows that its sender has ended. */
#include "par/ranks.h"

#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"

#if RX_MPI

#include <limits.h>
#include <mpi.h>
#include <sched.h>
#include <time.h>

enum { BYE = 0, DATA = 1 };

static bool active(void)
{
    int begun = 0, ended = 0;
    MPI_Initialized(&begun);
    MPI_Finalized(&ended);
    return begun && !ended;
}

static rx_status check(int code, const char *what, rx_error *err)
{
    if (code == MPI_SUCCESS)
        return RX_OK;
    char text[MPI_MAX_ERROR_STRING] = "";
    int length = 0;
    MPI_Error_string(code, text, &length);
    for (int i = 0; i < length; i++)
        if (text[i] == '\n')
            text[i] = ' ';
    return rx_error_set(err, RX_SYSTEM, "MPI cannot %s: %.400s", what, text);
}

rx_status rx_par_begin(int *argc, char ***argv, rx_error *err)
{
    /* a launcher says so in the environment; without one MPI_Init() is neither needed nor always possible */
    static const char *const signs[] = {"PMI_RANK", "PMI_FD", "PMI_PORT", "PMIX_RANK"};
    bool launched = false;
    int level = 0;
    for (size_t i = 0; i < sizeof signs / sizeof signs[0]; i++)
        launched |= getenv(signs[i]) != NULL;
    if (!launched)
        return RX_OK;
    rx_interrupt_block(); /* threads that MPI starts would take signals otherwise */
    RX_TRY(check(MPI_Init_thread(argc, argv, MPI_THREAD_FUNNELED, &level), "begin (MPI_Init_thread)", err));
    RX_TRY(check(MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN), "hand on its errors", err));
    if (level < MPI_THREAD_FUNNELED)
        RX_TRY(rx_error_set(err, RX_SYSTEM,
                            "this MPI library knows no threads (MPI_THREAD_FUNNELED); use one that does"));
    return RX_OK;
}

int rx_par_processes(void)
{
    int count = 1;
    if (active())
        MPI_Comm_size(MPI_COMM_WORLD, &count);
    return count;
}

int rx_par_rank(void)
{
    int rank = 0;
    if (active())
        MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    return rank;
}

/* At first only let others go ahead: most answers come within microseconds. */
static void pause_a_little(long round)
{
    if (round < 50) {
        sched_yield();
        return;
    }
    const long steps = round - 49;
    struct timespec time = {.tv_nsec = steps < 20 ? steps * 50 * 1000 : 1000 * 1000};
    nanosleep(&time, NULL);
}

rx_status rx_par_send(int to, const void *data, size_t size, rx_error *err)
{
    MPI_Request request;
    int done = 0;
    if (size > INT_MAX)
        return rx_error_set(err, RX_SYSTEM, "a message of %zu bytes is too long for MPI", size);
    RX_TRY(check(MPI_Isend(data, (int)size, MPI_BYTE, to, DATA, MPI_COMM_WORLD, &request), "send", err));
    for (long round = 0; !done; round++) {
        RX_TRY(check(MPI_Test(&request, &done, MPI_STATUS_IGNORE), "send", err));
        if (!done)
            pause_a_little(round);
    }
    return RX_OK;
}

/* A rank that has ended, of one or all; -1: none. */
static int find_ended(int from)
{
    int there = 0;
    MPI_Status about;
    if (MPI_Iprobe(from == RX_ANY_RANK ? MPI_ANY_SOURCE : from, BYE, MPI_COMM_WORLD, &there, &about) !=
        MPI_SUCCESS)
        return -1;
    return there ? about.MPI_SOURCE : -1;
}

rx_status rx_par_receive(int from, void *data, size_t size, int *sender, rx_error *err)
{
    const int source = from == RX_ANY_RANK ? MPI_ANY_SOURCE : from;
    MPI_Message message;
    MPI_Status about;
    for (long round = 0;; round++) {
        int there = 0, length = 0;
        const int ended = find_ended(from); /* before the look for data: what it had sent comes first */
        RX_TRY(check(MPI_Improbe(source, DATA, MPI_COMM_WORLD, &there, &message, &about), "look for messages",
                     err));
        if (there) {
            RX_TRY(check(MPI_Get_count(&about, MPI_BYTE, &length), "find the size of a message", err));
            if ((size_t)length != size)
                return rx_error_set(
                    err, RX_SYSTEM,
                    "rank %d sent %d bytes, not %zu; all ranks must run the same program with "
                    "the same configuration",
                    about.MPI_SOURCE, length, size);
            if (sender != NULL)
                *sender = about.MPI_SOURCE;
            return check(MPI_Mrecv(data, length, MPI_BYTE, &message, MPI_STATUS_IGNORE), "receive", err);
        }
        if (ended >= 0)
            return rx_error_set(err, RX_SYSTEM, "rank %d ended while it was still needed", ended);
        if (from == RX_ANY_RANK)
            RX_TRY(rx_interrupt_check(err));
        pause_a_little(round);
    }
}

/* Read and drop one message, if one is there; true if it was a BYE. */
static bool drop_one(int *there)
{
    MPI_Message message;
    MPI_Status about;
    int size = 0;
    if (MPI_Improbe(MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, there, &message, &about) != MPI_SUCCESS) {
        *there = 0;
        return false;
    }
    if (!*there)
        return false;
    MPI_Get_count(&about, MPI_BYTE, &size);
    void *data = rx_alloc((size_t)size, 1);
    MPI_Mrecv(data, data ? size : 0, MPI_BYTE, &message, MPI_STATUS_IGNORE);
    free(data);
    return about.MPI_TAG == BYE;
}

void rx_par_end(rx_status status)
{
    (void)status; /* all processes end alike, by their own exit codes */
    if (!active())
        return;
    /* mpiexec calls a process that ends by a signal a crash, and loses its exit code */
    rx_interrupt_forget();
    int count = rx_par_processes(), rank = rx_par_rank(), here = 1;
    for (int to = 0; to < count; to++) {
        MPI_Request request;
        if (to != rank && MPI_Isend(NULL, 0, MPI_BYTE, to, BYE, MPI_COMM_WORLD, &request) == MPI_SUCCESS)
            MPI_Request_free(&request);
    }
    for (long round = 0; here < count; round++) {
        int there = 0;
        if (drop_one(&there))
            here++;
        if (there)
            round = -1;
        else
            pause_a_little(round);
    }
    MPI_Finalize();
}

#else

rx_status rx_par_begin(int *argc, char ***argv, rx_error *err)
{
    (void)argc;
    (void)argv;
    (void)err;
    return RX_OK;
}

void rx_par_end(rx_status status)
{
    (void)status;
}

int rx_par_processes(void)
{
    return 1;
}

int rx_par_rank(void)
{
    return 0;
}

rx_status rx_par_send(int to, const void *data, size_t size, rx_error *err)
{
    (void)to;
    (void)data;
    (void)size;
    return rx_error_set(err, RX_SYSTEM, "this build has no MPI; build it with MPICH");
}

rx_status rx_par_receive(int from, void *data, size_t size, int *sender, rx_error *err)
{
    (void)from;
    (void)data;
    (void)size;
    (void)sender;
    return rx_error_set(err, RX_SYSTEM, "this build has no MPI; build it with MPICH");
}

#endif

/* The same bytes from rank `from` to all others. */
static rx_status broadcast(int from, void *data, size_t size, rx_error *err)
{
    if (rx_par_rank() != from)
        return rx_par_receive(from, data, size, NULL, err);
    for (int to = 0; to < rx_par_processes(); to++)
        if (to != from)
            RX_TRY(rx_par_send(to, data, size, err));
    return RX_OK;
}

/* Rank 0 hears all, also of those that have ended, and tells them the first error. */
rx_status rx_par_agree(rx_status status, rx_error *err)
{
    rx_error own = rx_error_part(err), first = rx_error_part(err);
    if (rx_par_processes() == 1)
        return status;
    if (status != RX_OK && err != NULL)
        rx_error_take(&own, err);
    own.status = status;
    if (rx_par_rank() > 0)
        RX_TRY(rx_par_send(0, &own, sizeof own, err));
    else
        rx_error_take(&first, &own);
    for (int from = 1; rx_par_rank() == 0 && from < rx_par_processes(); from++) {
        if (rx_par_receive(from, &own, sizeof own, NULL, &own) != RX_OK && own.status == RX_OK)
            own.status = RX_SYSTEM;
        if (first.status == RX_OK)
            rx_error_take(&first, &own);
    }
    RX_TRY(broadcast(0, &first, sizeof first, err));
    return rx_error_take(err, &first);
}

rx_status rx_par_sum(double *values, long n, rx_error *err)
{
    const size_t size = (size_t)n * sizeof *values;
    double *part;
    if (rx_par_processes() == 1)
        return RX_OK;
    if (rx_par_rank() > 0) {
        RX_TRY(rx_par_send(0, values, size, err));
        return broadcast(0, values, size, err);
    }
    RX_TRY(RX_MAKE(part, (size_t)n, err));
    rx_status status = RX_OK;
    for (int from = 1; from < rx_par_processes() && status == RX_OK; from++) {
        status = rx_par_receive(from, part, size, NULL, err);
        for (long i = 0; i < n && status == RX_OK; i++)
            values[i] += part[i];
    }
    free(part);
    return status == RX_OK ? broadcast(0, values, size, err) : status;
}

rx_status rx_par_fold(float *values, long n, void (*add)(void *user, float *values, long n), void *user,
                      rx_error *err)
{
    const size_t size = (size_t)n * sizeof *values;
    const int rank = rx_par_rank(), last = rx_par_processes() - 1;
    if (rank > 0)
        RX_TRY(rx_par_receive(rank - 1, values, size, NULL, err));
    else
        memset(values, 0, size);
    add(user, values, n);
    if (rank < last)
        RX_TRY(rx_par_send(rank + 1, values, size, err));
    return last > 0 ? broadcast(last, values, size, err) : RX_OK;
}
