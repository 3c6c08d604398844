/* Ranks that talk: processes under MPI, or threads of one process, behind one interface.
 *
 * Rank 0 .. trainers-1 train, the others generate. Started under mpiexec (and built with MPI) every process
 * is a rank; without, rx_ranks_start() makes `generators` threads beside the caller, which is rank 0. Messages
 * between two ranks of one tag arrive in order. Each rank calls these functions from one thread.
 *
 * No rank waits for one that is gone: a rank that fails informs the others (rx_ranks_fail), and one that just
 * ends is noticed; a rank that waits for a message or a sum then gets an error, which stays. */
#ifndef RX_PAR_RANKS_H
#define RX_PAR_RANKS_H

#include <stdbool.h>
#include <stddef.h>

#include "base/error.h"

typedef struct rx_ranks rx_ranks;

enum { RX_ANY_RANK = -1, RX_RANKS_TAGS = 8 }; /* tags are 0 .. RX_RANKS_TAGS - 1; train/feed.h takes 3 .. 7 */

typedef struct rx_message {
    int from, tag;
    size_t size;
    void *data; /* owned by the receiver: free() */
} rx_message;

/* Must be the first thing a program does (argc, argv may be NULL); nothing where no mpiexec started it.
 * Otherwise it blocks signals (base/interrupt.h), for the threads that MPI starts as well. Every process
 * calls rx_par_end() at its end, after rx_ranks_stop(), whatever happened before: it returns when all
 * processes are there, and forgets pending signals, so that the exit code says RX_INTERRUPTED. Only the
 * process of rank 0 should print errors. */
rx_status rx_par_begin(int *argc, char ***argv, rx_error *err);
void rx_par_end(rx_status status);
int rx_par_processes(void); /* 1 without MPI */
int rx_par_rank(void);      /* of this process */

/* MPI with more than one process: `generators` and `run` are ignored; all processes but the `trainers` first
 * generate: they see rx_ranks_rank() >= rx_ranks_trainers(). Threads: run(user, its ranks handle) is started
 * on `generators` threads. Errors: RX_USAGE (no generator left, trainers > 1 without MPI), RX_SYSTEM. */
typedef void (*rx_rank_run)(void *user, rx_ranks *ranks);
rx_status rx_ranks_start(int trainers, int generators, rx_rank_run run, void *user, rx_ranks **dst,
                         rx_error *err);
/* Drops what has come unread, waits until what was sent has left, joins threads (which should know by then
 * that it is over; at the latest they see that rank 0 is gone), frees. NULL is fine. */
void rx_ranks_stop(rx_ranks *ranks);

int rx_ranks_rank(const rx_ranks *ranks);
int rx_ranks_count(const rx_ranks *ranks); /* all */
int rx_ranks_trainers(const rx_ranks *ranks);

/* Copies `data`. Does not wait for the receiver. Errors: RX_SYSTEM. */
rx_status rx_ranks_send(rx_ranks *ranks, int to, int tag, const void *data, size_t size, rx_error *err);
/* The same without a copy: `data` (from malloc or rx_alloc) is taken, also when this fails. */
rx_status rx_ranks_give(rx_ranks *ranks, int to, int tag, void *data, size_t size, rx_error *err);
/* wait 0: dst->data NULL, size 0, from -1 when nothing is there. Data are aligned to 64 bytes or as they were
 * given. Errors: RX_INTERRUPTED while waiting (only on rank 0 as the single trainer: several must agree when
 * to stop, and generators are informed); RX_SYSTEM or what a failed rank said. */
rx_status rx_ranks_receive(rx_ranks *ranks, int wait, rx_message *dst, rx_error *err);

/* Tell every other rank that this one cannot go on; their next receive or sum returns this error. Does
 * nothing when another rank has failed before. */
void rx_ranks_fail(rx_ranks *ranks, const rx_error *why);
/* A receive or sum has found that another rank failed, or ended while it was still needed. */
bool rx_ranks_over(const rx_ranks *ranks);

/* values[n] = sum over the training ranks, in rank order on all of them (the same bytes everywhere). One
 * trainer: nothing to do. Errors: RX_SYSTEM or what a failed rank said. */
rx_status rx_ranks_sum(rx_ranks *ranks, float *values, long n, rx_error *err);
rx_status rx_ranks_sum_double(rx_ranks *ranks, double *values, long n, rx_error *err);

#endif
