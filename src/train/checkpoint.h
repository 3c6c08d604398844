/* The state of a training in a file, from which the same training goes on: what comes out has the bytes that
 * it would have had without the interruption.
 *
 *   rextract-train checkpoint 3\n       magic
 *   settings                            text, what decides the training (train/setup.h, RX_SETUP_ALL)
 *   sizes of networks and grid
 *   state at the last end of an epoch   weights, moments, steps, those of the best epoch, dictionary, history,
 *                                       running mean
 *   whether one follows, and the state within the next epoch, of an interrupted training
 *   digest                              base/hash.h, of all bytes before it
 *
 * Numbers are as this machine has them in memory; random numbers have no state (base/random.h). */
#ifndef RX_TRAIN_CHECKPOINT_H
#define RX_TRAIN_CHECKPOINT_H

#include "train/state.h"

/* `path` is the temporary name of rx_outputs_file(), `shown` the final one. now: NULL, or the state within
 * the epoch. Errors: RX_SYSTEM. */
rx_status rx_checkpoint_write(const char *path, const char *shown, const char *settings,
                              const rx_train_state *kept, const rx_train_state *now, rx_error *err);

/* Into the states, which are of the right networks and grid, as the settings have them. *found 0 when there
 * is no such file; *within 1 when `now` is within an epoch, else it is a copy of `kept`. Errors: RX_USAGE (no
 * checkpoint, or that of other settings: the first keyword that differs is named), RX_INPUT (damaged),
 * RX_SYSTEM; the states are then of no use. */
rx_status rx_checkpoint_read(const char *path, const char *settings, rx_train_state *kept,
                             rx_train_state *now, int *found, int *within, rx_error *err);

#endif
