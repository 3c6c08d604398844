/* Small models for the tests of NET: random weights, or none (then the network adds nothing). */
#ifndef RX_TESTS_RESTORE_NETWORK_MODEL_H
#define RX_TESTS_RESTORE_NETWORK_MODEL_H

#include "../small_net.h"
#include "nn/model.h"

static inline rx_model *small_model(rx_mode mode, int random)
{
    rx_model *model = rx_model_new();
    assert_non_null(model);
    model->restore = small_net(rx_front_channels(mode), 2);
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
