/* Which files a run reads and writes, and that no output takes the place of an input or of another output. Private to
 * config/. */
#ifndef RX_CONFIG_OVERWRITE_H
#define RX_CONFIG_OVERWRITE_H

#include "config/keyword.h"

/* The path of an input is without what stands in brackets behind its name, and without '@' before a list; that of an output is
 * the name that it gets: with several restorers there is one of each. */
typedef struct rx_run_file {
    rx_file_role role;
    const char *prefix; /* of the keyword; both live as long as the program */
    const char *key;    /* "IMAGE" for images, "" for other words of the command line and what lists hold */
    char *shown;        /* as the user wrote it */
    char *path;
} rx_run_file;

typedef struct rx_run_files {
    int n;
    rx_run_file *of;
} rx_run_files;

/* By the rows of the table that say READS, WRITES or FOLDER and have an effect with these settings, those of its parts,
 * the configuration file, and `image`: what the command line names ("tile.fits" or "detect.fits,measure.fits", or files
 * of records, one a line; NULL for none). Lists (@NAME) come with what they hold. The caller frees them, in any case. */
rx_status rx_run_files_of(const rx_settings *settings, const char *image, rx_run_files *dst, rx_error *err);
void rx_run_files_free(rx_run_files *files);

/* RX_USAGE when a file that the program of these settings writes is one that it reads or writes as well, whatever names
 * they go by, or is a file of a folder that it reads, or lies in a folder that it replaces; or when that folder holds
 * an input; and for a run that is repeated, when an output is there that the command line does not name. */
rx_status rx_overwrite_check(const rx_settings *settings, const char *image, rx_error *err);

#endif
