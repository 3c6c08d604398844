/* BLANK_CHECK: what the stage finds where there is nothing but this tile's noise.
 *
 * Realisations of the tile's own noise (width per pixel, correlation between neighbours, measured on its
 * source-free pixels) on a flat sky of its level, under its own mask, go through the whole path with the
 * tile's PSF; whatever is detected is false. The photon noise of sources and what they leave in the sky or
 * after a restoration are not part of it, nor are pieces of bright sources. Except that without a weight
 * map the width per pixel is the tile's rms map, which large or crowded sources raise. */
#ifndef RX_STAGE_BLANKCHECK_H
#define RX_STAGE_BLANKCHECK_H

#include "base/error.h"
#include "base/log.h"
#include "simulate/sky_noise.h"
#include "stage/field.h"
#include "stage/options.h"
#include "stage/probe.h"
#include "validate/binomial.h"

typedef struct rx_blankcheck {
    int realisations;
    long false_detections;
    double mpixels;   /* searched, masked pixels left out */
    rx_estimate rate; /* false detections per Mpixel, exact Poisson interval at 95 % */
    double upper;     /* one-sided 95 % upper limit per Mpixel */
    double sky;       /* Mpixel of the tile itself, neither masked nor of a source */
    /* Of the tile's own detections the share that is no noise peak: 1 - rate * sky / n; noise alone: pieces and
     * ghosts of real sources count as real. n: detections, 0 = none */
    rx_estimate real;
} rx_blankcheck;

/* The noise of the untouched tile where `segments` has no source within two FWHM (or nearer, when that leaves
 * too few pixels). Errors: RX_INPUT when there is too little free sky, RX_SYSTEM. */
rx_status rx_blankcheck_noise(const rx_field *field, const int32_t *segments, rx_sky_noise *dst,
                              rx_error *err);

/* The tile of `field` with nothing on a flat sky but a realisation of its noise, the one numbered `stream` of
 * `seed`, made ready with the field's PSF. Free with rx_field_free(). Errors: RX_SYSTEM. */
rx_status rx_blankcheck_field(const rx_options *options, const rx_field *field, const rx_sky_noise *noise,
                              uint64_t seed, uint64_t stream, rx_field **dst, rx_error *err);

/* options->blank_check realisations through one restorer, the same ones for every restorer. Errors:
 * RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_blankcheck_run(const rx_options *options, const rx_restorer *kind, const rx_field *field,
                            const rx_sky_noise *noise, rx_log *log, rx_blankcheck *dst, rx_error *err);

/* check->sky and ->real from its rate and `tile`, that restorer on the untouched tile. */
void rx_blankcheck_judge(const rx_options *options, const rx_probe *tile, rx_blankcheck *check);

#endif
