/* Keywords that were given and have no effect: one warning for all of them, with what each would need.
 *
 * What a keyword needs stands in its row of the table (keys.def, NEEDS). A value counts as given on the command line,
 * whatever it is; in a file where it is not the default and the file is not one that states what it needs as well: a survey's
 * file has WEIGHT_IMAGE ready beside WEIGHT_TYPE NONE, and a dump of SExtractor's states every keyword.
 */
#ifndef RX_CONFIG_IDLE_H
#define RX_CONFIG_IDLE_H

#include "config/settings.h"

typedef struct rx_idle {
    /* Has the catalogue a column whose name contains `part`? NULL: conditions on columns are taken as met. */
    int (*has_column)(const void *columns, const char *part);
    const void *columns;
    /* By row of the table; of a list, a keyword that counts in one of the tiles that give it is not idle. */
    int nrows;
    bool *counts;
    char **why; /* "PSF_NAME a.psf has no effect without PSF_TYPE FILE or PSFEX", or NULL; owned */
} rx_idle;

/* The keywords of one tile, or of the run; all of one table. Errors: RX_SYSTEM. */
rx_status rx_idle_add(rx_idle *idle, const rx_settings *settings, rx_error *err);
/* What was found of all that was added. */
void rx_idle_warn(rx_idle *idle, rx_log *log);
void rx_idle_free(rx_idle *idle);

/* All of this for one struct of settings; idle: with the columns, {0} for a program whose keywords do not depend on them. */
rx_status rx_settings_warn_idle(const rx_settings *settings, rx_idle idle, rx_log *log, rx_error *err);

#endif
