/* PSF_LIBRARY_TYPE WRITE: what a tile adds to the library of PSFs. */
#ifndef RX_STAGE_LIBRARY_H
#define RX_STAGE_LIBRARY_H

#include "io/output.h"
#include "pipeline/field.h"
#include "stage/options.h"

/* The PSF of the field as NAME_HDU-DIGEST.psf of PSF_LIBRARY, one of the outputs, if it is good enough for other tiles
 * (rx_psf_library_takes()); record: of the run. Without PSF_LIBRARY_TYPE WRITE nothing. */
rx_status rx_library_add(const rx_options *options, const rx_field *field, const rx_record *record,
                         rx_outputs *outputs, rx_log *log, rx_error *err);

#endif
