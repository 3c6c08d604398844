/* PLAN: what tiles will need, as JSON, and nothing else done. */
#ifndef RX_STAGE_PLAN_H
#define RX_STAGE_PLAN_H

#include <stdio.h>

#include "base/log.h"
#include "config/settings.h"

/* Bounds of the peak memory and of the size of all outputs, from headers, of `image` or of each tile of a list, "@LIST", to
 * `standard_out`. A tile of a list that cannot be planned has "error" in place of the numbers, and the status is
 * RX_SOME_FAILED; of a single tile nothing is printed then. */
rx_status rx_plan_run(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                      rx_error *err);

#endif
