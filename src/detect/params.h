/* The parameters of background and detection. */
#ifndef RX_DETECT_PARAMS_H
#define RX_DETECT_PARAMS_H

#include "base/extern.h"

RX_BEGIN_DECLS

typedef struct rx_background_params {
    int mesh_width, mesh_height;     /* BACK_SIZE */
    int filter_width, filter_height; /* BACK_FILTERSIZE */
    double filter_threshold;         /* BACK_FILTTHRESH */
    int manual;                      /* BACK_TYPE MANUAL */
    double manual_value;             /* BACK_VALUE */
    int weight_gain;                 /* WEIGHT_GAIN */
    int no_rescale;                  /* RESCALE_WEIGHTS N: variances of MAP_VAR and MAP_WEIGHT are absolute */
    int passes;                      /* BACK_PASSES; 0 is 1 */
    int nthreads;
} rx_background_params;

/* How far limits of memory grow: pixels above the threshold, parts of one detection (and the first limit of these). */
enum { RX_DETECT_PIXSTACK_MAX = 100000000, RX_DETECT_PARTS = 1024, RX_DETECT_PARTS_MAX = 65536 };

typedef struct rx_detect_params {
    double threshold;          /* DETECT_THRESH: sigmas, or ADU when absolute */
    int absolute;              /* THRESH_TYPE ABSOLUTE */
    double analysis_threshold; /* ANALYSIS_THRESH: sigmas, or ADU when analysis_absolute */
    int analysis_absolute;
    int min_area, max_area; /* DETECT_MINAREA, DETECT_MAXAREA (0 = none) */
    const float *filter;    /* FILTER_NAME kernel as in the file, NULL = no filter */
    int filter_width, filter_height;
    int filter_normalise;    /* CONV NORM */
    int filter_auto;         /* FILTER_TYPE AUTO: DETECT_THRESH is `significance` */
    double significance;     /* sigmas of the PSF's matched filter */
    int deblend_levels;      /* DEBLEND_NTHRESH */
    double deblend_contrast; /* DEBLEND_MINCONT */
    int clean;
    double clean_param;
    long pixstack, pixstack_max;    /* MEMORY_PIXSTACK, and how far it may grow */
    int subobjects, subobjects_max; /* deblending limit, and how far it may grow */
    int nthreads;
} rx_detect_params;

RX_END_DECLS

#endif
