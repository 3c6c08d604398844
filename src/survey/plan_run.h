/* PLAN: what tiles will take, as JSON, and nothing else done. */
#ifndef RX_SURVEY_PLAN_RUN_H
#define RX_SURVEY_PLAN_RUN_H

#include <stdio.h>

#include "base/error.h"
#include "base/log.h"
#include "config/settings.h"

/* The plan (stage/plan.h) of `image`, or of each tile of a list, "@LIST", to `standard_out`:
 *
 *   {"version": , "tiles": [{"image": , "images": , "pixels": , "sources_per_mpixel": , "sources": ,
 * "threads": , "memory_bytes": , "cpu_seconds": , "output_bytes": , "outputs": [{"name": , "bytes": }, ...]},
 * ...], "all": {"tiles": , "failed": , "memory_bytes": , "cpu_seconds": , "output_bytes": }}
 *
 * of all tiles memory_bytes is the largest, the rest sums. A tile of a list that cannot be planned has
 * "error" in place of the numbers; the status is then RX_SOME_FAILED. Of a single tile: its error, nothing
 * printed. */
rx_status rx_plan_run(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                      rx_error *err);

#endif
