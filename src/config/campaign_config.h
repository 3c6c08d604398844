/* The configuration of rextract-validate: one field per keyword of campaign.def, made by the preprocessor,
 * and the settings of the two programs that a campaign runs, which SIM.<KEYWORD> and STAGE.<KEYWORD> set.
 * They start from those programs' defaults. Everything but new, copy and free is done by rx_settings_set(),
 * rx_settings_check(), rx_settings_visit() ... on &config->settings; these reach the parts too. */
#ifndef RX_CONFIG_CAMPAIGN_CONFIG_H
#define RX_CONFIG_CAMPAIGN_CONFIG_H

#include "config/config_fields.h"
#include "config/simulate_config.h"

typedef struct rx_campaign_config {
    rx_settings settings;
#define SECTION(id, title)
#define KEY(kind, NAME, field, ...) RX_FIELD_##kind field;
#include "config/campaign.def"
#undef KEY
#undef SECTION
    rx_simulate_config *sim; /* owned */
    rx_config *stage;        /* owned */
} rx_campaign_config;

rx_status rx_campaign_config_new(rx_campaign_config **dst, rx_error *err); /* all defaults */
void rx_campaign_config_free(rx_campaign_config *config);                  /* NULL is fine */

/* SHARD "k/n" as numbers, 1 <= k <= n. Errors: RX_USAGE (anything else). */
rx_status rx_campaign_config_shard(const rx_campaign_config *config, int *k, int *n, rx_error *err);

#endif
