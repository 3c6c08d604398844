/* The restoration campaign: scenes of galaxies, blurred and noisy, through every method, and how near each
 * comes to the sharp scene. The paper's box plots and Tables 1 to 4.
 *
 * A bin is 1 wide in FWHM (pixels) or in sigma of the noise, on the paper's scale, on which the brightest pixel of the
 * sharp scene is SCENE_PEAK; the other quantity is uniform over its training range. Of every scene the noise level of
 * nn/noise_level.h is kept too, which is the scale of the network's training: it is of the blurred scene, and some three
 * times sigma. Scene i of a bin is the same for every SIZE, and for every method. */
#ifndef RX_LAB_RESTORATION_H
#define RX_LAB_RESTORATION_H

#include <stdint.h>

#include "config/campaign_config.h"
#include "lab/kind.h"
#include "lab/results.h"
#include "quality/image_metrics.h"
#include "restore/restore.h"
#include "stage/options.h"
#include "stage/simulation.h"

/* One column of the tables: a restorer, tuned or as the STAGE. keywords have it. */
typedef struct rx_method {
    char name[RX_METHOD_NAME];
    const rx_restorer *restorer;
    int tuned;  /* iterations and filter chosen per bin */
    int flat;   /* tuned, and what is below a threshold, tuned too, is set to the sky */
    int smooth; /* tuned, without any iteration: the filter alone, no deconvolution */
} rx_method;

typedef struct rx_restoration_range {
    int by_sigma;
    double low, high, other_low, other_high;
    long nscenes;
} rx_restoration_range;

/* A unit is one scene of a bin: in the test, or of those that methods are tuned on. */
typedef struct rx_restoration_unit {
    int bin, tune;
    long index;
} rx_restoration_unit;

typedef struct rx_restoration {
    const rx_campaign_config *config; /* not owned */
    rx_config *stage;                 /* owned */
    rx_options *options;              /* of the stage; everything on one thread */
    rx_simulation *simulation;        /* population, templates and target PSF */
    int side;
    int nmethods, ntuned; /* ntuned: restorers that are tuned */
    rx_method method[RX_METHODS_MAX];
    int nbins;
    rx_restoration_range *bins;
    long nunits;
    rx_restoration_unit *units;
} rx_restoration;

/* One scene: planes [side][side], 0 = sky. */
typedef struct rx_trial {
    double fwhm, sigma;
    double level;                  /* noise level: nn/noise_level.h */
    float *image;                  /* blurred and noisy */
    float *sharp;                  /* the scene through the target PSF, its brightest pixel SCENE_PEAK */
    rx_psf *psf;                   /* that blurred it */
    rx_image_reference *reference; /* of `sharp`, for PSNR and SSIM */
} rx_trial;

rx_status rx_trial_make(const rx_restoration *state, const rx_restoration_unit *unit, rx_trial *dst,
                        rx_error *err);
void rx_trial_free(rx_trial *trial); /* content only */

/* dst [side][side] = the scene restored. niter > 0: so many iterations and no filter; 0: as STAGE. has it. */
rx_status rx_trial_restore(const rx_restoration *state, const rx_trial *trial, const rx_restorer *restorer,
                           int niter, float *dst, rx_error *err);

/* --- tuning --- */

/* One candidate: filter in pixels and its threshold in sigmas of the noise, negative = none. */
typedef struct rx_tuning {
    int niter;        /* 0: the blurred image as it is */
    double filter;    /* FWHM of the Gaussian, pixels; 0 = none */
    double threshold; /* in sigmas of the input's noise: what is below becomes sky; negative = none */
    char text[120];   /* for the report: filters in units of the PSF's FWHM */
} rx_tuning;

/* Candidates per restorer: (0 and TUNE_NITER) x (TUNE_FILTER and the target PSF) x thresholds. Those of 0
 * iterations are for the method `smooth`, without thresholds; the others have the rest. */
long rx_tuning_count(const rx_restoration *state);
void rx_tuning_get(const rx_restoration *state, double fwhm, long candidate, rx_tuning *dst);

/* The method's candidate of the highest mean over the tuning scenes of a bin; metric 0: PSNR, 1: SSIM. done:
 * values of all units. */
long rx_tuning_choose(const rx_restoration *state, int bin, const rx_method *method, int metric,
                      const rx_unit_values *done);

/* Is the candidate's number of iterations the lowest (above 1) or highest tried, or its filter the widest
 * or its threshold the highest: a longer list may hold a better one. */
int rx_tuning_at_end(const rx_restoration *state, long candidate);

/* plane = filtered and cut as the candidate says, from what so many iterations gave. */
rx_status rx_tuning_apply(const rx_restoration *state, const rx_trial *trial, const rx_tuning *tuning,
                          const float *restored, float *plane, rx_error *err);

/* --- the two kinds of unit --- */

/* 2 values, PSNR and SSIM, for every candidate of every tuned restorer, on one tuning scene. */
rx_status rx_restoration_tune(const rx_restoration *state, const rx_trial *trial, rx_unit_values *dst,
                              rx_error *err);
/* FWHM, sigma, noise level, then PSNR and SSIM of every method, on one test scene. */
rx_status rx_restoration_score(const rx_restoration *state, int bin, const rx_trial *trial,
                               const rx_unit_values *done, rx_unit_values *dst, rx_error *err);

/* A method's picture of a scene with the settings tuned for a metric. */
rx_status rx_restoration_picture(const rx_restoration *state, int bin, const rx_trial *trial,
                                 const rx_method *method, int metric, const rx_unit_values *done,
                                 float *plane, rx_error *err);

/* From the values of all units. */
rx_status rx_restoration_collect(const rx_restoration *state, const rx_unit_values *all,
                                 rx_restoration_results **dst, rx_error *err);

#endif
