/* Outputs appear whole or not at all: every file is written in a hidden folder, which only this user can
 * enter, beside its place; commit renames them all once the whole run has succeeded. What a killed process
 * has left of an output goes when the next one reserves it. What is replaced keeps its permissions. */
#ifndef RX_IO_OUTPUT_H
#define RX_IO_OUTPUT_H

#include "base/error.h"
#include "base/log.h"

typedef struct rx_outputs rx_outputs;

rx_status rx_outputs_new(rx_outputs **dst, rx_error *err);

/* Reserve `path` (file) and give the temporary name to write to, owned by the
 * transaction. Its folder is made where it is missing (io/folders.h), and must be writable: checked now, before the work.
 * The same path twice is an RX_USAGE error. Links are followed, but those that another user left in a shared folder
 * (RX_USAGE); a device (/dev/null) gets the bytes at commit and is never replaced. */
rx_status rx_outputs_file(rx_outputs *outputs, const char *path, const char **temporary, rx_error *err);

/* The same for a folder (report): the temporary folder is made, and takes the place of
 * an older one at commit. Only an empty folder is replaced, and one that holds nothing but what a run wrote there
 * (its file .rextract lists it), which is asked now and again at commit; any other, or a plain file, is an RX_USAGE error. */
rx_status rx_outputs_folder(rx_outputs *outputs, const char *path, const char **temporary, rx_error *err);

/* The name that the user gave for what is written as `temporary`, for error messages: a temporary name
 * means nothing to a user. `temporary` itself when it is none of ours; owned by the transaction. */
const char *rx_outputs_shown(const rx_outputs *outputs, const char *temporary);

/* fsync and rename everything; what a failure leaves is removed by rx_outputs_free(). */
rx_status rx_outputs_commit(rx_outputs *outputs, rx_error *err);

/* The last line of a run: what was committed, and `more` (may be NULL), as the user wrote the names. */
void rx_outputs_log(const rx_outputs *outputs, const char *more, rx_log *log);

/* Remove what was not committed and free. NULL is fine. */
void rx_outputs_free(rx_outputs *outputs);

#endif
