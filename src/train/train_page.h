/* The report of a training: curves, a row for every epoch, and for every bin of the last one. */
#ifndef RX_TRAIN_TRAIN_PAGE_H
#define RX_TRAIN_TRAIN_PAGE_H

#include "nn/model.h"
#include "train/state.h"

typedef struct rx_train_page {
    const rx_history *history;     /* one epoch at least */
    const rx_selection *selection; /* the grid */
    const rx_model *model;         /* described in words */
    const char *settings;          /* "KEYWORD value" lines */
    int figures;                   /* 1: by gnuplot */
} rx_train_page;

/* training.html, summary.json, log.ecsv and dictionary.ecsv into the existing folder (`shown` in errors). Errors:
 * RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_train_page_write(const rx_train_page *page, const char *folder, const char *shown,
                              rx_error *err);

#endif
