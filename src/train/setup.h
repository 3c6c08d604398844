/* The configuration of rextract-train as the structs of the parts: network, loss, images. */
#ifndef RX_TRAIN_SETUP_H
#define RX_TRAIN_SETUP_H

#include "base/text.h"
#include "config/config_fields.h"
#include "nn/model.h"
#include "train/feed.h"
#include "train/step.h"

/* A model with freshly initialised networks (the PSF network where a term of the loss needs one) or those of
 * INIT_MODEL, its front, seed and provenance; no dictionary yet. Errors: RX_USAGE (shape of the network, a
 * target PSF wider than all of FWHM_RANGE), those of rx_first_model(), RX_SYSTEM. */
rx_status rx_setup_model(const rx_train_config *config, rx_model **dst, rx_error *err);

rx_step_params rx_setup_step(const rx_train_config *config);

/* Bins and counts of the first epoch. */
rx_status rx_setup_selection(const rx_train_config *config, rx_selection *dst, rx_error *err);

rx_feed_params rx_setup_feed(const rx_train_config *config, const rx_selection *grid);

/* "KEYWORD value" lines. RECORD: what decides the bytes of the model and is not at its default, for the model
 * file; ALL: every keyword that decides them, for the checkpoint. Names of outputs, threads and what only the page
 * uses are in neither; EPOCHS, PATIENCE and CLIP_IMAGE, which may change when a training goes on, are in RECORD
 * alone. */
typedef enum rx_setup_lines { RX_SETUP_RECORD, RX_SETUP_ALL } rx_setup_lines;
rx_status rx_setup_text(const rx_train_config *config, rx_setup_lines which, rx_text *dst, rx_error *err);

#endif
