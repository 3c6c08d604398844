/* What a training leaves on the disk, whole or not at all. */
#ifndef RX_TRAIN_TRAIN_OUTPUT_H
#define RX_TRAIN_TRAIN_OUTPUT_H

#include "config/config_fields.h"
#include "train/state.h"

typedef struct rx_train_output {
    const rx_train_config *config;
    char *settings; /* of the checkpoint, owned */
} rx_train_output;

/* Errors: RX_USAGE, RX_SYSTEM: outputs that cannot be written are reported before the work. */
rx_status rx_train_output_open(const rx_train_config *config, rx_train_output *dst, rx_error *err);
void rx_train_output_close(rx_train_output *output); /* content only */

/* At the end of an epoch: model, checkpoint and folder. The model is that of the best epoch, with its dictionary. */
rx_status rx_train_output_epoch(const rx_train_output *output, const rx_model *model,
                                const rx_train_state *state, rx_error *err);

/* Within an epoch: the checkpoint alone. */
rx_status rx_train_output_within(const rx_train_output *output, const rx_train_state *kept,
                                 const rx_train_state *now, rx_error *err);

#endif
