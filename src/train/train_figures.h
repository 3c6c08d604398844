/* Figures of training.html. */
#ifndef RX_TRAIN_TRAIN_FIGURES_H
#define RX_TRAIN_TRAIN_FIGURES_H

#include "report/figure.h"
#include "train/history.h"

/* Curves (ids curve-...), heat maps of the dictionary's list at some epochs (list-...), and of what the last
 * one knows of each bin (last-...). The history has an epoch at least. Memory trouble shows in
 * dst->script.failed. */
void rx_train_figures(rx_figures *dst, const rx_history *history, const rx_selection *grid);

#endif
