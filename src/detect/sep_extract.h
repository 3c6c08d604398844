/* sep_extract() with limits that grow by themselves; keeps sep's types out of detect.c's way.
 *
 * sep's two limits are process-wide; they are set and put back here, so extractions that several OpenMP
 * threads ask for wait for each other. */
#ifndef RX_DETECT_SEP_EXTRACT_H
#define RX_DETECT_SEP_EXTRACT_H

#include "base/error.h"
#include "base/log.h"
#include "detect/detect.h"
#include "detect/filter.h"
#include "detect/groups.h"
#include "detect/libsep.h"

/* What goes into sep, and how the run ended. */
typedef struct rx_extraction {
    int width, height;
    const float *pixels;   /* masked ones 0 */
    const uint8_t *hidden; /* 1 = masked */
    const float *noise;    /* threshold noise of a pixel or NULL: noise_value everywhere */
    double noise_value;
    double gain;
    const rx_filter *kernel;
    double threshold;        /* sigmas, or ADU when absolute, on the normalised kernel's scale */
    const rx_groups *groups; /* of the pixels above the threshold */
    long above;              /* how many these are: bounds the pixel stack */
    int grown;               /* out: times a limit was raised */
    int flags;               /* out: RX_FLAG_ bits for every source when a limit could not be met */
    double raised;           /* out: factor by which the threshold had to be raised (1) */
} rx_extraction;

/* Runs sep until it succeeds; gives up only without memory. Free with sep_catalog_free(). */
rx_status rx_extract_run(const rx_detect_params *par, rx_extraction *job, rx_log *log, sep_catalog **dst,
                         rx_error *err);

#endif
