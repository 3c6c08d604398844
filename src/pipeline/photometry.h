/* Measuring the sources of one restorer: on which pixels, with which errors, and how the fluxes on
 * restored pixels compare with the untouched ones. */
#ifndef RX_PIPELINE_PHOTOMETRY_H
#define RX_PIPELINE_PHOTOMETRY_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/restored.h"
#include "data/sources.h"
#include "measure/noise.h"
#include "pipeline/field.h"
#include "pipeline/fluxcheck.h"
#include "pipeline/params.h"

RX_BEGIN_DECLS

typedef struct rx_photometry {
    rx_noise_law law;   /* of the measured pixels; nradii 0: independent pixels were assumed */
    rx_fluxcheck check; /* n 0 on untouched pixels, or with too few sources */
} rx_photometry;

/* What is measured. */
typedef struct rx_photometry_input {
    const rx_field *detect; /* that the sources were found on; flag maps are its own */
    /* dual-image mode: its restored image, which radii come from; NULL: its untouched pixels */
    const rx_restored *detected;
    const rx_field *field;       /* that is measured; the same one without dual-image mode */
    const rx_restored *restored; /* its restored image; NULL: untouched pixels are measured */
    const rx_restored *none;     /* these as the restorer NONE left them; NULL: made here */
} rx_photometry_input;

/* Measures every source: fluxes, shapes and errors by params->measure, their noise by ERROR_CALIBRATION,
 * sources->law_ as well. `restored` NULL or MEASURE_ON ORIGINAL: on untouched pixels. Errors: RX_USAGE (.nnw file),
 * RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_photometry_run(const rx_pipeline_params *params, const rx_photometry_input *input,
                            rx_sources *sources, rx_log *log, rx_photometry *dst, rx_error *err);

RX_END_DECLS

#endif
