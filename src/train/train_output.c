/* Files of a training. */
#include "train/train_output.h"

#include <stdlib.h>

#include "io/output.h"
#include "train/checkpoint.h"
#include "train/setup.h"
#include "train/train_page.h"

rx_status rx_train_output_open(const rx_train_config *config, rx_train_output *dst, rx_error *err)
{
    rx_outputs *outputs = NULL;
    rx_text settings = {0};
    const char *temporary;
    *dst = (rx_train_output){.config = config};
    rx_status status = rx_setup_text(config, RX_SETUP_ALL, &settings, err);
    dst->settings = settings.data;
    if (status == RX_OK)
        status = rx_outputs_new(&outputs, err);
    if (status == RX_OK)
        status = rx_outputs_file(outputs, config->model_name, &temporary, err);
    if (status == RX_OK)
        status = rx_outputs_file(outputs, config->checkpoint_name, &temporary, err);
    if (status == RX_OK)
        status = rx_outputs_folder(outputs, config->output_name, &temporary, err);
    rx_outputs_free(outputs);
    return status;
}

void rx_train_output_close(rx_train_output *output)
{
    free(output->settings);
    *output = (rx_train_output){0};
}

rx_status rx_train_output_epoch(const rx_train_output *output, const rx_model *model,
                                const rx_train_state *state, rx_error *err)
{
    const rx_train_config *config = output->config;
    const rx_train_page page = {
        .history = &state->history,
        .selection = &state->selection,
        .model = model,
        .settings = output->settings,
        .figures = config->qa_figures,
    };
    const char *model_file, *checkpoint, *folder;
    rx_outputs *outputs = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_outputs_new(&outputs, err));
    RX_TRY_EXIT(rx_outputs_file(outputs, config->model_name, &model_file, err));
    RX_TRY_EXIT(rx_model_write(model, model_file, config->model_name, err));
    RX_TRY_EXIT(rx_outputs_file(outputs, config->checkpoint_name, &checkpoint, err));
    RX_TRY_EXIT(rx_checkpoint_write(checkpoint, config->checkpoint_name, output->settings, state, NULL, err));
    RX_TRY_EXIT(rx_outputs_folder(outputs, config->output_name, &folder, err));
    RX_TRY_EXIT(rx_train_page_write(&page, folder, config->output_name, err));
    status = rx_outputs_commit(outputs, err);
exit:
    rx_outputs_free(outputs);
    return status;
}

rx_status rx_train_output_within(const rx_train_output *output, const rx_train_state *kept,
                                 const rx_train_state *now, rx_error *err)
{
    const char *name = output->config->checkpoint_name, *checkpoint;
    rx_outputs *outputs = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_outputs_new(&outputs, err));
    RX_TRY_EXIT(rx_outputs_file(outputs, name, &checkpoint, err));
    RX_TRY_EXIT(rx_checkpoint_write(checkpoint, name, output->settings, kept, now, err));
    RX_TRY_EXIT(rx_outputs_commit(outputs, err));
exit:
    rx_outputs_free(outputs);
    return status;
}
