/* rextract-survey's job. */
#ifndef RX_SURVEY_ROLLUP_RUN_H
#define RX_SURVEY_ROLLUP_RUN_H

#include "base/error.h"
#include "base/log.h"
#include "config/survey_config.h"

/* Read the records in the file `name`, or in those that the file behind "@" lists, one a line; write the
 * merged records and the report. Errors: RX_INPUT (records, survey/tile_record.h; the list), RX_USAGE
 * (TILES_NAME, folders), RX_SYSTEM, RX_INTERRUPTED. Tiles that failed are told in the report and the log, and
 * are no error. */
rx_status rx_rollup_files(const rx_survey_config *config, const char *name, rx_log *log, rx_error *err);

#endif
