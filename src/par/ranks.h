/* Ranks that talk: processes under MPI, or threads of one process, behind one interface.
 *
 * Rank 0 .. trainers-1 train, the others generate. Started under mpiexec (and built with MPI) every process
 * is a rank; otherwise rx_ranks_start() makes `generators` threads beside the caller, who is rank 0. Messages
 * between two ranks of one tag arrive in order. */
#ifndef RX_PAR_RANKS_H
#define RX_PAR_RANKS_H

#include <stddef.h>

#include "base/error.h"

typedef struct rx_ranks rx_ranks;

enum { RX_ANY_RANK = -1 };

typedef struct rx_message {
    int from, tag;
    size_t size;
    void *data; /* owned by the receiver: free() */
} rx_message;

/* Must be the first thing a program does; harmless without MPI. under_mpi: more than one process. */
rx_status rx_par_begin(int *argc, char ***argv, rx_error *err);
void rx_par_end(rx_status status); /* MPI: other ranks are not left waiting when status is an error */
int rx_par_processes(void);        /* 1 without MPI */
int rx_par_rank(void);             /* of this process */

/* MPI: `generators` is ignored (all processes but the `trainers` first), `run` is called on generator
 * processes by the caller itself after rx_ranks_start. Threads: run(user, its ranks handle) is started on
 * `generators` threads. Errors: RX_USAGE (no generator left, trainers > 1 without MPI), RX_SYSTEM. */
typedef void (*rx_rank_run)(void *user, rx_ranks *ranks);
rx_status rx_ranks_start(int trainers, int generators, rx_rank_run run, void *user, rx_ranks **dst,
                         rx_error *err);
void rx_ranks_stop(rx_ranks *ranks); /* joins threads, frees; after every rank was told to end */

int rx_ranks_rank(const rx_ranks *ranks);
int rx_ranks_count(const rx_ranks *ranks); /* all */
int rx_ranks_trainers(const rx_ranks *ranks);

/* Copies `data`. Does not wait for the receiver. */
rx_status rx_ranks_send(rx_ranks *ranks, int to, int tag, const void *data, size_t size, rx_error *err);
/* wait 0: *dst->data NULL and size 0, from -1 when nothing is there. Errors: RX_INTERRUPTED while waiting. */
rx_status rx_ranks_receive(rx_ranks *ranks, int wait, rx_message *dst, rx_error *err);

/* values[n] = sum over the training ranks, in rank order on all of them (the same bytes everywhere). One
 * trainer: nothing to do. */
rx_status rx_ranks_sum(rx_ranks *ranks, float *values, long n, rx_error *err);
rx_status rx_ranks_sum_double(rx_ranks *ranks, double *values, long n, rx_error *err);

#endif
