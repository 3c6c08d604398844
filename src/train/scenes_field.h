/* A rendered field that training scenes are cut from. */
#ifndef RX_TRAIN_SCENES_FIELD_H
#define RX_TRAIN_SCENES_FIELD_H

#include "psf/psf.h"
#include "simulate/simulation.h"
#include "train/scenes.h"

/* One rendered field. Coordinates are those of the whole, frame included. */
typedef struct rx_scenes_field_data {
    uint64_t number; /* rx_scenes_field(); 0: none */
    long used;       /* when last */
    uint32_t era;    /* the epochs that it serves: epoch / uses */
    int side;        /* FIELD_SIDE + 2 frame */
    double fwhm, beta, ratio, angle;
    double halo, halo_fwhm, halo_beta; /* share of the light in a second, round Moffat; 0: none */
    double peak;                       /* highest pixel of the PSF centred on it */
    double norm;                       /* sqrt of the sum of the squared PSF */
    double level; /* brightness (nn/noise_level.h) in units of flux: 255/sigma of the noise; 0: no light */
    float *sharp, *blurred; /* [side][side], not negative */
    long nstars;
    double (*stars)[3]; /* x, y, flux; brightest first */
} rx_scenes_field_data;

/* A set of random numbers of its own. A field's: the training's seed ^ RX_SCENES_FIELD_SEED,
 * rx_scenes_field(). */
#define RX_SCENES_FIELD_SEED 0x6669656c64000000u
typedef struct rx_scenes_key {
    uint64_t seed, stream;
} rx_scenes_key;

/* What fields are made from: base counts are per pixel, lengths of pairs in FWHM. */
typedef struct rx_scenes_sky {
    const rx_scenes_params *par;
    const rx_simulation *simulation;
    double fwhm[2]; /* of the bin */
    int side;       /* of the whole field */
} rx_scenes_sky;

/* Content of *dst is freed by rx_scenes_field_clear(). */
rx_status rx_scenes_field_make(const rx_scenes_sky *sky, rx_scenes_key key, rx_scenes_field_data *dst,
                               rx_error *err);
void rx_scenes_field_clear(rx_scenes_field_data *field);

/* The PSF of these numbers of a field (only its fwhm .. halo_beta are read) as a stamp of sum 1. */
rx_status rx_scenes_psf(const rx_scenes_field_data *field, rx_psf **dst, rx_error *err);
/* Largest halo that fields have: share, and FWHM in pixels; smallest beta. */
#define RX_SCENES_HALO 0.15
#define RX_SCENES_HALO_FWHM 16.0
#define RX_SCENES_HALO_BETA 3.0

/* Uniform in from .. to, and log-uniform (uniform when `from` is not above 0): number `slot` of the key. */
double rx_scenes_uniform(rx_scenes_key key, uint64_t slot, double from, double to);
double rx_scenes_log_uniform(rx_scenes_key key, uint64_t slot, double from, double to);

#endif
