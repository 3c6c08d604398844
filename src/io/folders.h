/* Folders that outputs lie in: made where they are missing, and removed again, unless something lies in them, when the
 * outputs do not come. Other processes may make, use and remove the same ones meanwhile. */
#ifndef RX_IO_FOLDERS_H
#define RX_IO_FOLDERS_H

#include <stddef.h>

#include "base/error.h"

/* Those that were made, in that order; {0} at first. */
typedef struct rx_folders {
    char **path;
    size_t n;
} rx_folders;

/* The folder that `path` lies in, and those above it. RX_SYSTEM with `shown`, the user's name of the output, when one
 * cannot be made. */
rx_status rx_folders_make(rx_folders *made, const char *path, const char *shown, rx_error *err);

/* Remove a file, or a folder with all that is in it; links are not followed, failures are ignored. */
void rx_output_remove(const char *path);

/* Remove those that are empty, and free the list. */
void rx_folders_free(rx_folders *made);

#endif
