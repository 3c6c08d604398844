/* BLANK_CHECK: what the stage finds where there is nothing but this tile's noise.
 *
 * Realisations of the tile's own noise (width per pixel, correlation between neighbours, measured on its
 * source-free pixels) on a flat sky of its level, under its own mask, go through the whole path with the
 * tile's PSF; whatever is detected is false. The photon noise of sources and what they leave in the sky or
 * after a restoration are not part of it, nor are pieces of bright sources. Except that without a weight
 * map the width per pixel is the tile's rms map, which large or crowded sources raise.
 *
 * The quick one is of a window of the tile, realised again where that is small; where too much is found there, thresholds are
 * raised. */
#ifndef RX_CHECK_BLANKCHECK_H
#define RX_CHECK_BLANKCHECK_H

#include "base/error.h"
#include "base/log.h"
#include "base/random.h"
#include "check/replica.h"
#include "data/noise_correlation.h"
#include "pipeline/field.h"
#include "pipeline/params.h"
#include "pipeline/pipeline.h"
#include "quality/statistics.h"

typedef struct rx_blankcheck {
    int realisations; /* 0: was not run */
    int quick;        /* of a window of the tile */
    int correlated;   /* is the noise? */
    double raised; /* what DETECT_THRESH was multiplied by, 1: as it was asked for; the rate is that there */
    double asked;  /* quick: false detections per Mpixel at the threshold that was asked for */
    long false_detections;
    double mpixels;   /* searched, masked pixels left out */
    rx_estimate rate; /* false detections per Mpixel, exact Poisson interval at 95 % */
    double upper;     /* one-sided 95 % upper limit per Mpixel */
    double sky;       /* Mpixel of the tile itself, neither masked nor of a source */
    /* Of the tile's own detections the share that is no noise peak: 1 - rate * sky / n; noise alone: pieces and
     * ghosts of real sources count as real. n: detections, 0 = none */
    rx_estimate real;
    double *fitted; /* [nfitted] evidence of what was fitted to noise, where the tile itself was; owned */
    int nfitted;
} rx_blankcheck;

/* The noise of the untouched tile where `segments` has no source within two FWHM (or nearer, when that leaves
 * too few pixels), whatever NOISE_CORRELATION states. Errors: RX_INPUT when there is too little free sky, RX_SYSTEM. */
rx_status rx_blankcheck_noise(const rx_field *field, const int32_t *segments, int nthreads,
                              rx_noise_correlation *dst, rx_error *err);

/* Have templates found that most of the tile is a crowd? */
int rx_blankcheck_is_crowd(const rx_result *tile);

/* What is drawn, and the restorer that looks at it. */
typedef struct rx_blank_input {
    const rx_restorer *kind;
    const rx_field *field;
    const rx_noise_correlation *noise;
    const float *light; /* [height][width] ADU above the sky, with its photons; NULL: none */
    int realisations;
    const rx_result *tile; /* what it made of the tile itself, or NULL */
} rx_blank_input;

/* The tile of in->field, or a part of it, with nothing on a flat sky but in->light and a realisation of its noise, the one numbered
 * `stream` of `seed`, made ready with the field's PSF. Free with rx_field_free(). Errors: RX_SYSTEM. */
rx_status rx_blankcheck_field(const rx_pipeline_params *params, const rx_blank_input *in,
                              const rx_replica_part *part, rx_random_stream from, rx_field **dst,
                              rx_error *err);

/* The realisations through one restorer, the same ones for every restorer. Where templates were fitted to the tile,
 * they are fitted here, as in a crowd where most of the tile is one; with PRECISION_TARGET these are counted by
 * rx_blankcheck_finish(). Errors: RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_blankcheck_run(const rx_pipeline_params *params, const rx_blank_input *in, rx_log *log,
                            rx_blankcheck *dst, rx_error *err);

/* Before the network looks at the tile of `field`: one realisation of its noise, as measured, in a window of 512 x
 * 512 pixels, the one with most usable pixels, or of 1024 x 1024 where that has three false detections. A tile of no more
 * than the former, as the latter where the tile ends within, is realised up to 16 times, until a Mpixel was searched or
 * the interval of the rate has `most` no longer within. Where its false detections, at least three, are more than `most` per Mpixel (0: no limit), params->detect.threshold is raised,
 * by steps of a twentieth up to tenfold, until no more are found on the same window. dst->realisations stays 0 where the
 * noise is not known, or another restorer does the work. Errors: RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_blankcheck_guard(rx_pipeline_params *params, const rx_restorer *kind, const rx_field *field,
                              double most, rx_blankcheck *dst, rx_error *err);

/* Of `tile`, that restorer on the untouched tile: check->sky and ->real from the rate; with PRECISION_TARGET the false
 * detections are those that it would have kept. */
void rx_blankcheck_finish(const rx_pipeline_params *params, const rx_result *tile, rx_blankcheck *check);
void rx_blankcheck_free(rx_blankcheck *check); /* content only */

#endif
