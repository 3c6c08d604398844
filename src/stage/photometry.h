/* Measuring the sources of one restorer: on which pixels, with which errors, and how the fluxes on
 * restored pixels compare with the untouched ones. */
#ifndef RX_STAGE_PHOTOMETRY_H
#define RX_STAGE_PHOTOMETRY_H

#include "base/error.h"
#include "base/log.h"
#include "data/restored.h"
#include "data/sources.h"
#include "measure/noise.h"
#include "stage/field.h"
#include "stage/fluxcheck.h"
#include "stage/options.h"

typedef struct rx_photometry {
    rx_noise_law law;   /* of the measured pixels; apertures 0: independent pixels were assumed */
    rx_fluxcheck check; /* n 0 on untouched pixels, or with too few sources */
} rx_photometry;

/* In dual-image mode (field != detect) radii come from the detection image: `detected`, or its untouched
 * pixels when that is NULL. Measure `sources` on `restored` (an image of the tile of `field`), or on its
 * untouched pixels when restored is NULL; `none`: these as the restorer NONE left them, or NULL: made here.
 * Flag maps come from `detect`, the field the sources were found on (the same one without dual-image mode).
 */
rx_status rx_photometry_run(const rx_options *options, const rx_field *detect, const rx_restored *detected,
                            const rx_field *field, const rx_restored *restored, const rx_restored *none,
                            rx_sources *sources, rx_log *log, rx_photometry *dst, rx_error *err);

#endif
