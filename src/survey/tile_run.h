/* One tile of a list. */
#ifndef RX_SURVEY_TILE_RUN_H
#define RX_SURVEY_TILE_RUN_H

#include <stdio.h>

#include "base/log.h"
#include "config/tiles.h"

/* The run of tile i; *why is RX_ERROR_NONE before, and says afterwards what is wrong. Status and errors as of
 * rx_stage_run(). */
rx_status rx_tile_run(const rx_tiles *tiles, int i, const rx_settings *common, FILE *standard_out,
                      rx_log *log, rx_error *why);

#endif
