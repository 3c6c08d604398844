/* Doing the units of a campaign that are not in its journal yet.
 *
 * Units belong to groups (a group is done by one shard) and to phases (units of a phase may use the values of
 * earlier ones of their group). */
#ifndef RX_LAB_UNITS_H
#define RX_LAB_UNITS_H

#include "base/log.h"
#include "lab/journal.h"

enum { RX_PHASES = 2 };

typedef struct rx_unit_place {
    int group; /* from 0 */
    int phase; /* 0 .. RX_PHASES - 1 */
} rx_unit_place;

typedef struct rx_unit_work {
    const char *title; /* of the campaign, for the log */
    long n;
    const rx_unit_place *place; /* [n] */
    int k, n_shards; /* units of shard k (from 1) of n_shards: the groups go to the shards in turn */
    const void *state;
    /* The values of one unit, on one thread; several at the same time. */
    rx_status (*unit)(const void *state, long unit, const rx_unit_values *done, rx_unit_values *dst,
                      rx_error *err);
} rx_unit_work;

int rx_unit_is_mine(const rx_unit_work *work, long unit);

/* Units of that shard that have no values, and all of them. */
void rx_units_count(const rx_unit_work *work, const rx_unit_values *values, long *missing, long *all);

/* Do those without values on nthreads threads, each appended to the journal as soon as it is done. The values
 * are the same for any nthreads. Errors: the first one of any unit, after the units at work have ended;
 * RX_INTERRUPTED with what is done kept. */
rx_status rx_units_run(const rx_unit_work *work, int nthreads, rx_journal *journal, rx_unit_values *values,
                       rx_log *log, rx_error *err);

#endif
