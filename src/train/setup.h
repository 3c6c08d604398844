/* The configuration of rextract-train as the structs of the parts: network, loss, images. */
#ifndef RX_TRAIN_SETUP_H
#define RX_TRAIN_SETUP_H

#include "base/text.h"
#include "config/config_fields.h"
#include "nn/model.h"
#include "train/samples.h"
#include "train/step.h"

/* A model with freshly initialised networks (the PSF network where a term of the loss needs one), its front, seed and
 * provenance; no dictionary yet. With INIT_MODEL their parameters are those of that model's networks; a network beside
 * RESTORE that only one of both has stays as it is, but two stages do not become one. Errors: RX_USAGE (shape of the network,
 * a target PSF wider than all of FWHM_RANGE, an INIT_MODEL of another mode, target PSF or shape: says which keyword to
 * change), those of rx_model_read(), RX_SYSTEM. */
rx_status rx_setup_model(const rx_train_config *config, rx_model **dst, rx_error *err);

rx_step_params rx_setup_step(const rx_train_config *config);

rx_samples_params rx_setup_samples(const rx_train_config *config);

/* "KEYWORD value" lines. RECORD: what decides the bytes of the model and is not at its default, for the model file;
 * ALL: every keyword that decides them, for the checkpoint. Names of outputs, threads and what only the page uses
 * are in neither; EPOCHS, PATIENCE and CLIP_IMAGE, which may change when a training goes on, are in RECORD alone. */
typedef enum rx_setup_lines { RX_SETUP_RECORD, RX_SETUP_ALL } rx_setup_lines;
rx_status rx_setup_text(const rx_train_config *config, rx_setup_lines which, rx_text *dst, rx_error *err);

#endif
