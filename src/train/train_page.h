/* training.html: how a training went, in curves, heat maps of the dictionary and a table. */
#ifndef RX_TRAIN_TRAIN_PAGE_H
#define RX_TRAIN_TRAIN_PAGE_H

#include "base/text.h"
#include "nn/model.h"
#include "train/history.h"

typedef struct rx_train_page {
    const rx_history *history;     /* one epoch at least */
    const rx_selection *selection; /* the grid */
    const rx_model *model;         /* described in words */
    const char *settings;          /* "KEYWORD value" lines */
    int figures;                   /* 1: by gnuplot */
} rx_train_page;

/* `folder`: where gnuplot works in a folder of its own; `shown` in errors. Errors: RX_SYSTEM. */
rx_status rx_train_page_write(const rx_train_page *page, const char *folder, const char *shown, rx_text *dst,
                              rx_error *err);

#endif
