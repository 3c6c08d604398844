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

/* The same informed model with a second stage, with random weights. */
static inline rx_model *small_stages(void)
{
    rx_model *model = small_model(RX_MODE_INFORMED, 1);
    model->second = small_net(RX_SECOND_CHANNELS, 2);
    rx_net_initialise(model->second, 7, 1, 0.3, 0.05);
    return model;
}

#endif
