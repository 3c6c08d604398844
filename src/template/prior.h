/* The prior of a tile, learnt from those of its own sources that are clear: how many are points, how
 * large the others are and how steep. Faint sources lean on it (empirical Bayes). */
#ifndef RX_TEMPLATE_PRIOR_H
#define RX_TEMPLATE_PRIOR_H

/* A quantity among extended sources: mean + slope (ln flux - pivot) +- width. */
typedef struct rx_prior_scaling {
    double mean, slope, width;
} rx_prior_scaling;

typedef struct rx_tile_prior {
    double star_odds;        /* points to others; 1 when not known */
    double pivot;            /* ln ADU */
    rx_prior_scaling radius; /* ln of the half-light radius in pixels */
    rx_prior_scaling nu;     /* ln(1 + nu), slope 0 */
} rx_tile_prior;

/* What the pixels of one source say by themselves, priors taken out: a Gaussian of that mean and precision
 * (1 / width^2, 0: nothing). */
typedef struct rx_likelihood {
    double mean, precision;
} rx_likelihood;

typedef struct rx_prior_sample {
    double flux, snr;
    double evidence; /* 2 ln of the ratio of evidences, profile to point */
    rx_likelihood radius, nu;
} rx_prior_sample;

/* Before anything is known. */
rx_tile_prior rx_tile_prior_start(double fwhm);

/* Of S/N 15 to 150: bright enough to say, and not so bright that other kinds are among them. */
int rx_prior_is_clear(double snr);

/* From the clear cases. Expectation maximisation (Dempster, Laird and Rubin 1977, J. R. Stat. Soc. B 39, 1) for odds, means and
 * widths, the start counting as five sources. star_penalty: 2 ln of odds that come on top. Unchanged with
 * less than 20 such cases. */
void rx_tile_prior_fit(const rx_prior_sample *cases, int n, double star_penalty, double fwhm,
                       rx_tile_prior *usual);

/* Centre of a law for a source of that flux. */
double rx_prior_scaling_mean(const rx_tile_prior *usual, const rx_prior_scaling *law, double flux);

/* Probability of a point: penalty = 2 ln of the prior odds for it. */
double rx_point_probability(double evidence, double penalty);

/* Of a fitted value and its variance under a prior. */
rx_likelihood rx_likelihood_of(double value, double variance, double centre, double width);

#endif
