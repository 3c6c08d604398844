/* A list of tiles, each a run of its own (stage/stage.h). */
#ifndef RX_SURVEY_SURVEY_H
#define RX_SURVEY_SURVEY_H

#include <stdio.h>

#include "base/error.h"
#include "base/log.h"
#include "config/settings.h"

/* Run every tile that the list at `path` names (config/tiles.h), with the settings of rextract that are
 * common to all. The whole list is checked before the first tile begins; from then on no tile stops the
 * others, and a summary ends the log. Returns what the whole ends with (survey/outcome.h); RX_USAGE, nothing
 * done, for a list that is wrong; RX_INTERRUPTED between tiles or within one, those before are done. */
rx_status rx_survey_run(const rx_settings *common, const char *path, FILE *standard_out, rx_log *log,
                        rx_error *err);

#endif
