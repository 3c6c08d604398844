/* The noise of a tile: correlation, effective noise, gain. */
#ifndef RX_PIPELINE_FIELD_NOISE_H
#define RX_PIPELINE_FIELD_NOISE_H

#include "base/error.h"
#include "data/noise_correlation.h"
#include "pipeline/field.h"

/* As measured, whatever NOISE_CORRELATION states; used: [height][width], 0 = a source or masked, or NULL: found on the
 * pixels. Without the light of faint sources where the PSF is known. Errors: RX_SYSTEM. */
rx_status rx_field_noise_measure(const rx_field *field, const unsigned char *used, int nthreads,
                                 rx_noise_correlation *dst, rx_error *err);

/* While a field is prepared, in this order: field->noise as NOISE_CORRELATION says; without a gain that cannot be that of
 * the pixels; with its factor, for the PSF of the field or, where it has none, for what light looks like (NULL: not known),
 * and the map of effective noise; and what the log says of it. */
rx_status rx_field_noise_known(const rx_pipeline_params *params, rx_field *field, rx_error *err);
rx_status rx_field_gain_check(rx_field *field, rx_log *log, rx_error *err);
rx_status rx_field_noise_effective(const rx_pipeline_params *params, rx_field *field, const rx_psf *of_light,
                                   rx_log *log, rx_error *err);
void rx_field_noise_log(const rx_field *field, rx_log *log);

#endif
