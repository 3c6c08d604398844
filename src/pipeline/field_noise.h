/* The noise of a tile once more, for checks. */
#ifndef RX_PIPELINE_FIELD_NOISE_H
#define RX_PIPELINE_FIELD_NOISE_H

#include "base/error.h"
#include "data/noise_correlation.h"
#include "pipeline/field.h"

/* As measured, whatever NOISE_CORRELATION states; used: [height][width], 0 = a source or masked, or NULL: found on the
 * pixels. Without the light of faint sources where the PSF is known. Errors: RX_SYSTEM. */
rx_status rx_field_noise_measure(const rx_field *field, const unsigned char *used, int nthreads,
                                 rx_noise_correlation *dst, rx_error *err);

#endif
