/* The typed faces of the settings of each program. */
#include "config/campaign_config.h"
#include "config/train_config.h"

/* rx_settings is the first member of each of these structs, so that a pointer to one is a pointer to the
 * other. */

#define NEW(type, table)                                                                                     \
    rx_status type##_new(type **dst, rx_error *err)                                                          \
    {                                                                                                        \
        rx_settings *settings = NULL;                                                                        \
        const rx_status status = rx_settings_new(table(), &settings, err);                                   \
        if (status == RX_OK)                                                                                 \
            *dst = (type *)settings;                                                                         \
        return status;                                                                                       \
    }                                                                                                        \
    void type##_free(type *config)                                                                           \
    {                                                                                                        \
        rx_settings_free((rx_settings *)config);                                                             \
    }
NEW(rx_config, rx_keytable_rextract)
NEW(rx_simulate_config, rx_keytable_simulate)
NEW(rx_campaign_config, rx_keytable_validate)
NEW(rx_train_config, rx_keytable_train)
#undef NEW

#define COPY(type)                                                                                           \
    rx_status type##_copy(const type *src, type **dst, rx_error *err)                                        \
    {                                                                                                        \
        rx_settings *settings = NULL;                                                                        \
        const rx_status status = rx_settings_copy(&src->settings, &settings, err);                           \
        if (status == RX_OK)                                                                                 \
            *dst = (type *)settings;                                                                         \
        return status;                                                                                       \
    }
COPY(rx_config)
COPY(rx_simulate_config)
#undef COPY

rx_status rx_config_read(rx_config *config, const char *path, rx_log *log, rx_error *err)
{
    return rx_settings_read(&config->settings, path, log, err);
}

rx_status rx_config_set(rx_config *config, const char *name, const char *value, rx_log *log, rx_error *err)
{
    return rx_settings_set(&config->settings, name, value, log, err);
}

rx_status rx_config_check(const rx_config *config, rx_log *log, rx_error *err)
{
    return rx_settings_check(&config->settings, log, err);
}

bool rx_config_states(const rx_config *config, const char *name)
{
    return rx_settings_states(&config->settings, name);
}

bool rx_config_visit(const rx_config *config, rx_settings_visitor visit, void *user)
{
    return rx_settings_visit_exact(&config->settings, visit, user);
}
