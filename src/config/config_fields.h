/* struct rx_config: one field per keyword of keys.def, made by the preprocessor; types by kind as
 * config/settings.h says. */
#ifndef RX_CONFIG_CONFIG_FIELDS_H
#define RX_CONFIG_CONFIG_FIELDS_H

#include "config/config.h"

struct rx_config {
    rx_settings settings;
#define SECTION(id, title)
#define KEY(kind, NAME, field, ...) RX_FIELD_##kind field;
#include "config/keys.def"
#undef KEY
#undef SECTION
};

#endif
