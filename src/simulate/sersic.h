/* The Sersic profile (Sersic 1963; in the form of Ciotti and Bertin 1999, A&A 352, 447):
 *
 *   I(R) = I0 exp(-b (R / r)^(1/n)),  R <= truncation * r, nothing beyond
 *
 * The truncation is where the profile that goes on for ever has all but 1e-3 of its flux, at most 10 r: a
 * de Vaucouleurs profile would need 60 r to hold that much, and no one has seen a galaxy so far out. What is
 * cut is not lost: b is such that r is the half-light radius of the profile as it is cut, P(2n, b) =
 * P(2n, b truncation^(1/n)) / 2 with P the regularised incomplete gamma function, and I0 such that its
 * flux is 1. For n < 1.7 b is the usual b_n to 1e-3 of it (2e-3 below n = 0.4); at n = 4 it is 7.516 instead
 * of 7.669. */
#ifndef RX_SIMULATE_SERSIC_H
#define RX_SIMULATE_SERSIC_H

#define RX_SERSIC_LEAST 0.3 /* indices beyond are taken as these */
#define RX_SERSIC_MOST 10.0

typedef struct rx_sersic {
    double n;
    double b;
    double truncation; /* in half-light radii */
    double centre;     /* I0 of flux 1 and half-light radius 1 */
} rx_sersic;

void rx_sersic_set(double n, rx_sersic *dst);

/* Share of the flux within R half-light radii, 0..1. */
double rx_sersic_within(const rx_sersic *profile, double radius);

#endif
