/* Stars of a tile against a PSF model: what PSF_TYPE AUTO does again and again. Internal to psf/. */
#ifndef RX_PSF_FIT_H
#define RX_PSF_FIT_H

#include "data/image.h"
#include "data/psf.h"
#include "data/sources.h"
#include "psf/moffat.h"
#include "psf/psf_model.h"
#include "psf/psf_profile.h"

/* A source that is subtracted as a point, and may be one of the stars that the PSF is measured from. */
typedef struct rx_psf_point {
    int source;
    double x, y, flux, sky; /* sky: ADU, of the image's pixels */
    double sky_guess, sky_error;
    double snr, chi2;     /* chi2 of a pixel */
    double damping;       /* of a step: less than 1 where neighbours' steps add up */
    int star;             /* the PSF is measured from it, or tested by it */
    int reserved;         /* tests only */
    int wider;            /* than stars are: a star of a bad corner, or a galaxy */
    int together;         /* wider than most, as those around it are: of a bad corner */
    int kept;             /* 0: does not look like the others */
    int ringed;           /* all light as far as its sky's ring is subtracted */
    double saturated;     /* radius (pixels) of its core that is of no use; 0: unsaturated */
    double unlike;        /* of a saturated one: share of its pixels that no star would have */
    int cx, cy, reach;    /* pixel and half side of the stamp that was subtracted last */
    float *data, *weight; /* [side][side] of the core, neighbours and sky taken off: stars only */
} rx_psf_point;

/* How size and ellipse of the stars vary over the tile (psf_stretch.h): each of s, g1, g2 is a polynomial of the position,
 * sum_k c_k L_k(X, Y). */
typedef struct rx_psf_variation {
    int degree, nterms, with_wider; /* wider ones are stars of a bad corner */
    double c[RX_PSF_STRETCH][RX_PSF_TERMS];
    /* 1 sigma of s at X, Y = -1, -0.5, ..: of its polynomial, and what stars around say that it misses */
    double error[RX_PSF_CELLS][RX_PSF_CELLS];
    double missed, missed_at[2]; /* the largest significant one, its place in pixels */
} rx_psf_variation;

/* Exponentials that are part of the wing as rings may hide them: sum_k amount_k exp(-r / wide_k), r in pixels. */
enum { RX_PSF_HALO_SCALES = 4 };

typedef struct rx_psf_halo {
    int n;
    double wide[RX_PSF_HALO_SCALES], amount[RX_PSF_HALO_SCALES];
} rx_psf_halo;

typedef struct rx_psf_job {
    const rx_image *image;
    const rx_sources *sources;
    int nthreads;
    double fwhm;
    double most; /* radius that the PSF may have, pixels */
    rx_psf_variation variation;
    double model_error; /* E: of a pixel of the model, relative, 1 sigma */
    int n;
    rx_psf_point *points; /* [n] */
    float *rest;          /* [height][width] pixels minus all points as they were when subtracted last */
    unsigned char *used;  /* [height][width] 0: hidden, or of an extended source; RX_PSF_OWN */
    rx_psf_model model;
    rx_psf_halo halo;
    rx_moffat profile; /* that it started from: its ellipse is that of rings */
    double *values;    /* [side][side] the profile that the model is held to, at the nodes */
    float *prior;      /* its coefficients */
    float *stamps;     /* room of the threads */
} rx_psf_job;

/* A pixel of a saturated star, which only this star looks at. */
enum { RX_PSF_OWN = 2 };
static inline int rx_psf_job_uses(const rx_psf_job *job, const rx_psf_point *p, size_t at)
{
    return job->used[at] == 1 || (job->used[at] == RX_PSF_OWN && p->saturated > 0.0 &&
                                  job->sources->segments[at] == job->sources->list[p->source].segment);
}

/* How far (pixels) the light of a point is above a twentieth of the sky's noise. */
int rx_psf_job_reach(const rx_psf_job *job, const rx_psf_point *p);

/* Work of the calling thread: nodes [side][side], then the core's stamp and two of derivatives, then rx_psf_model_work(). */
float *rx_psf_job_room(const rx_psf_job *job);

/* All points off the image. */
rx_status rx_psf_job_subtract(rx_psf_job *job, rx_error *err);

/* One step of every point's flux, position and sky towards the pixels; data and weights of stars. */
rx_status rx_psf_job_step(rx_psf_job *job, int with_positions, rx_error *err);

/* model_error: the median of what the cores of the brightest stars that are kept find most likely. */
rx_status rx_psf_job_measure_error(rx_psf_job *job, rx_error *err);

/* How far pixels may depart from the stretched profile: not at all, in the constant term a little or more, in all terms. */
enum { RX_PSF_STIFF, RX_PSF_FIRM, RX_PSF_LOOSE, RX_PSF_LOOSE_ALL, RX_PSF_FREEDOMS };

/* The model's coefficients from those stars [n]. */
rx_status rx_psf_job_solve(const rx_psf_job *job, const int *stars, int n, int pixels, rx_psf_model *model,
                           rx_error *err);

/* Radius (pixels) of the round star that has the profile's value at (x, y): along its ellipse in the core, round outside. */
double rx_psf_job_radius(const rx_psf_job *job, double x, double y);

/* chi2 of a star's data against a model, flux and position fitted anew. */
rx_status rx_psf_job_chi2(const rx_psf_job *job, const rx_psf_model *model, const int *stars, int n,
                          double *chi2, rx_error *err);

#endif
