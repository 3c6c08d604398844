/* Ranks as processes under MPI; without it, the words for a single process.
 *
 * Everything travels on MPI_COMM_WORLD, the kind of message being the MPI tag. BYE is the last word of a
 * process, sent by rx_par_end() and read by rx_par_end() alone: until then it can be probed, which shows
 * that its sender is gone. No send and no receive blocks, so that computing ranks hold no other up, and waiting
 * sleeps between looks: MPI's own waiting would take a core from those that compute. */
#include "par/transport.h"

#if RX_MPI

#include <limits.h>
#include <mpi.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <time.h>

#include "base/interrupt.h"
#include "base/memory.h"

enum {
    BYE = 0,
    FIRST_TAG = RX_TAG_FAIL, /* travels as 1 */
    KINDS = RX_RANKS_TAGS - FIRST_TAG,
    MOST_INCOMING = 64 /* receives under way at once */
};

typedef struct outgoing {
    rx_parcel *parcel;
    MPI_Request request;
    struct outgoing *next;
} outgoing;

typedef struct incoming {
    rx_parcel *parcel; /* NULL: free place */
    MPI_Request request;
    bool here;
} incoming;

typedef struct link {
    outgoing *sent;                /* newest first */
    incoming place[MOST_INCOMING]; /* the first `used` in order of arrival */
    int used;
} mpi_link;

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

/* A launcher says so in the environment; without one MPI_Init() is neither needed nor always possible. */
static bool launched(void)
{
    const char *const signs[] = {"PMI_RANK", "PMI_FD", "PMI_PORT", "PMIX_RANK"};
    for (size_t i = 0; i < sizeof signs / sizeof signs[0]; i++)
        if (getenv(signs[i]))
            return true;
    return false;
}

rx_status rx_par_begin(int *argc, char ***argv, rx_error *err)
{
    int level = 0;
    if (!launched())
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

/* --- sending --- */

/* Forget what has left. */
static void sweep_sent(mpi_link *link)
{
    for (outgoing **at = &link->sent; *at;) {
        outgoing *one = *at;
        int done = 0;
        if (MPI_Test(&one->request, &done, MPI_STATUS_IGNORE) == MPI_SUCCESS && !done) {
            at = &one->next;
            continue;
        }
        *at = one->next;
        rx_parcel_free(one->parcel);
        free(one);
    }
}

static rx_status send_parcel(rx_ranks *ranks, int to, rx_parcel *parcel, rx_error *err)
{
    mpi_link *link = ranks->link;
    outgoing *one = RX_NEW(outgoing, 1);
    rx_status status = RX_OK;
    if (!one)
        status = rx_error_memory(err, sizeof *one);
    else if (parcel->message.size > INT_MAX)
        status =
            rx_error_set(err, RX_SYSTEM, "a message of %zu bytes is too long for MPI", parcel->message.size);
    else
        status = check(MPI_Isend(parcel->message.data, (int)parcel->message.size, MPI_BYTE, to,
                                 parcel->message.tag - FIRST_TAG + 1, MPI_COMM_WORLD, &one->request),
                       "send", err);
    if (status != RX_OK) {
        free(one);
        rx_parcel_free(parcel);
        return status;
    }
    one->parcel = parcel;
    one->next = link->sent;
    link->sent = one;
    sweep_sent(link);
    return RX_OK;
}

/* --- receiving --- */

static rx_status begin_receive(mpi_link *link, MPI_Message *message, const MPI_Status *about, rx_error *err)
{
    int size = 0;
    incoming *place = &link->place[link->used];
    rx_status status = check(MPI_Get_count(about, MPI_BYTE, &size), "find the size of a message", err);
    rx_parcel *parcel = status == RX_OK ? RX_NEW(rx_parcel, 1) : NULL;
    void *data = parcel ? rx_alloc((size_t)size, 1) : NULL;
    if (status == RX_OK && !data)
        status = rx_error_memory(err, (size_t)size);
    if (status == RX_OK)
        status = check(MPI_Imrecv(data, size, MPI_BYTE, message, &place->request), "receive", err);
    if (status != RX_OK) {
        free(data);
        free(parcel);
        return status;
    }
    parcel->message = (rx_message){
        .from = about->MPI_SOURCE, .tag = about->MPI_TAG - 1 + FIRST_TAG, .size = (size_t)size, .data = data};
    place->parcel = parcel;
    place->here = false;
    link->used++;
    return RX_OK;
}

/* Begin to receive what is announced, as far as there is room. */
static rx_status accept(mpi_link *link, rx_error *err)
{
    for (int kind = 1; kind <= KINDS; kind++) {
        int there = 1;
        while (there && link->used < MOST_INCOMING) {
            MPI_Message message;
            MPI_Status about;
            rx_status status =
                check(MPI_Improbe(MPI_ANY_SOURCE, kind, MPI_COMM_WORLD, &there, &message, &about),
                      "look for messages", err);
            if (status == RX_OK && there)
                status = begin_receive(link, &message, &about, err);
            if (status != RX_OK)
                return status;
        }
    }
    return RX_OK;
}

/* Is an earlier message of the same sender and tag still on its way? */
static bool must_wait(const mpi_link *link, int which)
{
    const rx_message *one = &link->place[which].parcel->message;
    for (int i = 0; i < which; i++) {
        const rx_message *other = &link->place[i].parcel->message;
        if (other->from == one->from && other->tag == one->tag)
            return true;
    }
    return false;
}

static rx_status poll_parcel(rx_ranks *ranks, rx_parcel **dst, rx_error *err)
{
    mpi_link *link = ranks->link;
    *dst = NULL;
    sweep_sent(link);
    rx_status status = RX_OK;
    RX_TRY(accept(link, err));
    for (int i = 0; i < link->used; i++) {
        incoming *place = &link->place[i];
        int done = place->here;
        if (!done)
            status = check(MPI_Test(&place->request, &done, MPI_STATUS_IGNORE), "receive", err);
        if (status != RX_OK)
            return status;
        place->here = done != 0;
        if (!done || must_wait(link, i))
            continue;
        *dst = place->parcel;
        link->used--;
        for (int k = i; k < link->used; k++)
            link->place[k] = link->place[k + 1];
        return RX_OK;
    }
    return RX_OK;
}

/* What a process sent before its BYE was announced before it; some of it may still be under way. */
static bool is_gone(rx_ranks *ranks, int rank)
{
    mpi_link *link = ranks->link;
    int there = 0;
    if (MPI_Iprobe(rank, BYE, MPI_COMM_WORLD, &there, MPI_STATUS_IGNORE) != MPI_SUCCESS || !there)
        return false;
    if (accept(link, NULL) != RX_OK || link->used == MOST_INCOMING)
        return false; /* the next poll says what is wrong, or makes room */
    for (int i = 0; i < link->used; i++)
        if (link->place[i].parcel->message.from == rank)
            return false;
    return true;
}

/* At first only let others go ahead: the answer of a sum comes within microseconds. */
static void pause_a_little(long round)
{
    if (round < 50) {
        sched_yield();
        return;
    }
    long steps = round - 49;
    struct timespec time = {.tv_nsec = steps < 20 ? steps * 50 * 1000 : 1000 * 1000};
    nanosleep(&time, NULL);
}

static void wait_for_parcel(rx_ranks *ranks, long round)
{
    (void)ranks;
    pause_a_little(round);
}

/* Everybody who is still there reads what it is sent, here too: then all that was sent leaves. */
static void stop_link(rx_ranks *ranks)
{
    mpi_link *link = ranks->link;
    for (long round = 0; link->sent || link->used > 0; round++) {
        rx_parcel *parcel = NULL;
        if (poll_parcel(ranks, &parcel, NULL) != RX_OK)
            break;
        if (!parcel)
            pause_a_little(round);
        rx_parcel_free(parcel);
    }
    free(link);
}

static const rx_transport processes = {send_parcel, poll_parcel, is_gone, wait_for_parcel, stop_link};

rx_status rx_ranks_start_mpi(int trainers, rx_ranks **dst, rx_error *err)
{
    rx_ranks *ranks = RX_NEW(rx_ranks, 1);
    mpi_link *link = RX_NEW(mpi_link, 1);
    if (!ranks || !link) {
        free(ranks);
        free(link);
        return rx_error_memory(err, sizeof *link);
    }
    *ranks = (rx_ranks){.rank = rx_par_rank(),
                        .count = rx_par_processes(),
                        .trainers = trainers,
                        .via = &processes,
                        .link = link,
                        .failed = RX_ERROR_NONE};
    *dst = ranks;
    return RX_OK;
}

/* --- the end --- */

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

rx_status rx_ranks_start_mpi(int trainers, rx_ranks **dst, rx_error *err)
{
    (void)trainers;
    *dst = NULL;
    return rx_error_set(err, RX_SYSTEM, "this build has no MPI; build it with MPICH");
}

#endif
