/* Where the PSF of a tile comes from: stars, or what is stated. */
#ifndef RX_PIPELINE_PSF_SOURCE_H
#define RX_PIPELINE_PSF_SOURCE_H

#include "base/error.h"
#include "pipeline/field.h"

/* field->psf, as params say, on its sky and noise; where stars give none and nothing is stated it stays NULL, and the field
 * is `unrestorable`. role: 1 for the keywords of the measurement image. Errors: RX_INPUT, RX_SYSTEM. */
rx_status rx_field_psf(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
                       rx_error *err);

/* The PSF of a tile that needs none, where noise seems to be correlated farther than resampling leaves it, as the light of
 * faint sources is; *dst NULL where it is not, or is not known. Errors: RX_SYSTEM. */
rx_status rx_field_psf_of_light(const rx_pipeline_params *params, int role, const rx_field *field,
                                rx_psf **dst, rx_error *err);

#endif
