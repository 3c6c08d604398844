/* The configuration of rextract-simulate: one field per keyword of simulate.def, made by the preprocessor;
 * types by kind as config/settings.h says. Everything but new, copy and free is done by rx_settings_set(),
 * rx_settings_check(), rx_settings_visit() ... on &config->settings. */
#ifndef RX_CONFIG_SIMULATE_CONFIG_H
#define RX_CONFIG_SIMULATE_CONFIG_H

#include "config/settings.h"

typedef struct rx_simulate_config {
    rx_settings settings;
#define SECTION(id, title)
#define KEY(kind, NAME, field, ...) RX_FIELD_##kind field;
#include "config/simulate.def"
#undef KEY
#undef SECTION
} rx_simulate_config;

rx_status rx_simulate_config_new(rx_simulate_config **dst, rx_error *err); /* all defaults */
rx_status rx_simulate_config_copy(const rx_simulate_config *src, rx_simulate_config **dst, rx_error *err);
void rx_simulate_config_free(rx_simulate_config *config); /* NULL is fine */

#endif
