/* Files of a training. */
#include "train/train_output.h"

#include <stdlib.h>
#include <string.h>

#include "io/output.h"
#include "train/checkpoint.h"
#include "train/setup.h"
#include "train/train_page.h"
#include "validate/report_file.h"

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
    rx_text_free(&output->page);
    *output = (rx_train_output){0};
}

static rx_status make_page(rx_train_output *output, const rx_model *model, const rx_train_state *state,
                           const char *folder, rx_error *err)
{
    const rx_train_page page = {
        .history = &state->history,
        .selection = &state->selection,
        .model = model,
        .settings = output->settings,
        .figures = output->config->qa_figures,
    };
    rx_text_free(&output->page);
    return rx_train_page_write(&page, folder, output->config->output_name, &output->page, err);
}

static rx_status write_folder(rx_train_output *output, const rx_model *model, const rx_train_state *state,
                              int new_page, const char *folder, rx_error *err)
{
    const char *shown = output->config->output_name;
    rx_text log = {0}, dictionaries = {0}, page = {0};
    rx_status status = RX_OK;
    if (new_page)
        status = make_page(output, model, state, folder, err);
    rx_history_log(&state->history, model->name, &log);
    rx_history_dictionaries(&state->history, &state->selection, model->name, &dictionaries);
    rx_text_add_bytes(&page, output->page.data != NULL ? output->page.data : "", output->page.length);
    if (status == RX_OK)
        status = rx_report_file(folder, shown, "log.ecsv", &log, err);
    if (status == RX_OK)
        status = rx_report_file(folder, shown, "dictionary.ecsv", &dictionaries, err);
    if (status == RX_OK)
        status = rx_report_file(folder, shown, "training.html", &page, err);
    rx_text_free(&log);
    rx_text_free(&dictionaries);
    rx_text_free(&page);
    return status;
}

rx_status rx_train_output_epoch(rx_train_output *output, const rx_model *model, const rx_train_state *state,
                                int last, rx_error *err)
{
    const rx_train_config *config = output->config;
    const int new_page = last || output->page.length == 0 || state->epoch % config->plot_epochs == 0;
    const char *model_file, *checkpoint, *folder;
    rx_outputs *outputs = NULL;
    rx_status status = rx_outputs_new(&outputs, err);
    if (status == RX_OK)
        status = rx_outputs_file(outputs, config->model_name, &model_file, err);
    if (status == RX_OK)
        status = rx_model_write(model, model_file, config->model_name, err);
    if (status == RX_OK)
        status = rx_outputs_file(outputs, config->checkpoint_name, &checkpoint, err);
    if (status == RX_OK)
        status = rx_checkpoint_write(checkpoint, config->checkpoint_name, output->settings, state, NULL, err);
    if (status == RX_OK)
        status = rx_outputs_folder(outputs, config->output_name, &folder, err);
    if (status == RX_OK)
        status = write_folder(output, model, state, new_page, folder, err);
    if (status == RX_OK)
        status = rx_outputs_commit(outputs, err);
    rx_outputs_free(outputs);
    return status;
}

rx_status rx_train_output_within(const rx_train_output *output, const rx_train_state *kept,
                                 const rx_train_state *now, rx_error *err)
{
    const char *name = output->config->checkpoint_name, *checkpoint;
    rx_outputs *outputs = NULL;
    rx_status status = rx_outputs_new(&outputs, err);
    if (status == RX_OK)
        status = rx_outputs_file(outputs, name, &checkpoint, err);
    if (status == RX_OK)
        status = rx_checkpoint_write(checkpoint, name, output->settings, kept, now, err);
    if (status == RX_OK)
        status = rx_outputs_commit(outputs, err);
    rx_outputs_free(outputs);
    return status;
}
