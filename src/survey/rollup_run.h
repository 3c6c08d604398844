/* rextract-survey's job. */
#ifndef RX_SURVEY_ROLLUP_RUN_H
#define RX_SURVEY_ROLLUP_RUN_H

#include "base/error.h"
#include "base/log.h"
#include "config/config_fields.h"

/* Read the records in the files of `given`, one a line, of which "@FILE" stands for those that it lists; write the
 * merged records and the report. Errors: RX_INPUT (records, survey/tile_record.h; the list), RX_USAGE
 * (TILES_NAME, folders), RX_SYSTEM, RX_INTERRUPTED. Tiles that failed are named in the report and the log, and
 * are no error. */
rx_status rx_rollup_files(const rx_survey_config *config, const char *given, rx_log *log, rx_error *err);

#endif
