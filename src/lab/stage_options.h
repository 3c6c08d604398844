/* The stage's options for a campaign: the STAGE. keywords, with the restorers of the campaign. */
#ifndef RX_LAB_STAGE_OPTIONS_H
#define RX_LAB_STAGE_OPTIONS_H

#include "base/error.h"
#include "base/log.h"
#include "config/campaign_config.h"
#include "stage/options.h"

/* RESTORE_TYPE of the campaign stands for that of the stage, so that what its restorers need (a model file)
 * is read. The options point into *config, a copy that is to be freed after them, by rx_config_free();
 * everything on one thread. */
rx_status rx_campaign_options(const rx_campaign_config *campaign, rx_log *log, rx_config **config,
                              rx_options **dst, rx_error *err);

/* "; NET: model psfnet, digest 0123456789abcdef", or "" without one: for the report. */
void rx_campaign_model_words(const rx_options *options, char *dst, size_t size);

#endif
