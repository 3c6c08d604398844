/* Training images made by the simulator's library, in memory.
 *
 * A field of FIELD_SIDE pixels holds (side/P)^2 patches. Fields of a series alternate between star fields,
 * galaxy fields, mixed ones and ones with smooth nebulae; counts are those of the SIM. keywords times a
 * random factor. One field is rendered once (sharp and blurred), noise, turns and the errors that a real tile
 * comes with are fresh for every patch group: sigma of the bin -> scale such that the brightest 0.1 % of the
 * blurred noise-free pixels begin at 255/sigma noise units (nn/model.h rx_model_noise()); photon noise of
 * sources, var = 1 + q v, with random q; small errors of sky level, noise and PSF width as told (keys). Which
 * field and which of its patches a sample is follows from its id alone. */
#ifndef RX_TRAIN_SCENES_H
#define RX_TRAIN_SCENES_H

#include "base/log.h"
#include "config/simulate_config.h"
#include "nn/front.h"
#include "train/sample.h"
#include "train/selection.h"

typedef struct rx_scenes_params {
    int side;           /* P, a multiple of 4 */
    int field_side;     /* pixels, a multiple of P */
    int uses;           /* samples made from one rendered patch, each with other noise and turn, >= 1 */
    double beta[2];     /* Moffat exponent, uniform; the paper's 4.765 = both ends */
    double ellipticity; /* of the PSF, uniform 0 .. this */
    double density;     /* counts are multiplied by density^u, u uniform in -1 .. 1; 1 = as given */
    double nebulae;     /* share of fields with smooth nebulae on top */
    double photon[2];   /* q: photon noise per noise unit of flux, log-uniform */
    double sky_error;   /* rms of a constant left in x, noise units */
    double noise_error; /* rms of ln(noise as told / true) */
    double psf_error;   /* rms of ln(FWHM as told / true) */
    uint64_t seed;
    rx_front front; /* target PSF, Tikhonov */
    int set;        /* rx_sample_set: test scenes come from other random streams than training ones */
} rx_scenes_params;

typedef struct rx_scenes rx_scenes; /* one per generator thread; keeps the last field it made */

/* `config`: SIM. keywords for the population (its size, noise and PSF keywords have no effect here). */
rx_status rx_scenes_new(const rx_scenes_params *par, const rx_selection *grid,
                        const rx_simulate_config *config, rx_log *log, rx_scenes **dst, rx_error *err);
void rx_scenes_free(rx_scenes *scenes);

/* Make one sample. Samples of one bin in order of index are cheapest (they share fields). */
rx_status rx_scenes_make(rx_scenes *scenes, rx_sample_id id, rx_sample *dst, rx_error *err);

#endif
