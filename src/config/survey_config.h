/* The configuration of rextract-survey: one field per keyword of survey.def, made by the preprocessor.
 * Everything is done by rx_settings_new() ... on &config->settings. */
#ifndef RX_CONFIG_SURVEY_CONFIG_H
#define RX_CONFIG_SURVEY_CONFIG_H

#include "config/config_fields.h"

typedef struct rx_survey_config {
    rx_settings settings;
#define SECTION(id, title)
#define KEY(kind, NAME, field, ...) RX_FIELD_##kind field;
#include "config/survey.def"
#undef KEY
#undef SECTION
} rx_survey_config;

#endif
