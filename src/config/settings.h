/* Settings of a program: every keyword of its table, its value and where it was set.
 *
 * Each program has one table (keys.def, simulate.def, campaign.def, train.def), and everything comes from it:
 * the struct with a field per keyword, defaults, parser, range checks, the -d and -dd dumps, the table of the
 * manual page and the record in outputs. A program's struct (rx_config, rx_simulate_config,
 * rx_campaign_config, rx_train_config) begins with rx_settings; the functions here work on any of them, given
 * &config->settings.
 */
#ifndef RX_CONFIG_SETTINGS_H
#define RX_CONFIG_SETTINGS_H

#include <stdbool.h>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "config/values.h"

/* The tables of the programs. */
const rx_keytable *rx_keytable_rextract(void); /* rx_config */
const rx_keytable *rx_keytable_simulate(void); /* rx_simulate_config */
const rx_keytable *rx_keytable_validate(void); /* rx_campaign_config */
const rx_keytable *rx_keytable_train(void);    /* rx_train_config */
const rx_keytable *rx_keytable_survey(void);   /* rx_survey_config */

/* All defaults, and a copy; *dst begins the struct of the table. rx_settings_free() frees that struct with
 * all it owns, NULL is fine. */
rx_status rx_settings_new(const rx_keytable *table, rx_settings **dst, rx_error *err);
rx_status rx_settings_copy(const rx_settings *src, rx_settings **dst, rx_error *err);
void rx_settings_free(rx_settings *settings);

/* A SExtractor-style file: `KEYWORD value[,value...] # comment`; values apart by blanks, commas, '=' or
 * ';', quotes keep them, [..] keeps its commas, $NAME and ${NAME} are replaced by the environment.
 * Errors: RX_USAGE, with file and line (unknown keyword, bad value), or because the file cannot be read.
 * Or, with the table of rextract, an output of an earlier run, FITS or a text, whose settings are taken
 * (io/record_read.h) with its record (settings->repeated). Errors: RX_INPUT. */
rx_status rx_settings_read(rx_settings *settings, const char *path, rx_log *log, rx_error *err);

/* One override: name without dash; value as on the command line (a STRING takes it whole). */
rx_status rx_settings_set(rx_settings *settings, const char *name, const char *value, rx_log *log,
                          rx_error *err);

/* "{tile}" in every value that is a name becomes `tile`. Errors: RX_SYSTEM without memory. */
rx_status rx_settings_name_tile(rx_settings *settings, const char *tile, rx_error *err);

/* After all was read: relations between keys (RX_USAGE). Keywords given in vain: config/idle.h. */
rx_status rx_settings_check(const rx_settings *settings, rx_error *err);

/* The same once names of files that a configuration has are those of the files that are meant. */
rx_status rx_settings_complete(rx_settings *settings, rx_log *log, rx_error *err);

/* Who set keyword `name`; RX_FROM_DEFAULT for a name that is not in the table. */
rx_origin rx_settings_was_set(const rx_settings *settings, const char *name);

/* Does its value state something about the data? A default does not, nor a file that repeats it. */
bool rx_settings_states(const rx_settings *settings, const char *name);

/* RX_USAGE when an output of the run is the file `name`, or a folder that it replaces holds that: for files that turn
 * out to be inputs while the run is under way. The same of all that a run with settings `others` reads; and of a folder
 * that the run replaces in place of the one that `key` names. */
rx_status rx_settings_check_read(const rx_settings *settings, const char *name, rx_error *err);
rx_status rx_settings_check_folder(const rx_settings *settings, const char *image, const char *key,
                                   const char *folder, rx_error *err);
rx_status rx_settings_check_inputs(const rx_settings *settings, const rx_settings *others, const char *image,
                                   rx_error *err);

/* Every keyword with its current value as text, in table order, those of parts with their prefix after the
 * others: for headers and reports; `exact`: as a file would have it. Returns false when memory ran out. */
typedef void (*rx_settings_visitor)(void *user, const char *name, const char *value, const char *help);
bool rx_settings_visit(const rx_settings *settings, bool exact, rx_settings_visitor visit, void *user);

/* A commented configuration file: the usual keywords, or all, those of parts included. NULL settings =
 * defaults. */
void rx_settings_dump(rx_text *dst, const rx_keytable *table, const rx_settings *settings, bool all);

/* Names of the keywords that have an effect, by section, for -h. */
void rx_settings_help(rx_text *dst, const rx_keytable *table);

#endif
