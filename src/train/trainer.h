/* The trainer: epochs of steps, test, dictionary, checkpoint, until the limit or until nothing improves.
 *
 *   feed -> step (every sample of a batch, OpenMP) -> ordered sum (all ranks) -> clip -> Adam -> ...
 *        -> test images -> dictionary (Eq. 4) -> checkpoint, log, model file -> next epoch
 *
 * Gradients of a batch are computed per sample and added in sample order, so the bytes of the model do not
 * depend on the number of threads; several training ranks (TRAIN_RANKS) agree with one to rounding. */
#ifndef RX_TRAIN_TRAINER_H
#define RX_TRAIN_TRAINER_H

#include "base/error.h"
#include "base/log.h"
#include "config/train_config.h"

/* Everything the configuration asks for: the job of rextract-train. Outputs: MODEL_NAME, CHECKPOINT_NAME each
 * epoch (and when interrupted: RX_INTERRUPTED), the log table and, at the end and every PLOT_EPOCHS, the page
 * with loss curves and the heat maps of the dictionary in OUTPUT_NAME. Continues CHECKPOINT_NAME where it
 * exists and belongs to the same configuration; another one is an error that says which keyword differs.
 * Diverging loss (not finite, or 20 times its running mean for 3 batches) goes back to the last checkpoint
 * with half the rate, three times, then fails with RX_INPUT. */
rx_status rx_train_run(const rx_train_config *config, rx_log *log, rx_error *err);

#endif
