/* The configuration: every keyword of keys.def, its value and where it was set.
 *
 * keys.def is THE table: the struct of config_fields.h, defaults, parser, range checks, the -d and -dd
 * dumps, the man page's table, config/default.sex and the record in output headers all come from it.
 * Reads files and arguments; what the values mean to a stage is said in stage/options.c.
 */
#ifndef RX_CONFIG_CONFIG_H
#define RX_CONFIG_CONFIG_H

#include <stdbool.h>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"

enum { RX_LIST = 32 };

/* Lists: n used items. Words are static upper-case strings of keys.def, strings belong to the config. */
typedef struct rx_strings {
    int n;
    char *v[RX_LIST];
} rx_strings;
typedef struct rx_words {
    int n;
    const char *v[RX_LIST];
} rx_words;
typedef struct rx_ints {
    int n;
    int v[RX_LIST];
} rx_ints;
typedef struct rx_reals {
    int n;
    double v[RX_LIST];
} rx_reals;
typedef struct rx_bools {
    int n;
    bool v[RX_LIST];
} rx_bools;

/* Who set a value. */
typedef enum rx_origin { RX_FROM_DEFAULT, RX_FROM_FILE, RX_FROM_COMMAND } rx_origin;

/* Field types: STRING char * (never NULL, "" = none), INT int, REAL double, BOOL bool, WORD const char *
 * (as spelled in keys.def). Field name = keyword in lower case: cfg->detect_thresh.v[0],
 * cfg->restore_type.n. The struct itself is in config/config_fields.h. */
typedef struct rx_config rx_config;

rx_status rx_config_new(rx_config **dst, rx_error *err); /* all defaults */
void rx_config_free(rx_config *config);                  /* NULL is fine */

/* A SExtractor-style file: `KEYWORD value[,value...] # comment`; values apart by blanks, commas, '=' or
 * ';', quotes keep them, [..] keeps its commas, $NAME and ${NAME} are replaced by the environment.
 * Errors: RX_INPUT (file cannot be read), RX_USAGE with file and line (unknown keyword, bad value). */
rx_status rx_config_read(rx_config *config, const char *path, rx_log *log, rx_error *err);

/* One override: name without dash; value as on the command line (a STRING takes it whole). */
rx_status rx_config_set(rx_config *config, const char *name, const char *value, rx_log *log, rx_error *err);

/* After all was read: relations between keys (RX_USAGE), and one warning for each keyword that is
 * accepted but has no effect here. */
rx_status rx_config_check(const rx_config *config, rx_log *log, rx_error *err);

/* Who set keyword `name`; RX_FROM_DEFAULT for a name that is not in the table. */
rx_origin rx_config_was_set(const rx_config *config, const char *name);

/* A commented default.sex: -d (the usual keywords) or -dd (all). NULL config = defaults. */
void rx_config_dump(rx_text *dst, const rx_config *config, bool all);
void rx_config_man(rx_text *dst); /* roff (man macros) of the keyword table, for rextract.conf(5) */

/* Every keyword with its current value as text, in table order, for headers and report. Returns false
 * when memory ran out. */
typedef void (*rx_config_visitor)(void *user, const char *name, const char *value, const char *help);
bool rx_config_visit(const rx_config *config, rx_config_visitor visit, void *user);

#endif
