/* Detection through sep: filter, threshold, deblend, clean; SExtractor's numbers out. */
#ifndef RX_DETECT_DETECT_H
#define RX_DETECT_DETECT_H

#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/image.h"
#include "data/sources.h"
#include "detect/params.h"

RX_BEGIN_DECLS

/* The pixels after the filter, where the caller has them: finite, hidden ones 0. *spare, where they lie in memory
 * that is no longer wanted once the pixels above the threshold are known, is freed then, and set to NULL; spare
 * NULL: they stay. */
typedef struct rx_filtered {
    const float *pixels;
    float **spare;
} rx_filtered;

/* Source list of an image above its sky: detection columns, segmentation map and fragments. No source: n = 0.
 * filtered NULL: filtered here. detection_snr is made where image->noise is given.
 *
 * variable_noise: the threshold is threshold * sqrt(filtered variance), as in SExtractor; masked
 * pixels stay out of that filter. Numbers follow the order in which a scan completes the groups of pixels
 * above the threshold; the same for any nthreads.
 * When sep runs out of room its limits grow; beyond *_max detection goes on with coarser deblending
 * or a higher threshold, with a warning and RX_FLAG_DEBLEND_OVER or RX_FLAG_EXTRACT_OVER on every
 * source. `sources->grown` counts. detection_snr: the highest value of the filtered image within the source
 * over its noise there times rx_filter_norm(), the order of certainty for P-R curves. Callers in several
 * OpenMP threads wait for each other while sep works (its limits are process-wide). Errors: RX_USAGE,
 * RX_SYSTEM. */
rx_status rx_detect_run(const rx_detect_params *par, const rx_image *image, const rx_filtered *filtered,
                        rx_log *log, rx_sources **dst, rx_error *err);

RX_END_DECLS

#endif
