/* A small model for the command line tests: make_model FILE [BLIND|UNFINISHED|TWO|WIDE]. Its weights are random and
 * small, it was never trained; UNFINISHED: of a training that has not ended; TWO: of two stages; WIDE: a large one. */
#include <stdio.h>
#include <string.h>

#include "nn/model.h"
#include "nn/psfnet.h"

int main(int argc, char **argv)
{
    const int wide = argc > 2 && strcmp(argv[2], "WIDE") == 0;
    const rx_psfnet_shape shape = {.stem = RX_STEM_UNSHUFFLE,
                                   .decoder = RX_DECODER_BILINEAR,
                                   .width = wide ? 32 : 4,
                                   .blocks = wide ? 6 : 2,
                                   .stem_kernel = 3,
                                   .kernel = 3};
    const rx_mode mode = argc > 2 && strcmp(argv[2], "BLIND") == 0 ? RX_MODE_BLIND : RX_MODE_INFORMED;
    rx_error err = RX_ERROR_NONE;
    rx_model *model = rx_model_new();
    if (argc < 2 || model == NULL)
        return 2;
    model->front.mode = mode;
    model->ended = argc <= 2 || strcmp(argv[2], "UNFINISHED") != 0;
    model->front.rl_steps = mode == RX_MODE_INFORMED;
    snprintf(model->name, sizeof model->name, "toy");
    rx_status status = rx_psfnet_new(&shape, rx_front_channels(mode), &model->restore, &err);
    if (status == RX_OK && argc > 2 && strcmp(argv[2], "TWO") == 0)
        status = rx_psfnet_new(&shape, RX_SECOND_CHANNELS, &model->second, &err);
    if (status == RX_OK) {
        rx_net_initialise(model->restore, 7, 0, 0.3, 0.05);
        if (model->second != NULL)
            rx_net_initialise(model->second, 8, 0, 0.3, 0.05);
        status = rx_model_write(model, argv[1], argv[1], &err);
    }
    if (status != RX_OK)
        fprintf(stderr, "make_model: %s\n", err.text);
    rx_model_free(model);
    return status != RX_OK;
}
