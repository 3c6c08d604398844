/* The configuration of rextract: every keyword of keys.def, its value and where it was set.
 *
 * keys.def is THE table: the struct of config_fields.h, defaults, parser, range checks, the -d and -dd
 * dumps, the man page's table, config/default.sex and the record in output headers all come from it.
 * The fields of params that take a value are named in its row; what depends on more than one keyword is said in
 * stage/options.c. The functions are those of config/settings.h.
 */
#ifndef RX_CONFIG_CONFIG_H
#define RX_CONFIG_CONFIG_H

#include "config/settings.h"

typedef struct rx_config rx_config; /* in config/config_fields.h */

rx_status rx_config_new(rx_config **dst, rx_error *err); /* all defaults */
rx_status rx_config_copy(const rx_config *src, rx_config **dst, rx_error *err);
void rx_config_free(rx_config *config); /* NULL is fine */

rx_status rx_config_read(rx_config *config, const char *path, rx_log *log, rx_error *err);
rx_status rx_config_set(rx_config *config, const char *name, const char *value, rx_log *log, rx_error *err);
bool rx_config_states(const rx_config *config, const char *name);

#endif
