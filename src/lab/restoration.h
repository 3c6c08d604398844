/* The restoration campaign: scenes of galaxies, blurred and noisy, through every method, and how near each
 * comes to the sharp scene. The paper's box plots and Tables 1 to 4.
 *
 * A bin is 1 wide in FWHM (pixels) or in sigma of the noise, on the paper's scale, on which the brightest pixel of the
 * sharp scene is SCENE_PEAK; the other quantity is uniform over its training range. Of every scene the noise level of
 * nn/noise_level.h is kept too, which is the scale of the network's training: it is of the blurred scene, and some three
 * times sigma. Scene i of a bin is the same for every SIZE, and for every method. */
#ifndef RX_LAB_RESTORATION_H
#define RX_LAB_RESTORATION_H

#include "lab/lab.h"
#include "quality/image_metrics.h"

enum { RX_RESTORATION_SCENE, RX_RESTORATION_TUNING, RX_RESTORATION_TABLES };

/* A scene of the test. */
#define RX_RESTORATION_SCENE_COLUMNS(X)                                                                      \
    X(RX_SCENE_FWHM, "fwhm", "pixel", "of the PSF, as drawn")                                                \
    X(RX_SCENE_SIGMA, "sigma", "", "of the noise, as drawn")                                                 \
    X(RX_SCENE_LEVEL, "level", "", "noise level on the scale of models")
#define RX_RESTORATION_SCORE_COLUMNS(X)                                                                      \
    X(RX_SCORE_PSNR, "psnr", "dB", "with the settings for PSNR")                                             \
    X(RX_SCORE_SSIM, "ssim", "", "with the settings for SSIM")

/* A candidate, in the order of rx_tuning_get(). */
#define RX_RESTORATION_TUNING_COLUMNS(X)                                                                     \
    X(RX_TUNING_NITER, "niter", "", "iterations of RL; 0: none")                                             \
    X(RX_TUNING_FILTER, "filter", "pixel", "FWHM of the Gaussian")                                           \
    X(RX_TUNING_THRESHOLD, "threshold", "", "in sigmas of the noise: what is below is sky; negative: none")  \
    X(RX_TUNING_PSNR, "psnr", "dB", "on one scene")                                                          \
    X(RX_TUNING_SSIM, "ssim", "", "on one scene")

enum { RX_RESTORATION_SCENE_COLUMNS(RX_LAB_ID) RX_RESTORATION_SCENE_WIDTH };
enum { RX_RESTORATION_SCORE_COLUMNS(RX_LAB_ID) RX_RESTORATION_SCORE_WIDTH };
enum { RX_RESTORATION_TUNING_COLUMNS(RX_LAB_ID) RX_RESTORATION_TUNING_WIDTH };

extern const rx_lab_schema rx_restoration_tables[RX_RESTORATION_TABLES];

/* One scene: planes [side][side], 0 = sky. */
typedef struct rx_trial {
    double fwhm, sigma;
    double level;                  /* noise level: nn/noise_level.h */
    float *image;                  /* blurred and noisy */
    float *sharp;                  /* the scene through the target PSF, its brightest pixel SCENE_PEAK */
    rx_psf *psf;                   /* that blurred it */
    rx_image_reference *reference; /* of `sharp`, for PSNR and SSIM */
} rx_trial;

rx_status rx_trial_make(const rx_lab *lab, const rx_lab_unit *unit, rx_trial *dst, rx_error *err);
void rx_trial_free(rx_trial *trial); /* content only */

/* dst [side][side] = the scene restored. niter > 0: so many iterations and no filter; 0: as STAGE. has it. */
rx_status rx_trial_restore(const rx_lab *lab, const rx_trial *trial, const rx_restorer *restorer, int niter,
                           float *dst, rx_error *err);

/* --- tuning --- */

/* One candidate: filter in pixels and its threshold in sigmas of the noise, negative = none. */
typedef struct rx_tuning {
    int niter;        /* 0: the blurred image as it is */
    double filter;    /* FWHM of the Gaussian, pixels; 0 = none */
    double threshold; /* in sigmas of the input's noise: what is below becomes sky; negative = none */
    char text[120];   /* for the report: filters in units of the PSF's FWHM */
} rx_tuning;

/* Candidates: (0 and TUNE_NITER) x (TUNE_FILTER and the target PSF) x thresholds. Those of 0 iterations are for the
 * method `smooth`, without thresholds; the others have the rest. The last ones, thresholds alone, are those of NET_FLAT. */
long rx_tuning_count(const rx_lab *lab);
void rx_tuning_get(const rx_lab *lab, double fwhm, long candidate, rx_tuning *dst);

/* The method's candidate of the highest mean over the tuning scenes of a bin; metric 0: PSNR, 1: SSIM. done:
 * values of all units. */
long rx_tuning_choose(const rx_lab *lab, int bin, const rx_lab_run *method, int metric,
                      const rx_unit_values *done);

/* Is the candidate's number of iterations the lowest (above 1) or highest tried, or its filter the widest
 * or its threshold the highest: a longer list may hold a better one. */
int rx_tuning_at_end(const rx_lab *lab, long candidate);

/* plane = filtered and cut as the candidate says, from what so many iterations gave. */
rx_status rx_tuning_apply(const rx_lab *lab, const rx_trial *trial, const rx_tuning *tuning,
                          const float *restored, float *plane, rx_error *err);

/* --- the two kinds of unit --- */

rx_status rx_restoration_tune(const rx_lab *lab, const rx_trial *trial, rx_lab_table *dst, rx_error *err);
rx_status rx_restoration_score(const rx_lab *lab, int bin, const rx_trial *trial, const rx_unit_values *done,
                               rx_lab_table *dst, rx_error *err);

/* A method's picture of a scene of a bin with the settings tuned for a metric. */
typedef struct rx_picture {
    int bin;
    const rx_trial *trial;
    const rx_lab_run *method;
    int metric;
    const rx_unit_values *done; /* values of all units */
} rx_picture;
rx_status rx_restoration_picture(const rx_lab *lab, const rx_picture *what, float *plane, rx_error *err);

/* --- report --- */

void rx_restoration_name_set(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96]);
rx_status rx_restoration_report(const rx_lab *lab, struct rx_lab_page *page, rx_error *err);
extern const char rx_restoration_reading[];

#endif
