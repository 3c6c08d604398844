/* The trainer: epochs of steps, test, dictionary, checkpoint, until the limit or until nothing improves.
 *
 *   feed -> step (every sample of a batch, OpenMP) -> ordered sum (all ranks) -> clip -> Adam -> ...
 *        -> test images -> dictionary (Eq. 4) -> validation images: the best epoch so far?
 *        -> checkpoint, log, model file -> next epoch
 *
 * Test images are others in every epoch, and as many as Eq. 4 says: they steer the dictionary, and no two of
 * their means can be compared. Which epoch is the best is decided by the validation images, the same in every
 * epoch; its weights are what the model file holds. The rate follows a cosine over the EPOCHS that are planned,
 * so a training that ends at a high rate has not learnt what it could. PATIENCE therefore ends none by default,
 * and counts only the epochs that begin below a tenth of the highest rate, the last fifth of the training.
 *
 * Gradients of a batch are computed per sample and added in sample order, so the bytes of the model depend neither on
 * the number of threads nor on that of processes. The gradient of a step is the mean over its images; the last step of
 * an epoch may have fewer. */
#ifndef RX_TRAIN_TRAINER_H
#define RX_TRAIN_TRAINER_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "config/config_fields.h"

/* Everything the configuration asks for: the job of rextract-train. Outputs: MODEL_NAME, CHECKPOINT_NAME and
 * a page with tables in OUTPUT_NAME, each epoch. When interrupted (RX_INTERRUPTED) the step is finished and the state
 * within the epoch is kept in CHECKPOINT_NAME. Continues CHECKPOINT_NAME where it exists and belongs to the
 * same configuration; another one is an error that says which keyword differs. Diverging loss (not finite, or
 * 20 times its running mean for 3 batches) goes back to the last end of an epoch with half the rate, three
 * times, then fails with RX_INPUT. Under MPI all processes call this together. */
rx_status rx_train_run(const rx_train_config *config, rx_log *log, rx_error *err);

/* What is in a model file, several lines (-INFO). Errors: those of rx_model_read(). */
rx_status rx_train_describe(const char *path, rx_text *dst, rx_error *err);

#endif
