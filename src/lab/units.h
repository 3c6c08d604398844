/* Doing the units of a campaign that are not in its journal yet. */
#ifndef RX_LAB_UNITS_H
#define RX_LAB_UNITS_H

#include "lab/journal.h"
#include "lab/kind.h"

/* How many units there are, and where they belong, places[*n], to be freed. */
rx_status rx_units_places(const rx_campaign_kind *kind, const void *state, long *n, rx_unit_place **places,
                          rx_error *err);

/* Is the unit of that place done by shard k of n (k from 1): the groups go to the shards in turn. */
int rx_unit_is_mine(const rx_unit_place *place, int k, int n);

/* Units of shard k of n that have no values, and all of them. */
void rx_units_count(long nunits, const rx_unit_place *places, const rx_unit_values *values, int k, int n,
                    long *missing, long *all);

/* Do those without values on nthreads threads, each appended to the journal as soon as it is done. The values
 * are the same for any nthreads. Errors: the first one of any unit, after the units at work have ended;
 * RX_INTERRUPTED with what is done kept. */
rx_status rx_units_run(const rx_campaign_kind *kind, const void *state, long nunits,
                       const rx_unit_place *places, int k, int n, int nthreads, rx_journal *journal,
                       rx_unit_values *values, rx_log *log, rx_error *err);

#endif
