/* Deblending and isophotal numbers through sep, with limits that grow by themselves; keeps sep's types out of
 * detect.c's way.
 *
 * sep's two limits are process-wide; they are set and put back here, so extractions that several OpenMP
 * threads ask for wait for each other. */
#ifndef RX_DETECT_SEP_EXTRACT_H
#define RX_DETECT_SEP_EXTRACT_H

#include "base/error.h"
#include "base/log.h"
#include "detect/detections.h"
#include "detect/filter.h"
#include "detect/groups.h"
#include "detect/params.h"

/* What goes in, and how the run ended. */
typedef struct rx_extraction {
    rx_threshold image;
    const float *pixels; /* before the filter, masked ones 0 */
    double noise_value;  /* where noise does not vary */
    double gain;
    const rx_filter *kernel;
    const rx_groups *groups; /* of the pixels above the threshold */
    double threshold;        /* of which the groups are: sigmas, or ADU when absolute */
    int grown;               /* out: times a limit was raised */
    int flags;               /* out: RX_FLAG_ bits for every source when a limit could not be met */
} rx_extraction;

/* Groups that cannot split and those that may are packed into small images by fixed rules, and sep works
 * on these in `par->nthreads` threads; its random numbers, by which it shares out the pixels between the
 * parts of a blend, begin anew with each of them. Gives up only without memory. Free with
 * rx_detections_free(). */
rx_status rx_extract_run(const rx_detect_params *par, rx_extraction *job, rx_log *log, rx_detections *dst,
                         rx_error *err);

/* Version of the library (sep). */
const char *rx_sep_library(void);

#endif
