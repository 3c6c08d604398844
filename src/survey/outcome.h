/* What became of each tile of a list, and the summary at the end. */
#ifndef RX_SURVEY_OUTCOME_H
#define RX_SURVEY_OUTCOME_H

#include "base/error.h"
#include "base/log.h"
#include "config/tiles.h"

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

#endif
