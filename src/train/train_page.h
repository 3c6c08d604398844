/* The report of a training: curves, a row for every epoch, and for every bin of the last one. */
#ifndef RX_TRAIN_TRAIN_PAGE_H
#define RX_TRAIN_TRAIN_PAGE_H

#include "nn/model.h"
#include "train/state.h"

/* training.html, summary.json, log.ecsv and dictionary.ecsv into the existing folder (`shown` in errors), of a state with one
 * epoch at least; settings: "KEYWORD value" lines; figures 1: by gnuplot. Errors: RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_train_page_write(const rx_train_state *state, const rx_model *model, const char *settings,
                              int figures, const char *folder, const char *shown, rx_error *err);

#endif
