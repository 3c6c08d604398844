/* The command line of a program, SExtractor's way, turned into its settings and, for rextract, an image. */
#ifndef RX_CONFIG_ARGUMENTS_H
#define RX_CONFIG_ARGUMENTS_H

#include "base/error.h"
#include "base/log.h"
#include "config/settings.h"

typedef enum rx_action {
    RX_ACTION_RUN,
    RX_ACTION_NONE, /* no argument at all */
    RX_ACTION_HELP,
    RX_ACTION_VERSION,
    RX_ACTION_DUMP,         /* -d */
    RX_ACTION_DUMP_ALL,     /* -dd */
    RX_ACTION_DUMP_COLUMNS, /* -dp */
    RX_ACTION_FLAGS,        /* -FLAGS [SUM] */
    RX_ACTION_INFO          /* -INFO FILE */
} rx_action;

typedef struct rx_arguments {
    rx_action action;
    /* rextract, RUN: "tile.fits", "detect.fits,measure.fits" or "@list"; rextract-survey: names of files of
     * records, or "@list", a line each; INFO: the file; FLAGS: the sum, NULL = all bits; else NULL */
    char *image;
    rx_settings *settings; /* of the table; RUN only, else NULL */
} rx_arguments;

/* Read argv. A word that begins with '-' is an option: -c FILE, -d, -dd, -dp (rextract), -v, -h (also -help, --help,
 * help alone, -version, --version), -INFO FILE (rextract-train), -FLAGS [SUM] (rextract), anything else -KEYWORD
 * VALUE. Other words are rextract's images, two at most (none: with an output of -c those of its run), or the campaign
 * or training file of rextract-validate and rextract-train, in place of -c;
 * rextract-simulate takes none. Then the settings are made: defaults, the file of -c (rextract without -c:
 * default.sex where it exists, else a warning), the keywords in their order, the checks between them;
 * log->level follows VERBOSE_TYPE. "{tile}" in names becomes the image's own name, and no output may be an
 * input; of a list, "@FILE", that is left to each of its tiles. Errors: RX_USAGE. rx_arguments_free() after
 * success and failure. */
rx_status rx_arguments_read(const rx_keytable *table, int argc, char *const *argv, rx_log *log,
                            rx_arguments *dst, rx_error *err);

void rx_arguments_free(rx_arguments *arguments);

#endif
