/* What is found out of a tile before it is restored: masks, sky, noise, gain and PSF, in that order. */
#ifndef RX_PIPELINE_PREPARE_H
#define RX_PIPELINE_PREPARE_H

#include "base/error.h"
#include "pipeline/field.h"

/* A field of a caller's image, with a mask of its own; nothing is measured. Errors: RX_USAGE (no pixels), RX_SYSTEM. */
rx_status rx_field_of_image(const rx_image *image, rx_field **dst, rx_error *err);

/* *noise: field->noise before the PSF's light was taken out of it, for another PSF. what: as for
 * rx_field_new(), and its errors. */
rx_status rx_field_begin(const rx_pipeline_params *params, int what, rx_field *field,
                         rx_noise_correlation *noise, rx_log *log, rx_error *err);

/* What the log says of the noise. */
void rx_field_end(rx_field *field, rx_log *log);

#endif
