/* What a restoration campaign has measured, complete and in a fixed order: bins of FWHM and of noise, the same scenes for
 * every method. Made from the journals, read by the report. */
#ifndef RX_LAB_RESULTS_H
#define RX_LAB_RESULTS_H

#include "lab/lab.h"

/* One method in one bin. */
typedef struct rx_method_scores {
    double *psnr, *ssim;     /* [nscenes] */
    char settings_psnr[120]; /* what tuning chose for PSNR ("RL_NITER 20, filter 0.8 FWHM"), "" when not tuned
                              */
    char settings_ssim[120]; /* the same for SSIM: tuned apart, in the method's own favour twice */
    int end_psnr, end_ssim;  /* 1: they lie at an end of what was tried, beyond which better ones may be */
} rx_method_scores;

typedef struct rx_restoration_bin {
    int by_sigma;     /* 0: a FWHM bin (pixels), 1: a bin of the noise's sigma (sharp peak: `peak`) */
    double low, high; /* of the binned quantity, uniform inside */
    double other_low, other_high; /* range of the other quantity */
    long nscenes;
    double *fwhm, *sigma; /* [nscenes] as drawn */
    double *level;        /* [nscenes] noise level on the scale of models: nn/noise_level.h */
    rx_method_scores method[RX_METHODS_MAX];
} rx_restoration_bin;

typedef struct rx_restoration_results {
    int nmethods;
    char method[RX_METHODS_MAX][RX_METHOD_NAME]; /* BLURRED, SMOOTHED, RL, RL_FLAT, NET ... */
    int nbins;                                   /* FWHM bins first, then noise bins */
    rx_restoration_bin *bins;
    int side;    /* pixels of a scene */
    double peak; /* brightest pixel of the sharp reference: 255 */
    double sharp_fwhm;
    int nexamples; /* a few scenes as pictures */
    struct rx_restoration_example *examples;
    double fwhm_trained[2];  /* of the network's model, without one of the keyword */
    double level_trained[2]; /* noise levels of the model's fields; 0, 0 = no model */
    long tune_scenes;        /* per bin, not among the nscenes; 0 = nothing was tuned */
    char about[600];         /* one line for the report: what is on a scene, pixel scale */
} rx_restoration_results;

/* One scene through all methods: planes are [side][side], plane 0 = blurred, then one per method, last the
 * sharp reference. */
typedef struct rx_restoration_example {
    double fwhm, sigma;
    int nplanes;
    char title[RX_METHODS_MAX + 2][RX_METHOD_NAME];
    float *planes[RX_METHODS_MAX + 2];
} rx_restoration_example;

void rx_restoration_results_free(rx_restoration_results *results); /* and the struct itself */

#endif
