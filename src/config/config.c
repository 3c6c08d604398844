/* The typed faces of the settings of each program. */
#include "config/campaign_config.h"
#include "config/train_config.h"

/* rx_settings is the first member of each of these structs, so that a pointer to one is a pointer to the
 * other. */

rx_status rx_config_new(rx_config **dst, rx_error *err)
{
    rx_settings *settings = NULL;
    rx_status status = rx_settings_new(rx_keytable_rextract(), &settings, err);
    if (status == RX_OK)
        *dst = (rx_config *)settings;
    return status;
}

rx_status rx_config_copy(const rx_config *src, rx_config **dst, rx_error *err)
{
    rx_settings *settings = NULL;
    rx_status status = rx_settings_copy(&src->settings, &settings, err);
    if (status == RX_OK)
        *dst = (rx_config *)settings;
    return status;
}

void rx_config_free(rx_config *config)
{
    rx_settings_free((rx_settings *)config);
}

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

rx_origin rx_config_was_set(const rx_config *config, const char *name)
{
    return rx_settings_was_set(&config->settings, name);
}

bool rx_config_states(const rx_config *config, const char *name)
{
    return rx_settings_states(&config->settings, name);
}

bool rx_config_visit(const rx_config *config, rx_settings_visitor visit, void *user)
{
    return rx_settings_visit_exact(&config->settings, visit, user);
}

rx_status rx_simulate_config_new(rx_simulate_config **dst, rx_error *err)
{
    rx_settings *settings = NULL;
    rx_status status = rx_settings_new(rx_keytable_simulate(), &settings, err);
    if (status == RX_OK)
        *dst = (rx_simulate_config *)settings;
    return status;
}

rx_status rx_simulate_config_copy(const rx_simulate_config *src, rx_simulate_config **dst, rx_error *err)
{
    rx_settings *settings = NULL;
    rx_status status = rx_settings_copy(&src->settings, &settings, err);
    if (status == RX_OK)
        *dst = (rx_simulate_config *)settings;
    return status;
}

void rx_simulate_config_free(rx_simulate_config *config)
{
    rx_settings_free((rx_settings *)config);
}

rx_status rx_campaign_config_new(rx_campaign_config **dst, rx_error *err)
{
    rx_settings *settings = NULL;
    rx_status status = rx_settings_new(rx_keytable_validate(), &settings, err);
    if (status == RX_OK)
        *dst = (rx_campaign_config *)settings;
    return status;
}

void rx_campaign_config_free(rx_campaign_config *config)
{
    rx_settings_free((rx_settings *)config);
}

rx_status rx_train_config_new(rx_train_config **dst, rx_error *err)
{
    rx_settings *settings = NULL;
    rx_status status = rx_settings_new(rx_keytable_train(), &settings, err);
    if (status == RX_OK)
        *dst = (rx_train_config *)settings;
    return status;
}

void rx_train_config_free(rx_train_config *config)
{
    rx_settings_free((rx_settings *)config);
}
