/* How many threads a run takes. */
#ifndef RX_BASE_THREADS_H
#define RX_BASE_THREADS_H

#include "base/log.h"

/* NTHREADS as all programs understand it: wanted > 0: so many, 0: OMP_NUM_THREADS or every core, -n: at most
 * n of those. */
int rx_threads_count(int wanted);

/* The same, or half of what the system lets us have (ulimit -u, memory for their stacks) where that is less,
 * with a warning: OpenMP's runtime ends the process where it cannot make a thread. Those that it will use
 * exist afterwards. */
int rx_threads_had(int wanted, rx_log *log);

#endif
