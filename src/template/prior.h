/* The prior of a tile, learnt from its own sources: which share of them are points at each flux, how large the
 * others are and how steep. Faint sources lean on it (empirical Bayes). */
#ifndef RX_TEMPLATE_PRIOR_H
#define RX_TEMPLATE_PRIOR_H

#include "base/error.h"

/* A quantity among extended sources: mean + slope (ln flux - pivot) +- width. */
typedef struct rx_prior_scaling {
    double mean, slope, width;
} rx_prior_scaling;

typedef struct rx_tile_prior {
    double pivot;   /* ln ADU */
    double odds[2]; /* ln of points to others at the pivot, and its slope with ln flux; 0 when not known */
    rx_prior_scaling radius; /* ln of the half-light radius in pixels */
    rx_prior_scaling nu;     /* ln(1 + nu), slope 0 */
} rx_tile_prior;

/* What the pixels of one source say by themselves, priors taken out: a Gaussian of that mean and precision
 * (1 / width^2, 0: nothing). */
typedef struct rx_likelihood {
    double mean, precision;
} rx_likelihood;

typedef struct rx_prior_sample {
    double flux, snr; /* as a point */
    double evidence;  /* 2 ln of the ratio of evidences, profile to point; NAN: nothing was tried */
    double agreement; /* what of it is the law's of radii (rx_prior_agreement()) */
    rx_likelihood radius, nu;
} rx_prior_sample;

/* Before anything is known. */
rx_tile_prior rx_tile_prior_start(double fwhm);

/* Of S/N 15 to 150: bright enough to say, and not so bright that other kinds are among them. */
int rx_prior_is_clear(double snr);

/* Expectation maximisation (Dempster, Laird and Rubin 1977, J. R. Stat. Soc. B 39, 1) over all sources of S/N below 150, each by what its
 * pixels say. Before them stand one point and one other source, slopes of ln odds 0.5 +- 0.5 and of ln radius 0.275 +- 0.1, and for
 * the laws of radius and nu five sources. Unchanged with less than 20 sources of S/N 15 to 150. Errors: RX_SYSTEM. */
rx_status rx_tile_prior_fit(const rx_prior_sample *cases, int n, double fwhm, rx_tile_prior *tile_prior,
                            rx_error *err);

/* Centre of a law for a source of that flux. */
double rx_prior_scaling_mean(const rx_tile_prior *tile_prior, const rx_prior_scaling *law, double flux);

/* 2 ln of the likelihood of ln radius, averaged over its law. */
double rx_prior_agreement(const rx_tile_prior *tile_prior, const rx_likelihood *radius, double flux);

/* Probability of a point of that flux, and ln of its odds. */
double rx_prior_log_odds(const rx_tile_prior *tile_prior, double flux, double evidence);
double rx_prior_point(const rx_tile_prior *tile_prior, double flux, double evidence);

/* Of a fitted value and its variance under a prior. */
rx_likelihood rx_likelihood_of(double value, double variance, double centre, double width);

#endif
