/* The stage's options for a campaign. */
#include "lab/stage_options.h"

#include <stdio.h>

#include "base/text.h"

rx_status rx_campaign_options(const rx_campaign_config *campaign, rx_log *log, rx_config **config,
                              rx_options **dst, rx_error *err)
{
    rx_text restorers = {0};
    *config = NULL;
    *dst = NULL;
    for (int i = 0; i < campaign->restore_type.n; i++)
        rx_text_printf(&restorers, "%s%s", i > 0 ? "," : "", campaign->restore_type.v[i]);
    if (restorers.failed || restorers.data == NULL) {
        rx_text_free(&restorers);
        return rx_error_memory(err, 0);
    }
    rx_status status = rx_config_copy(campaign->stage, config, err);
    if (status == RX_OK)
        status = rx_settings_set(&(*config)->settings, "RESTORE_TYPE", restorers.data, log, err);
    if (status == RX_OK)
        status = rx_options_from_config(*config, log, dst, err);
    rx_text_free(&restorers);
    if (status != RX_OK) {
        rx_config_free(*config);
        *config = NULL;
        return status;
    }
    rx_pipeline_params *params = &(*dst)->pipeline;
    params->nthreads = params->restore.nthreads = params->measure.nthreads = 1;
    params->detect.nthreads = params->templates.par.nthreads = 1;
    return RX_OK;
}

void rx_campaign_model_words(const rx_options *options, char *dst, size_t size)
{
    dst[0] = '\0';
    if (options->model != NULL)
        snprintf(dst, size, "; NET: model %s, digest %s", options->model->name, options->model->digest);
}
