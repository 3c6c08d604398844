/* A list of tiles among the processes of mpiexec. */
#ifndef RX_SURVEY_SURVEY_RANKS_H
#define RX_SURVEY_SURVEY_RANKS_H

#include <stdio.h>

#include "base/error.h"
#include "base/log.h"
#include "config/settings.h"

/* As rx_survey_run(), by all processes: that of rank 0 hands out tiles, the next one to the rank that is ready,
 * keeps the account and returns what the whole ends with; the others run tiles, and return RX_OK unless MPI
 * itself fails. With NTHREADS 0 each of them takes one thread, as there are many. Call it after
 * rx_par_begin(), and with several processes. */
rx_status rx_survey_run_ranks(const rx_settings *common, const char *path, FILE *standard_out, rx_log *log,
                              rx_error *err);

/* The plan (stage/plan.h) of such a run, by rank 0; the others do nothing. */
rx_status rx_survey_plan_ranks(const rx_settings *common, const char *image, FILE *standard_out, rx_log *log,
                               rx_error *err);

#endif
