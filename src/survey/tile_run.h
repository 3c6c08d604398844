/* One tile with all that a survey wants of it: the run, and its record. */
#ifndef RX_SURVEY_TILE_RUN_H
#define RX_SURVEY_TILE_RUN_H

#include <stdio.h>

#include "base/log.h"
#include "config/settings.h"
#include "config/tiles.h"

/* rx_stage_run() with settings of rextract, then the record (RECORD_NAME), whether the run went well or not;
 * an interrupt leaves none. *others (may be NULL): images that another restorer did than was asked for, once for each
 * restorer. Status and errors of the run; where that is fine, those of writing the record. */
rx_status rx_tile_run(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                      int *others, rx_error *err);

/* The same of tile i of a list. */
rx_status rx_tile_run_listed(const rx_tiles *tiles, int i, const rx_settings *common, FILE *standard_out,
                             rx_log *log, int *others, rx_error *err);

/* Before the first tile: the list, where it is not NULL (rx_tiles_check()), and a warning of the keywords that were given
 * in vain. */
rx_status rx_tile_check(const rx_settings *common, const rx_tiles *tiles, rx_log *log, rx_error *err);

#endif
