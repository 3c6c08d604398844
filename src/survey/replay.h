/* Running again from the record in an output (stage/provenance.h), and comparing digests. */
#ifndef RX_SURVEY_REPLAY_H
#define RX_SURVEY_REPLAY_H

#include "base/error.h"
#include "base/log.h"
#include "config/settings.h"

/* Repeat the run that wrote the file at `path`, FITS or a text with its record in lines of '#', in a folder in TMPDIR that is
 * removed, and compare all that it has read and made. Of `extra` only settings count that change no result.
 *
 * Errors: RX_DIFFERENT (each difference is a warning of the log), RX_INPUT (no record; an input is missing or has changed),
 * RX_USAGE (extra), else those of the run. */
rx_status rx_replay_run(const rx_settings *extra, const char *path, rx_log *log, rx_error *err);

#endif
