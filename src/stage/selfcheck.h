/* SELF_CHECK: what the stage finds of objects injected into a copy of this very tile, with no outside
 * catalogue. BLANK_CHECK: what it finds where there is nothing but this tile's noise. */
#ifndef RX_STAGE_SELFCHECK_H
#define RX_STAGE_SELFCHECK_H

#include "base/error.h"
#include "base/log.h"
#include "stage/field.h"
#include "stage/options.h"
#include "stage/probe.h"
#include "stage/record.h"
#include "validate/qa.h"

/* Completeness, purity and bias of one restorer on this tile. */
typedef struct rx_selfcheck {
    long injected, found;
    rx_estimate mag90, mag50; /* magnitude of 90 and 50 % completeness */
    rx_estimate purity;       /* of detections that are new after the injection: share that was injected */
    rx_estimate bias,
        scatter; /* median and sigma_MAD of measured - true magnitude (QA_MAG), unflagged ones */
    rx_estimate aperture_bias; /* the same in a wide aperture, corrected for what the PSF has outside: 0 when
                                  the flux scale is right */
} rx_selfcheck;

typedef struct rx_blankcheck {
    int realisations;
    long false_detections;
    double mpixels;   /* searched, masked pixels left out */
    rx_estimate rate; /* false detections per Mpixel, exact Poisson interval at 95 % */
    double upper;     /* one-sided 95 % upper limit per Mpixel */
} rx_blankcheck;

#endif
