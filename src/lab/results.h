/* What a campaign has measured, complete and in a fixed order: made from the journals, read by the report.
 * The same for any number of shards, threads and interruptions. */
#ifndef RX_LAB_RESULTS_H
#define RX_LAB_RESULTS_H

#include "base/error.h"

enum { RX_METHODS_MAX = 16, RX_METHOD_NAME = 24, RX_PRECISIONS_MAX = 8 };

/* ---- restoration: bins of FWHM and of noise, the same scenes for every method ---- */

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

/* ---- photometry: stars of one magnitude per set, on a kind of field ---- */

typedef struct rx_star_result {
    float score;   /* detection S/N that found it; NAN = not found */
    float ratio;   /* F / F0, NAN = not found */
    float pull;    /* (F - F0) / error */
    float crowded; /* 1: FLAGS shows a neighbour or a blend */
} rx_star_result;

/* One restorer on one set. Stars are in the same order for every restorer: pairs can be compared. */
typedef struct rx_photometry_tally {
    rx_star_result *stars; /* [nstars] */
    long nfalse;           /* detections that are no object, known or injected */
    float *false_scores;   /* [nfalse] */
    float *false_mags;     /* [nfalse] measured magnitude */
    double seconds;        /* never written to outputs that must repeat */
} rx_photometry_tally;

typedef struct rx_photometry_set {
    double mag, snr; /* of the stars; snr in a matched filter on this field, background-limited */
    long ntiles, nstars;
    double mpixels;
    rx_photometry_tally run[RX_METHODS_MAX];
} rx_photometry_set;

typedef struct rx_photometry_field {
    char name[64];   /* "simulated", "sdss r-000094-1-0012" */
    char about[600]; /* one line for the report: FWHM, noise, what else is on it */
    int misled;      /* restorers were given a wrong PSF, sky or noise: no claim speaks of that */
    int nsets;
    rx_photometry_set *sets; /* bright to faint */
} rx_photometry_field;

typedef struct rx_photometry_results {
    int nruns;
    char run[RX_METHODS_MAX][RX_METHOD_NAME]; /* NONE, RL ..., "NONE TEMPLATE" */
    int templates[RX_METHODS_MAX];            /* 1: fluxes of template photometry */
    char settings[RX_METHODS_MAX][200];
    int nfields;
    rx_photometry_field *fields;
    int nprecisions; /* at which completeness is compared, as PRECISIONS */
    double precision[RX_PRECISIONS_MAX];
} rx_photometry_results;

void rx_restoration_results_free(rx_restoration_results *results); /* and the struct itself */
void rx_photometry_results_free(rx_photometry_results *results);

#endif
