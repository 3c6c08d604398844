/* Names of files as the command line of rextract-survey gives them. */
#ifndef RX_SURVEY_FILE_NAMES_H
#define RX_SURVEY_FILE_NAMES_H

#include "base/error.h"

typedef struct rx_file_names {
    int n;
    char **of; /* [n] owned */
} rx_file_names;

/* `given`: names with \n between them; one that begins with @ is a file that lists some, one a line (blank lines and
 * those that begin with # do not count). Errors: RX_INPUT, RX_SYSTEM; free in any case. */
rx_status rx_file_names_read(const char *given, rx_file_names *dst, rx_error *err);
void rx_file_names_free(rx_file_names *names); /* content only */

#endif
