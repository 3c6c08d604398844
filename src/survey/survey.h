/* Tiles, one or a list, each a run of its own (stage/stage.h), with its record and what became of it. */
#ifndef RX_SURVEY_SURVEY_H
#define RX_SURVEY_SURVEY_H

#include <stdio.h>

#include "base/error.h"
#include "base/log.h"
#include "config/settings.h"
#include "config/tiles.h"

/* --- one tile (tile_run.c) --- */

/* rx_stage_run() with settings of rextract, then the record (RECORD_NAME), whether the run went well or not;
 * an interrupt leaves none. *others (may be NULL): images that another restorer did than was asked for, once for each
 * restorer. Status and errors of the run; where that is fine, those of writing the record. */
rx_status rx_tile_run(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                      int *others, rx_error *err);

/* The same of tile i of a list. */
rx_status rx_tile_run_listed(const rx_tiles *tiles, int i, const rx_settings *common, FILE *standard_out,
                             rx_log *log, int *others, rx_error *err);

/* Before the first tile: the list, where it is not NULL (rx_tiles_check()), and a warning of the keywords that were given
 * in vain. */
rx_status rx_tile_check(const rx_settings *common, const rx_tiles *tiles, rx_log *log, rx_error *err);

/* --- what became of each (outcome.c) --- */

typedef struct rx_outcome {
    int done; /* 0: not begun */
    rx_status status;
    int others; /* images that another restorer did than was asked for, by restorer asked for */
    double seconds;
    char *what; /* the error in a line, without the program's name; NULL where there is none */
} rx_outcome;

typedef struct rx_outcomes {
    int n;
    rx_outcome *of; /* [n] by the list's order */
} rx_outcomes;

rx_status rx_outcomes_new(int n, rx_outcomes **dst, rx_error *err);
void rx_outcomes_free(rx_outcomes *outcomes);

/* Tile i has ended so (`done` and `what` are set here); `why` says what of, where status is not RX_OK. Says so in
 * the log at once, unless all is well. */
rx_status rx_outcomes_add(rx_outcomes *outcomes, const rx_tiles *tiles, int i, rx_outcome outcome,
                          const rx_error *why, rx_log *log, rx_error *err);

/* To the log: how many tiles ended in which way (and on how many another restorer did at least a part, if any), then
 * a line for each tile that is not fine, in the list's order. Returns what the run as a whole ends with: RX_OK;
 * RX_SOME_FAILED; where only gates failed, RX_GATE_FAIL or RX_GATE_INSUFFICIENT. */
rx_status rx_outcomes_summary(const rx_outcomes *outcomes, const rx_tiles *tiles, double seconds, rx_log *log,
                              rx_error *err);

/* RX_INTERRUPTED, with how far the list was gone through: a tile that is done stays. */
rx_status rx_outcomes_interrupted(const rx_outcomes *outcomes, const rx_tiles *tiles, rx_error *err);

/* --- a list (survey.c), and by all processes of mpiexec (survey_ranks.c) --- */

/* Run every tile that the list at `path` names (config/tiles.h), with the settings of rextract that are
 * common to all. The whole list is checked before the first tile begins; from then on no tile stops the
 * others, and a summary ends the log. Returns what the whole ends with (rx_outcomes_summary()); RX_USAGE, nothing
 * done, for a list that is wrong; RX_INTERRUPTED between tiles or within one, those before are done. */
rx_status rx_survey_run(const rx_settings *common, const char *path, FILE *standard_out, rx_log *log,
                        rx_error *err);

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
