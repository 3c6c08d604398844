/* Stars of a tile against a PSF model: what PSF_TYPE AUTO does again and again. Internal to psf/. */
#ifndef RX_PSF_FIT_H
#define RX_PSF_FIT_H

#include "data/image.h"
#include "data/sources.h"
#include "psf/psf_model.h"

/* A source that is subtracted as a point, and may be one of the stars that the PSF is measured from. */
typedef struct rx_point {
    int source;
    double x, y, flux, sky; /* sky: ADU, of the image's pixels */
    double sky_guess, sky_error;
    double snr, chi2; /* chi2 of a pixel */
    double damping;   /* of a step: less than 1 where neighbours' steps add up */
    int star;         /* the PSF is measured from it, or judged by it */
    int reserved;     /* judged only */
    int kept;         /* 0: does not look like the others */
    float *data, *weight; /* [side][side] of the core, neighbours and sky taken off: stars only */
} rx_point;

typedef struct rx_psf_job {
    const rx_image *image;
    const rx_sources *sources;
    int nthreads;
    double fwhm;
    int n;
    rx_point *points;     /* [n] */
    float *rest;          /* [height][width] pixels minus all points */
    unsigned char *used;  /* [height][width] 0: hidden, or of an extended source */
    rx_psf_model model;
    float *prior;         /* [side][side] coefficients of the profile that the model is held to */
    float *stamps;        /* room of the threads */
} rx_psf_job;

/* All points off the image. */
rx_status rx_psf_job_subtract(rx_psf_job *job, rx_error *err);

/* One step of every point's flux, position and sky towards the pixels; data and weights of stars. */
rx_status rx_psf_job_step(rx_psf_job *job, int with_positions, rx_error *err);

/* The model's coefficients, of a degree, from those stars [n]; the model starts as the prior. */
rx_status rx_psf_job_solve(const rx_psf_job *job, const int *stars, int n, int degree, rx_psf_model *model,
                           rx_error *err);

/* chi2 of a star's data against a model, flux and position fitted anew. */
rx_status rx_psf_job_chi2(const rx_psf_job *job, const rx_psf_model *model, const int *stars, int n, double *chi2,
                          rx_error *err);

#endif
