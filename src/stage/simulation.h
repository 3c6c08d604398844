/* The simulator's job with files: simulated fields, or, with INJECT_IMAGE, scenes on top of a real tile with the
 * tile's own PSF, gain and noise. */
#ifndef RX_STAGE_SIMULATION_H
#define RX_STAGE_SIMULATION_H

#include "pipeline/field.h"
#include "simulate/simulation.h"
#include "stage/options.h"

/* Injection. The configuration for one real tile: its size, zero point (MAG_ZEROPOINT where that was set by
 * hand, else what the tile's header or configuration states, else the default), pixel scale, gain (GAIN where
 * the tile has none; 0: the added light brings no photon noise), saturation, and the places allowed by
 * INJECT_PLACE. The PSF is PSF_TYPE's; AUTO takes field->psf, which must have been measured on the tile.
 * `options` is the stage's for this field (AWAY runs its detection on the untouched pixels). */
rx_status rx_simulation_for_tile(const rx_simulate_config *config, const rx_options *options,
                                 const rx_field *field, rx_log *log, rx_simulation **dst, rx_error *err);

/* Everything the configuration asks for, written to files: the job of rextract-simulate. Nothing is left after an
 * error: RX_USAGE, RX_INPUT, RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_simulation_run(const rx_simulate_config *config, rx_log *log, rx_error *err);

#endif
