/* Running again from the record in an output, and comparing. */
#ifndef RX_SURVEY_REPLAY_H
#define RX_SURVEY_REPLAY_H

#include "base/error.h"
#include "base/log.h"
#include "config/settings.h"

/* Repeat the run that wrote the file at `path` and compare the digests of all that its record names. Nothing
 * is written but a folder in TMPDIR, which is removed. `extra` are settings of rextract of which only those
 * count that were set; they may hold nothing that changes results. Another version or class of machines is
 * reported, and the run is compared all the same.
 *
 * Errors: RX_DIFFERENT when anything differs, rows or pixels here from those that were recorded included
 * (each is named in the log); RX_INPUT when the file holds no record, or an input of the run is missing or has
 * changed; RX_USAGE (extra); else those of the run. */
rx_status rx_replay_run(const rx_settings *extra, const char *path, rx_log *log, rx_error *err);

#endif
