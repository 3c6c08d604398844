/* The main job: one tile file in, restored images, catalogues and report out. */
#ifndef RX_STAGE_STAGE_H
#define RX_STAGE_STAGE_H

#include <stdio.h>

#include "base/error.h"
#include "base/log.h"
#include "config/config_fields.h"

/* Run everything `config` asks for on `image` ("tile.fits" or "detect.fits,measure.fits"). A catalogue named
 * STDOUT goes to `standard_out`. `facts` (NULL, or empty) gets what was found out, as far as the run came:
 * stage/tile_facts.h. Returns RX_GATE_FAIL or RX_GATE_INSUFFICIENT, outputs written, when a gate says so. */
struct rx_tile_facts;
rx_status rx_stage_run(const rx_config *config, const char *image, FILE *standard_out, rx_log *log,
                       struct rx_tile_facts *facts, rx_error *err);

#endif
