/* Small models for the tests of NET: random weights, or none (then the network adds nothing). */
#ifndef RX_TESTS_RESTORE_NETWORK_MODEL_H
#define RX_TESTS_RESTORE_NETWORK_MODEL_H

#include "nn/model.h"
#include "nn/psfnet.h"

static inline rx_model *small_model(rx_mode mode, int random)
{
    const rx_psfnet_shape shape = {.stem = RX_STEM_UNSHUFFLE,
                                   .decoder = RX_DECODER_BILINEAR,
                                   .width = 4,
                                   .blocks = 2,
                                   .stem_kernel = 3,
                                   .kernel = 3};
    rx_model *model = rx_model_new();
    rx_error err = RX_ERROR_NONE;
    if (model == NULL || rx_psfnet_new(&shape, rx_front_channels(mode), &model->restore, &err) != RX_OK)
        fail_msg("%s", err.text);
    model->front = (rx_front){.mode = mode,
                              .target_fwhm = 2,
                              .tikhonov = 0.02,
                              .rl_steps = mode == RX_MODE_INFORMED,
                              .pedestal = 1};
    snprintf(model->name, sizeof model->name, "small");
    if (random)
        rx_net_initialise(model->restore, 7, 0, 0.3, 0.05);
    return model;
}

#endif
