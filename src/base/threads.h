/* How many threads a run takes. */
#ifndef RX_BASE_THREADS_H
#define RX_BASE_THREADS_H

#include "base/log.h"

/* NTHREADS as all programs understand it: wanted > 0: so many, but no more than four for each processor (or 8);
 * 0: the least of OMP_NUM_THREADS, the processors that this process may use and those that its cgroups' quotas allow;
 * -n: at most n of those. */
int rx_threads_count(int wanted);

/* The least quota of the cgroups that the file `list` (/proc/self/cgroup) names, in processors, of those mounted at
 * `root`; INT_MAX: none. */
int rx_threads_quota(const char *list, const char *root);

/* The same, or half of what the system lets us have (ulimit -u, memory for their stacks) where that is less,
 * with a warning: OpenMP's runtime ends the process where it cannot make a thread. Those that it will use
 * exist afterwards. */
int rx_threads_had(int wanted, rx_log *log);

#endif
