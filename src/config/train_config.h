/* The configuration of rextract-train: one field per keyword of train.def, made by the preprocessor, and the
 * settings of the simulator for the population of the training scenes, which SIM.<KEYWORD> sets. Everything
 * but new, copy and free is done by rx_settings_set() ... on &config->settings. */
#ifndef RX_CONFIG_TRAIN_CONFIG_H
#define RX_CONFIG_TRAIN_CONFIG_H

#include "config/config_fields.h"
#include "config/simulate_config.h"

typedef struct rx_train_config {
    rx_settings settings;
#define SECTION(id, title)
#define KEY(kind, NAME, field, ...) RX_FIELD_##kind field;
#include "config/train.def"
#undef KEY
#undef SECTION
    rx_simulate_config *sim; /* owned */
} rx_train_config;

rx_status rx_train_config_new(rx_train_config **dst, rx_error *err); /* all defaults */
void rx_train_config_free(rx_train_config *config);                  /* NULL is fine */

#endif
