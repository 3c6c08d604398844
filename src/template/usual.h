/* What is usual on a tile, learnt from those of its own sources that are clear: how many are points, how
 * large the others are and how steep. Faint sources lean on it (empirical Bayes). */
#ifndef RX_TEMPLATE_USUAL_H
#define RX_TEMPLATE_USUAL_H

/* A quantity among extended sources: mean + slope (ln flux - pivot) +- width. */
typedef struct rx_usual_law {
    double mean, slope, width;
} rx_usual_law;

typedef struct rx_usual {
    double star_odds;    /* points to others; 1 when not known */
    double pivot;        /* ln ADU */
    rx_usual_law radius; /* ln of the half-light radius in pixels */
    rx_usual_law nu;     /* ln(1 + nu), slope 0 */
} rx_usual;

/* What the pixels of one source say by themselves, priors taken out: a Gaussian of that mean and precision
 * (1 / width^2, 0: nothing). */
typedef struct rx_usual_word {
    double mean, precision;
} rx_usual_word;

typedef struct rx_usual_case {
    double flux, snr;
    double evidence; /* 2 ln of the ratio of evidences, profile to point */
    rx_usual_word radius, nu;
} rx_usual_case;

/* Before anything is known. */
rx_usual rx_usual_start(double fwhm);

/* From the cases of S/N 15 to 150: bright enough to say and not so bright that other kinds are among them.
 * Expectation maximisation (Dempster, Laird and Rubin 1977, J. R. Stat. Soc. B 39, 1) for odds, means and
 * widths, the start counting as five sources. star_penalty: 2 ln of odds that come on top. Unchanged with
 * less than 20 such cases. */
void rx_usual_learn(const rx_usual_case *cases, int n, double star_penalty, double fwhm, rx_usual *usual);

/* Centre of a law for a source of that flux. */
double rx_usual_centre(const rx_usual *usual, const rx_usual_law *law, double flux);

/* Probability of a point: penalty = 2 ln of the prior odds for it. */
double rx_usual_star(double evidence, double penalty);

/* Of a fitted value and its variance under a prior. */
rx_usual_word rx_usual_say(double value, double variance, double centre, double width);

#endif
