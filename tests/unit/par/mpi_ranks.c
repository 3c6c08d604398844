/* What tests/mpi.sh runs under mpiexec: mpi_ranks CASE; has-mpi: exit status 0 if it can. Rank 0 says what it found;
 * an exit status of 1 is a failed check, otherwise that of the ranks' error. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/random.h"
#include "par/ranks.h"

enum { BIG = 300000, MESSAGES = 50, NUMBERS = 100001, ITEMS = 7 };

#define CHECK(condition)                                                                                     \
    do {                                                                                                     \
        if (!(condition)) {                                                                                  \
            fprintf(stderr, "rank %d: line %d: %s does not hold\n", rx_par_rank(), __LINE__, #condition);    \
            _exit(1);                                                                                        \
        }                                                                                                    \
    } while (0)

/* --- messages: big ones to rank 0, which takes them as they come and answers each sender --- */

static rx_status messages(rx_error *err)
{
    const int rank = rx_par_rank(), others = rx_par_processes() - 1;
    int next[64] = {0};
    size_t seen = 0;
    unsigned char *data = RX_NEW(unsigned char, BIG);
    CHECK(data && others < 64);
    for (int i = 0; i < MESSAGES && rank > 0; i++) {
        int answer = -1;
        memset(data, i, BIG);
        CHECK(rx_par_send(0, data, BIG, err) == RX_OK);
        memset(data, 255, BIG); /* it was sent */
        CHECK(rx_par_receive(0, &answer, sizeof answer, NULL, err) == RX_OK && answer == rank * MESSAGES + i);
    }
    for (int i = 0; i < MESSAGES * others && rank == 0; i++) {
        int from = 0;
        CHECK(rx_par_receive(RX_ANY_RANK, data, BIG, &from, err) == RX_OK && from > 0 && from <= others);
        CHECK(data[0] == next[from] && data[BIG - 1] == next[from]);
        const int answer = from * MESSAGES + next[from]++;
        CHECK(rx_par_send(from, &answer, sizeof answer, err) == RX_OK);
        seen += BIG;
    }
    if (rank == 0)
        printf("%zu bytes of each came\n", seen / (size_t)others);
    /* none ends while rank 0 still waits for any */
    for (int to = 1; to <= others && rank == 0; to++)
        CHECK(rx_par_send(to, data, 1, err) == RX_OK);
    CHECK(rank == 0 || rx_par_receive(0, data, 1, NULL, err) == RX_OK);
    free(data);
    return RX_OK;
}

/* --- sums: the order of ranks or items, the same bytes everywhere --- */

static double number(int item, int i)
{
    return rx_random_normal(7, (uint64_t)item, (uint64_t)i) * (item == 1 ? 1e6 : 1);
}

/* Items from first to last - 1. */
typedef struct items {
    int first, last;
} items;

static void add(void *user, float *values, long n)
{
    const items *own = user;
    for (int item = own->first; item < own->last; item++)
        for (int i = 0; i < n; i++)
            values[i] += (float)number(item, i);
}

static rx_status sums(rx_error *err)
{
    const int rank = rx_par_rank(), count = rx_par_processes();
    double *doubles = RX_NEW(double, NUMBERS);
    float *values = RX_NEW(float, NUMBERS), *whole = RX_NEW(float, NUMBERS);
    CHECK(doubles && values && whole);
    for (int i = 0; i < NUMBERS; i++)
        doubles[i] = number(rank, i);
    CHECK(rx_par_sum(doubles, NUMBERS, err) == RX_OK);
    for (int i = 0; i < NUMBERS; i++) {
        double expected = number(0, i);
        for (int other = 1; other < count; other++)
            expected += number(other, i);
        CHECK(doubles[i] == expected);
    }
    items own = {rank * ITEMS / count, (rank + 1) * ITEMS / count}, all = {0, ITEMS};
    values[0] = 5; /* what is there before does not matter */
    CHECK(rx_par_fold(values, NUMBERS, add, &own, err) == RX_OK);
    add(&all, whole, NUMBERS);
    CHECK(memcmp(values, whole, NUMBERS * sizeof *values) == 0);
    if (rank == 0)
        printf("sums of %d ranks in order\n", count);
    free(doubles);
    free(values);
    free(whole);
    return RX_OK;
}

/* --- ends of all kinds --- */

static int last(void)
{
    return rx_par_rank() + 1 == rx_par_processes();
}

/* Of two that fail the lower one is heard, by all. */
static rx_status failing(rx_error *err)
{
    rx_error own = RX_ERROR_NONE;
    rx_status status = RX_OK;
    CHECK(rx_par_agree(RX_OK, &own) == RX_OK);
    if (rx_par_rank() == 1)
        status = rx_error_at(&own, RX_INPUT, "a.fits", 2, 0, "no galaxies are left");
    else if (last())
        status = rx_error_set(&own, RX_SYSTEM, "no disk");
    status = rx_par_agree(status, &own);
    CHECK(status == RX_INPUT && own.status == RX_INPUT && own.hdu == 2 && strcmp(own.where, "a.fits") == 0);
    return rx_error_take(err, &own);
}

/* The last rank ends without a word, while all others agree, */
static rx_status leaving(rx_error *err)
{
    return last() ? RX_OK : rx_par_agree(RX_OK, err);
}

/* or sum, */
static rx_status leaving_sum(rx_error *err)
{
    float values[3] = {0};
    items none = {0};
    return last() ? RX_OK : rx_par_fold(values, 3, add, &none, err);
}

/* or wait for any, having sent what no one reads. */
static rx_status unread(rx_error *err)
{
    char *data = RX_NEW(char, BIG), byte;
    rx_status status = RX_OK;
    CHECK(data);
    if (rx_par_rank() == 0)
        CHECK(rx_par_receive(1, data, BIG, NULL, err) == RX_OK);
    if (rx_par_rank() == 1)
        for (int i = 0; i < 10 && status == RX_OK; i++)
            status = rx_par_send(0, data, BIG, err); /* the rest goes while rank 0 ends */
    if (rx_par_rank() > 1)
        status = rx_par_receive(0, &byte, 1, NULL, err);
    free(data);
    return rx_par_rank() == 0 ? RX_OK : status;
}

static rx_status other_size(rx_error *err)
{
    long number = 3;
    int half;
    return rx_par_rank() > 0 ? rx_par_send(0, &number, sizeof number, err)
                             : rx_par_receive(RX_ANY_RANK, &half, sizeof half, NULL, err);
}

/* Rank 0 waits for what never comes until a signal comes; the others, which wait for it, hear that it has ended. */
static rx_status interrupted(rx_error *err)
{
    char byte;
    if (rx_par_rank() > 0)
        return rx_par_receive(0, &byte, 1, NULL, err);
    kill(getpid(), SIGTERM);
    return rx_par_receive(RX_ANY_RANK, &byte, 1, NULL, err);
}

/* Killed from outside: mpiexec ends the others. */
static rx_status killed(rx_error *err)
{
    if (last())
        kill(getpid(), SIGKILL);
    return rx_par_agree(RX_OK, err);
}

static rx_status run_case(const char *name, rx_error *err)
{
    const struct {
        const char *name;
        rx_status (*run)(rx_error *err);
    } cases[] = {{"messages", messages}, {"sums", sums},
                 {"failing", failing},   {"leaving", leaving},
                 {"unread", unread},     {"leaving-sum", leaving_sum},
                 {"size", other_size},   {"interrupted", interrupted},
                 {"killed", killed}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        if (strcmp(name, cases[i].name) == 0)
            return cases[i].run(err);
    return RX_USAGE;
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
        status = run_case(argc > 1 ? argv[1] : "", &err);
    if (status != RX_OK && rx_par_rank() == 0)
        fprintf(stderr, "mpi_ranks: %s\n", err.text);
    rx_par_end(status);
    return (int)status;
}
