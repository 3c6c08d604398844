/* The typed faces of the settings of each program. */
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
NEW_AND_FREE(rx_train_config, rx_keytable_train)
COPY(rx_config)
COPY(rx_simulate_config)
