/* The parameters of the pipeline: one plain struct per stage, and what is decided between them. */
#ifndef RX_PIPELINE_PARAMS_H
#define RX_PIPELINE_PARAMS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"
#include "data/noise_correlation.h"
#include "detect/background.h"
#include "detect/detect.h"
#include "measure/measure.h"
#include "psf/psf.h"
#include "restore/restore.h"
#include "template/template.h"

RX_BEGIN_DECLS

/* What thresholds on restored pixels are sigmas of. AUTO: INPUT where the restorer brings such a map. */
typedef enum rx_detect_noise {
    RX_DETECT_NOISE_AUTO,
    RX_DETECT_NOISE_MEASURED,
    RX_DETECT_NOISE_INPUT
} rx_detect_noise;

/* THRESH_TYPE: 0, sigmas of a pixel; else one of these bits. Of restored images sigmas are those of DETECT_NOISE. */
enum { RX_THRESH_ABSOLUTE = 1, RX_THRESH_SIGNIFICANCE = 2 };

/* NOISE_CORRELATION: measured, white, or given as the kernel under which white noise became the image's. */
typedef struct rx_correlation_params {
    rx_noise_origin origin;
    const float *kernel; /* [height][width]; not owned */
    int kernel_width, kernel_height;
} rx_correlation_params;

/* What MASK_SATURATED and ERROR_CALIBRATION are done for: images of restorer NONE, those of the others. */
enum { RX_OF_NONE = 1, RX_OF_RESTORED = 2 };

/* What TEMPLATE_TYPE admits besides points: profiles, restored pixels. */
enum { RX_TEMPLATE_EXTENDED = 1, RX_TEMPLATE_PIXELS = 2 };

/* Listed positions (POSITIONS_NAME). */
typedef struct rx_positions {
    int n;
    double (*at)[2]; /* [n] x, y in pixels from 0; NAN or beyond the image: nothing is fitted */
} rx_positions;

/* Template photometry: what is fitted, and what is done with sources that are not significant. */
typedef struct rx_template_params {
    int wanted;
    rx_tphot_params par;           /* keep_model, covariance: of the image that is measured */
    double precision;              /* PRECISION_TARGET; 0: the list is as it is */
    const rx_positions *positions; /* where fluxes are fitted whatever is there; NULL: nowhere */
} rx_template_params;

typedef struct rx_pipeline_params {
    const rx_restorer *restorer;          /* of rx_pipeline_run(); NULL: Richardson-Lucy */
    rx_background_params background[2];   /* of the detection and of the measurement image */
    rx_psf_params psf;                    /* its file: psf_files */
    const char *psf_files[2];             /* PSF_NAME of the same two */
    const struct rx_psf_hints *psf_hints; /* besides pixels and `psf` (pipeline/psf_source.h); NULL: none */
    double seeing_arcsec;                 /* SEEING_FWHM */
    bool seeing_stated;                   /* the default is no statement about a tile */
    /* PIXEL_SCALE, arcsec; 0 when it was not set: SExtractor's default of 1 is no fact */
    double stated_scale;
    rx_restore_params restore;
    rx_detect_params detect;
    int significance;             /* THRESH_TYPE SIGNIFICANCE: of untouched images */
    rx_detect_noise detect_noise; /* DETECT_NOISE, of restored images */
    rx_correlation_params noise;
    int examine_residual; /* of what a network restored: rx_result.residual */
    int keep_filtered;    /* the filtered image is wanted after detection: CHECKIMAGE_TYPE FILTERED */
    rx_template_params templates;
    rx_measure_params measure;
    int saturated_in_none; /* MASK_SATURATED Y: RESTORE_TYPE NONE masks saturated pixels too */
    int measure_original;  /* MEASURE_ON ORIGINAL */
    int calibrate_none, calibrate_restored; /* ERROR_CALIBRATION */
    uint64_t seed;
    int flag_types[RX_MAX_FLAGMAPS]; /* FLAG_TYPE */
    int nthreads;
} rx_pipeline_params;

RX_END_DECLS

#endif
