/* The typed faces of the settings of each program. */
#include "config/config.h"

#include "config/config_fields.h"

/* rx_settings is the first member of each of these structs, so that a pointer to one is a pointer to the
 * other. */
#define NEW_AND_FREE(NAME, TABLE)                                                                            \
    rx_status NAME##_new(NAME **dst, rx_error *err)                                                          \
    {                                                                                                        \
        rx_settings *settings = NULL;                                                                        \
        RX_TRY(rx_settings_new(TABLE(), &settings, err));                                                    \
        *dst = (NAME *)settings;                                                                             \
        return RX_OK;                                                                                        \
    }                                                                                                        \
    void NAME##_free(NAME *config)                                                                           \
    {                                                                                                        \
        rx_settings_free((rx_settings *)config);                                                             \
    }
#define COPY(NAME)                                                                                           \
    rx_status NAME##_copy(const NAME *src, NAME **dst, rx_error *err)                                        \
    {                                                                                                        \
        rx_settings *settings = NULL;                                                                        \
        RX_TRY(rx_settings_copy(&src->settings, &settings, err));                                            \
        *dst = (NAME *)settings;                                                                             \
        return RX_OK;                                                                                        \
    }

NEW_AND_FREE(rx_config, rx_keytable_rextract)
NEW_AND_FREE(rx_simulate_config, rx_keytable_simulate)
NEW_AND_FREE(rx_campaign_config, rx_keytable_validate)
NEW_AND_FREE(rx_train_config, rx_keytable_train)
COPY(rx_config)
COPY(rx_simulate_config)

rx_status rx_config_read(rx_config *config, const char *path, rx_log *log, rx_error *err)
{
    return rx_settings_read(&config->settings, path, log, err);
}

rx_status rx_config_set(rx_config *config, const char *name, const char *value, rx_log *log, rx_error *err)
{
    return rx_settings_set(&config->settings, name, value, log, err);
}

bool rx_config_states(const rx_config *config, const char *name)
{
    return rx_settings_states(&config->settings, name);
}
