/* Training images made by the simulator's library, in memory.
 *
 * A field of FIELD_SIDE pixels, and RX_SAMPLES_FRAME more around it, holds (side/P)^2 places for patches.
 * It is rendered once, sharp and blurred, with its own PSF (simulate/sky_field.h), FWHM uniform in the bin's range.
 * What a real tile comes with is fresh for every patch:
 *
 *   sigma  uniform in the bin's range; it sets the scale: the brightness of the field (nn/noise_level.h) is
 *          255/sigma noise units. No light at all: only noise.
 *   x      (v + sqrt(1 + q v) n + sky) / r: v the blurred light in true noise units, n normal, q photon
 *          noise, sky normal of rms sky_error, r noise as given over true, ln r normal; the other planes
 *          are divided by r too.
 *   w, K'  from the PSF as given, with an error of its FWHM, ln(given / true) normal. w is filtered on a
 *          window that holds RX_SAMPLES_FRAME pixels of the field's light around the patch: it is right to
 *          the patch's border, to about 1e-3 of the brightest pixels nearby.
 *
 * Errors are cut at 3 sigma. K' * y is the blurred plane to 2 % of the brightest pixel at FWHM 2, 0.5 % at
 * 2.5, 0.1 % from 3 on (what nn/deblur.h says of K').
 *
 * What surveys deliver comes on top, as simulate/survey_sky.h says.
 *
 * Which field and which of its places a sample comes from follows from its id alone: samples whose indices
 * share index / places come from one field, and the same index in successive epochs that share epoch / uses
 * from one field too, turned otherwise each time. In the first of these epochs patches are cut on a grid, in
 * the others anywhere. So a field serves places * uses images.
 *
 * Each rank makes its share of an epoch's images, and gets those that it trains on or tests. Ranks share the fields,
 * threads those of a rank. Every image of an epoch is there before its first step: their order mixes all fields. Which
 * ranks and threads there are decides nothing but where an image is made.
 *
 * The validation images are an epoch of their own that has test images alone: RX_EPOCH_VALIDATION. */
#ifndef RX_TRAIN_SAMPLES_H
#define RX_TRAIN_SAMPLES_H

#include "base/log.h"
#include "config/config_fields.h"
#include "nn/deblur.h"
#include "nn/front.h"
#include "nn/model.h"
#include "simulate/sky_field.h"
#include "simulate/survey_sky.h"
#include "train/sample.h"
#include "train/selection.h"

enum { RX_SAMPLES_FRAME = RX_TIKHONOV_REACH };

typedef struct rx_samples_params {
    int side;           /* P, a multiple of 4 */
    int field_side;     /* pixels, a multiple of P */
    int uses;           /* samples made from one rendered patch, each with other noise and turn, >= 1 */
    rx_sky_variety sky; /* of the fields */
    double photon[2];   /* q: photon noise per noise unit of flux, log-uniform (uniform when from 0) */
    double sky_error;   /* rms of a constant left in x, noise units */
    double noise_error; /* rms of ln(noise as given / true) */
    double psf_error;   /* rms of ln(FWHM as given / true) */
    rx_survey_params survey;
    uint64_t seed;
    rx_front front; /* target PSF, Tikhonov */
    int batch;      /* images of a step, shared out among ranks in runs: the first run is rank 0's */
} rx_samples_params;

typedef struct rx_samples rx_samples; /* keeps fields that later epochs need */

/* `config`: SIM. keywords for the population (its size, noise and PSF keywords have no effect here). It is not
 * kept. Errors: RX_USAGE a PSF that does not fit a patch and its frame; those of reading templates; RX_SYSTEM. */
rx_status rx_samples_new(const rx_samples_params *par, const rx_selection *grid,
                         const rx_simulate_config *config, int nthreads, rx_log *log, rx_samples **dst,
                         rx_error *err);
void rx_samples_free(rx_samples *samples); /* NULL is fine */

/* dst[n] become new samples of one epoch, ids[n]; after an error some of them are there. Threads share the fields:
 * those of one field stand one after the other (sorted by set, bin and index). Fields that serve another epoch are kept
 * up to RX_SAMPLES_MEMORY bytes, those of epochs that are over go.
 * Errors: RX_USAGE for a bin, an index or a set that is not there; RX_SYSTEM, RX_INTERRUPTED. */
#define RX_SAMPLES_MEMORY ((size_t)1 << 29)
rx_status rx_samples_make(rx_samples *samples, const rx_sample_id *ids, long n, rx_sample **dst,
                          rx_error *err);

/* Number of the field that a sample comes from: the same for all samples of one field, otherwise different with near
 * certainty. */
uint64_t rx_samples_field(const rx_samples_params *par, rx_sample_id id);

/* Make an epoch's images, on all ranks together: their counts (selection->train, test), and the order of the training
 * images, order[n]. Positions are those of the order, then from n the test images, bin by bin; training images before
 * `from` are not made. Images that were not taken before are dropped. Errors: those of rx_samples_make() on any rank. */
rx_status rx_samples_epoch(rx_samples *samples, uint32_t epoch, const rx_selection *selection,
                           const rx_pick *order, long n, long from, rx_error *err);
/* The image at a position, once; NULL where it is another rank's. Free with free(). */
rx_sample *rx_samples_take(rx_samples *samples, long at);
/* Images that this rank has made for epochs so far, and the seconds that it took. */
void rx_samples_made(const rx_samples *samples, long *images, double *seconds);

#endif
