/* The configurations of the programs: one field per keyword of the program's .def file, made by the preprocessor; types
 * by kind as config/settings.h says. keys.def is THE table of rextract: the struct, defaults, parser, range checks, the -d and
 * -dd dumps, the man page's table, config/default.sex and the record in output headers all come from it. The fields of params
 * that take a value are named in its row; what depends on more than one keyword is said in stage/options.c.
 *
 * All but new, copy and free is done by rx_settings_set(), rx_settings_check(), rx_settings_visit() ... on
 * &config->settings, which reach the parts too. */
#ifndef RX_CONFIG_CONFIG_FIELDS_H
#define RX_CONFIG_CONFIG_FIELDS_H

#include "config/settings.h"

#define SECTION(id, title)
#define KEY(kind, NAME, field, ...) RX_FIELD_##kind field;

typedef struct rx_config { /* rextract */
    rx_settings settings;
#include "config/keys.def"
} rx_config;

typedef struct rx_simulate_config { /* rextract-simulate */
    rx_settings settings;
#include "config/simulate.def"
} rx_simulate_config;

typedef struct rx_campaign_config { /* rextract-validate */
    rx_settings settings;
#include "config/campaign.def"
    rx_simulate_config *sim; /* SIM.<KEYWORD>; from that program's defaults; owned, as the other parts */
    rx_config *stage;        /* STAGE.<KEYWORD> */
} rx_campaign_config;

typedef struct rx_train_config { /* rextract-train */
    rx_settings settings;
#include "config/train.def"
    rx_simulate_config *sim; /* SIM.<KEYWORD>: the population of the training scenes */
} rx_train_config;

typedef struct rx_survey_config { /* rextract-survey */
    rx_settings settings;
#include "config/survey.def"
} rx_survey_config;

#undef KEY
#undef SECTION

/* With all defaults. */
rx_status rx_config_new(rx_config **dst, rx_error *err);
rx_status rx_simulate_config_new(rx_simulate_config **dst, rx_error *err);
rx_status rx_train_config_new(rx_train_config **dst, rx_error *err);
rx_status rx_config_copy(const rx_config *src, rx_config **dst, rx_error *err);
rx_status rx_simulate_config_copy(const rx_simulate_config *src, rx_simulate_config **dst, rx_error *err);
/* NULL is fine. */
void rx_config_free(rx_config *config);
void rx_simulate_config_free(rx_simulate_config *config);
void rx_train_config_free(rx_train_config *config);

/* SHARD "k/n" as numbers, 1 <= k <= n. Errors: RX_USAGE (anything else). */
rx_status rx_campaign_config_shard(const rx_campaign_config *config, int *k, int *n, rx_error *err);

#endif
