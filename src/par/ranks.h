/* Processes that share a job under MPI: messages, and what all of them do together.
 *
 * One process alone (no mpiexec, or a build without MPI) is rank 0 of 1, and all of this does nothing. Each process
 * calls these functions from one thread. Waiting sleeps between looks: MPI's own would take a core from those that
 * compute. No rank waits for one that has ended: it gets an error instead. */
#ifndef RX_PAR_RANKS_H
#define RX_PAR_RANKS_H

#include <stdbool.h>
#include <stddef.h>

#include "base/error.h"

enum { RX_ANY_RANK = -1 };

/* Must be the first thing a program does (argc, argv may be NULL); nothing where no mpiexec started it.
 * Otherwise it blocks signals (base/interrupt.h), for the threads that MPI starts as well. Every process
 * calls rx_par_end() at its end, whatever happened before: it returns when all processes are there, and
 * forgets pending signals, so that the exit code says RX_INTERRUPTED. Only the process of rank 0 should
 * print errors. */
rx_status rx_par_begin(int *argc, char ***argv, rx_error *err);
void rx_par_end(rx_status status);
int rx_par_processes(void); /* 1 without MPI */
int rx_par_rank(void);      /* of this process */

/* --- one to another; messages between two ranks arrive in order --- */

/* Waits until `data` may be changed. Errors: RX_SYSTEM. */
rx_status rx_par_send(int to, const void *data, size_t size, rx_error *err);
/* data[size] from rank `from`, or from any (RX_ANY_RANK; *sender, unless NULL, says which), which then must all be
 * there. Errors: RX_SYSTEM (another size, a rank that has ended), RX_INTERRUPTED (only of RX_ANY_RANK: of ranks that
 * wait for each other, all must agree when to stop). */
rx_status rx_par_receive(int from, void *data, size_t size, int *sender, rx_error *err);

/* --- all together, in the same order on every rank --- */

/* How a part of the job went on each rank: all return the status, and fill the error, of the lowest rank that failed;
 * RX_OK if none did. */
rx_status rx_par_agree(rx_status status, rx_error *err);
/* values[n] = sum over the ranks, in their order, the same bytes on all of them. */
rx_status rx_par_sum(double *values, long n, rx_error *err);

/* A sum over items that ranks share out in runs, the first run to rank 0, with the bytes of the sum over all items in
 * order by one rank: `add` adds this rank's items to values[n], which hold those of the ranks before (0 on rank 0).
 * In the end all have the whole sum. */
rx_status rx_par_fold(float *values, long n, void (*add)(void *user, float *values, long n), void *user,
                      rx_error *err);

#endif
