/* What tests/mpi.sh runs under mpiexec: mpi_ranks CASE [TRAINERS]; has-mpi: exit status 0 if it can. Rank 0
 * says what it found; an exit status of 1 is a failed check, otherwise that of the ranks' error. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/random.h"
#include "par/ranks.h"

enum { BIG = 300000, MESSAGES = 50, STOP = 7, NUMBERS = 100001 };

#define CHECK(condition)                                                                                     \
    do {                                                                                                     \
        if (!(condition)) {                                                                                  \
            fprintf(stderr, "rank %d: line %d: %s does not hold\n", rx_par_rank(), __LINE__, #condition);    \
            _exit(1);                                                                                        \
        }                                                                                                    \
    } while (0)

static bool trains(const rx_ranks *ranks)
{
    return rx_ranks_rank(ranks) < rx_ranks_trainers(ranks);
}

/* --- messages, small and big, back and forth --- */

static void echo(rx_ranks *ranks)
{
    rx_message message;
    while (rx_ranks_receive(ranks, 1, &message, NULL) == RX_OK) {
        if (message.tag == STOP) {
            free(message.data);
            return;
        }
        CHECK(rx_ranks_give(ranks, message.from, message.tag, message.data, message.size, NULL) == RX_OK);
    }
    CHECK(!"reached");
}

static rx_status messages(rx_ranks *ranks, rx_error *err)
{
    int next[64] = {0}, count = rx_ranks_count(ranks), first = rx_ranks_trainers(ranks);
    size_t seen = 0;
    unsigned char *data = RX_NEW(unsigned char, BIG);
    CHECK(data && count <= 64);
    if (!trains(ranks)) {
        echo(ranks);
        free(data);
        return RX_OK;
    }
    for (int i = 0; i < MESSAGES; i++)
        for (int to = first; to < count; to++) { /* sizes on both sides of what MPI sends at once */
            memset(data, i, BIG);
            CHECK(rx_ranks_send(ranks, to, i % 2, data, i % 3 ? BIG : 8, err) == RX_OK);
        }
    for (int i = 0; i < MESSAGES * (count - first); i++) {
        rx_message message;
        CHECK(rx_ranks_receive(ranks, 1, &message, err) == RX_OK);
        unsigned char *back = message.data;
        int which = 2 * next[message.from * 2 + message.tag]++ + message.tag;
        CHECK(message.size == (which % 3 ? BIG : 8) && back[0] == which && back[message.size - 1] == which);
        seen += message.size;
        free(back);
    }
    double done = 1; /* all have theirs back */
    CHECK(rx_ranks_sum_double(ranks, &done, 1, err) == RX_OK && done == first);
    for (int to = first; to < count && rx_ranks_rank(ranks) == 0; to++)
        CHECK(rx_ranks_send(ranks, to, STOP, NULL, 0, err) == RX_OK);
    if (rx_ranks_rank(ranks) == 0)
        printf("%zu bytes came back\n", seen);
    free(data);
    return RX_OK;
}

/* --- sums: the order of ranks, the same bytes everywhere --- */

static float number(int rank, int i)
{
    return (float)(rx_random_normal(7, (uint64_t)rank, (uint64_t)i) * (rank == 1 ? 1e6 : 1));
}

static rx_status sums(rx_ranks *ranks, rx_error *err)
{
    float *values = RX_NEW(float, NUMBERS);
    double doubles[3] = {1e16, 1, rx_ranks_rank(ranks)};
    CHECK(values);
    for (int i = 0; i < NUMBERS; i++)
        values[i] = number(rx_ranks_rank(ranks), i);
    if (trains(ranks)) {
        CHECK(rx_ranks_sum(ranks, values, NUMBERS, err) == RX_OK);
        CHECK(rx_ranks_sum_double(ranks, doubles, 3, err) == RX_OK);
        for (int i = 0; i < NUMBERS; i++) {
            float expected = number(0, i);
            for (int rank = 1; rank < rx_ranks_trainers(ranks); rank++)
                expected += number(rank, i);
            CHECK(values[i] == expected);
        }
        CHECK(doubles[1] == rx_ranks_trainers(ranks));
        if (rx_ranks_rank(ranks) == 0)
            printf("sums of %d ranks in order\n", rx_ranks_trainers(ranks));
    }
    free(values);
    return RX_OK;
}

/* --- ends of all kinds --- */

static rx_status wait_on(rx_ranks *ranks, rx_error *err)
{
    rx_status status = RX_OK;
    while (status == RX_OK) {
        rx_message message;
        status = rx_ranks_receive(ranks, 1, &message, err);
        free(message.data);
    }
    return trains(ranks) ? status : RX_OK;
}

/* The last rank sends what nobody reads, then fails. */
static rx_status failing(rx_ranks *ranks, rx_error *err)
{
    if (rx_ranks_rank(ranks) + 1 < rx_ranks_count(ranks))
        return wait_on(ranks, err);
    for (int i = 0; i < 100; i++)
        CHECK(rx_ranks_give(ranks, 0, 0, rx_alloc(BIG, 1), BIG, err) == RX_OK);
    rx_status status = rx_error_set(err, RX_INPUT, "no galaxies are left");
    rx_ranks_fail(ranks, err);
    return status;
}

static rx_status leaving(rx_ranks *ranks, rx_error *err)
{
    return rx_ranks_rank(ranks) + 1 < rx_ranks_count(ranks) ? wait_on(ranks, err) : RX_OK;
}

/* Training rank 1 fails while rank 0 sums. */
static rx_status failing_sum(rx_ranks *ranks, rx_error *err)
{
    float one = 1;
    if (!trains(ranks))
        return wait_on(ranks, err);
    if (rx_ranks_rank(ranks) == 0)
        return rx_ranks_sum(ranks, &one, 1, err);
    rx_status status = rx_error_set(err, RX_SYSTEM, "the gradient does not fit into memory");
    rx_ranks_fail(ranks, err);
    return status;
}

/* The trainer stops although images are on their way, and says nothing. */
static rx_status stopping(rx_ranks *ranks, rx_error *err)
{
    if (trains(ranks)) {
        printf("stopped\n");
        return RX_OK;
    }
    for (int i = 0; i < 100; i++)
        CHECK(rx_ranks_give(ranks, 0, 0, rx_alloc(BIG, 1), BIG, err) == RX_OK);
    return wait_on(ranks, err);
}

/* The single trainer waits for what never comes until a signal comes. */
static rx_status interrupted(rx_ranks *ranks, rx_error *err)
{
    if (rx_ranks_rank(ranks) == 0)
        kill(getpid(), SIGTERM);
    return wait_on(ranks, err);
}

/* Killed from outside: mpiexec ends the others. */
static rx_status killed(rx_ranks *ranks, rx_error *err)
{
    if (rx_ranks_rank(ranks) + 1 == rx_ranks_count(ranks))
        kill(getpid(), SIGKILL);
    return wait_on(ranks, err);
}

typedef rx_status test_case(rx_ranks *ranks, rx_error *err);

static rx_status run_case(const char *name, int trainers, rx_error *err)
{
    const struct {
        const char *name;
        test_case *run;
    } cases[] = {{"messages", messages},       {"sums", sums},         {"failing", failing},
                 {"leaving", leaving},         {"stopping", stopping}, {"failing-sum", failing_sum},
                 {"interrupted", interrupted}, {"killed", killed}};
    rx_ranks *ranks = NULL;
    if (strcmp(name, "before") == 0 && rx_par_rank() == 1) /* fails before there are ranks */
        return rx_error_set(err, RX_SYSTEM, "out of memory");
    rx_status status = rx_ranks_start(trainers, 1, NULL, NULL, &ranks, err);
    if (status != RX_OK)
        return status;
    status = strcmp(name, "before") == 0 ? wait_on(ranks, err) : RX_USAGE;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        if (strcmp(name, cases[i].name) == 0)
            status = cases[i].run(ranks, err);
    rx_ranks_stop(ranks);
    return status;
}

static bool has_mpi(void)
{
#if RX_MPI
    return true;
#else
    return false;
#endif
}

int main(int argc, char **argv)
{
    if (argc > 1 && strcmp(argv[1], "has-mpi") == 0)
        return has_mpi() ? 0 : 1;
    rx_error err = RX_ERROR_NONE;
    rx_interrupt_block();
    rx_status status = rx_par_begin(&argc, &argv, &err);
    if (status == RX_OK && rx_par_processes() < 2)
        status = rx_error_set(&err, RX_USAGE, "for mpiexec -n 2 or more");
    if (status == RX_OK)
        status = run_case(argc > 1 ? argv[1] : "", argc > 2 ? atoi(argv[2]) : 1, &err);
    if (status != RX_OK && rx_par_rank() == 0)
        fprintf(stderr, "mpi_ranks: %s\n", err.text);
    rx_par_end(status);
    return (int)status;
}
