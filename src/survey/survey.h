/* Tiles, one or a list, each a run of its own (stage/stage.h), with its record and what became of it. */
#ifndef RX_SURVEY_SURVEY_H
#define RX_SURVEY_SURVEY_H

#include <stdio.h>

#include "base/error.h"
#include "base/log.h"
#include "config/settings.h"
#include "config/tiles.h"

/* The tile `image`, or every one that the list "@FILE" names (config/tiles.h), with settings of rextract, those of a
 * list common to all. Each writes its record (RECORD_NAME), whether it went well or not; an interrupt leaves none. Keywords
 * that were given in vain are warned of first.
 *
 * A list is checked as a whole before its first tile begins; from then on no tile stops the others, and a summary ends the
 * log: how many tiles ended in which way, on how many another restorer did at least a part, and a line for each that is
 * not fine. Returns what the whole ends with: RX_OK; RX_SOME_FAILED; where only gates failed, RX_GATE_FAIL or
 * RX_GATE_INSUFFICIENT; RX_USAGE, nothing done, for a list that is wrong; RX_INTERRUPTED between tiles or within one, those
 * before are done. */
rx_status rx_survey_run(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                        rx_error *err);

/* The same of the list at `path`, by all processes: that of rank 0 hands out tiles, the next one to the rank that is ready,
 * keeps the account and returns what the whole ends with; the others run tiles, and return RX_OK unless MPI
 * itself fails. Call it after rx_par_begin(), and with several processes. */
rx_status rx_survey_run_ranks(const rx_settings *common, const char *path, FILE *standard_out, rx_log *log,
                              rx_error *err);

/* --- a list under way, for both --- */

typedef struct rx_outcome {
    int done; /* 0: not begun */
    rx_status status;
    int others; /* images that another restorer did than was asked for, by restorer asked for */
    double seconds;
    char *what; /* the error in a line, without the program's name; NULL where there is none; owned */
} rx_outcome;

typedef struct rx_survey_list {
    const rx_settings *common; /* this and the next two are the caller's */
    FILE *standard_out;
    rx_log *log;
    double begun;
    rx_tiles *tiles;
    rx_outcome *outcome; /* [tiles->n] */
} rx_survey_list;

/* Reads and checks the list. Close or free it in any case. */
rx_status rx_survey_open(rx_survey_list *survey, const char *path, rx_error *err);

/* Tile i; how it ended, and `why` where that is not RX_OK. */
rx_outcome rx_survey_tile(const rx_survey_list *survey, int i, rx_error *why);

/* Its outcome, which the log has at once unless all is well. */
rx_status rx_survey_add(rx_survey_list *survey, int i, rx_outcome outcome, const rx_error *why,
                        rx_error *err);

/* The summary, where the list was sound, and what the whole ends with: how it went on (status), else as the tiles did. */
rx_status rx_survey_close(rx_survey_list *survey, rx_status status, rx_error *err);
void rx_survey_free(rx_survey_list *survey); /* content only */

#endif
