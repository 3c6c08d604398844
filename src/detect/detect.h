/* Detection through sep: filter, threshold, deblend, clean; SExtractor's numbers out. */
#ifndef RX_DETECT_DETECT_H
#define RX_DETECT_DETECT_H

#include <stdint.h>

#include "base/error.h"
#include "base/log.h"
#include "data/map.h"
#include "data/sources.h"
#include "data/tile.h"

typedef struct rx_detect_params {
    double threshold;          /* DETECT_THRESH: sigmas, or ADU when absolute */
    int absolute;              /* THRESH_TYPE ABSOLUTE */
    double analysis_threshold; /* ANALYSIS_THRESH: sigmas, or ADU when analysis_absolute */
    int analysis_absolute;
    int min_area, max_area; /* DETECT_MINAREA, DETECT_MAXAREA (0 = none) */
    const float *filter;    /* FILTER_NAME kernel as in the file, NULL = no filter */
    int filter_width, filter_height;
    int filter_normalise;    /* CONV NORM */
    int matched;             /* FILTER_TYPE MATCHED: sep's matched filter */
    int deblend_levels;      /* DEBLEND_NTHRESH */
    double deblend_contrast; /* DEBLEND_MINCONT */
    int clean;
    double clean_param;
    long pixstack, pixstack_max;    /* MEMORY_PIXSTACK, and how far it may grow */
    int subobjects, subobjects_max; /* deblending limit, and how far it may grow */
    int nthreads;
} rx_detect_params;

/* The image that detection works on. */
typedef struct rx_detect_image {
    int width, height;
    const float *pixels;   /* background subtracted */
    const float *filtered; /* pixels after the filter, finite and hidden ones 0; NULL: made here */
    const uint8_t *mask;   /* NULL: nothing hidden */
    int mask_bits;         /* which bits hide a pixel */
    int variable_noise;    /* 0: one threshold from global_sigma (no weight map), as SExtractor; 1: `noise` */
    double global_sigma;
    double gain;  /* e-/ADU for the position errors, 0 = infinite */
    rx_map noise; /* of a pixel: for thresholds with variable_noise, and for rx_source.detection_snr, which is
                     not wanted where none is given */
    float **done_with; /* where `filtered` lies in memory that is no longer wanted once the pixels above the
                          threshold are known: it is freed then, and set to NULL; NULL: it stays */
} rx_detect_image;

/* Source list: detection columns, segmentation map and fragments. No source: n = 0.
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
rx_status rx_detect_run(const rx_detect_params *par, const rx_detect_image *image, rx_log *log,
                        rx_sources **dst, rx_error *err);

#endif
