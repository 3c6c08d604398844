/* Correlation of PSF residuals between pairs of stars, by their angle on the sky:
 *
 *   rho1(theta) = < Re (de_i conj(de_j)) >,   rhoT(theta) = < (dT/T)_i (dT/T)_j >
 *
 * de = e - e of the PSF, e = e1 + i e2, north up; rho1 as Rowe (2010, MNRAS 404, 350). Sums are of whole numbers (residuals in
 * units of RX_RHO_UNIT), the same for any order. */
#ifndef RX_QUALITY_RHO_H
#define RX_QUALITY_RHO_H

#include "base/error.h"

#define RX_RHO_UNIT 1e-4
enum { RX_RHO_BINS = 11 };

typedef struct rx_rho_star {
    double alpha, delta; /* deg */
    int t, e1, e2;       /* units */
} rx_rho_star;

/* The stars of an image: their sums, and those of their pairs by angle. */
typedef struct rx_rho {
    long n, t, e1, e2;                                         /* sums of units */
    double alpha, delta;                                       /* of the image's centre, deg */
    double reach;                                              /* no star is farther from the centre, deg */
    long pairs[RX_RHO_BINS], tt[RX_RHO_BINS], ee[RX_RHO_BINS]; /* sums of units^2 */
} rx_rho;

/* One range of angles of a survey. error: from image to image, or pair of images to pair of images; NAN of one. */
typedef struct rx_rho_bin {
    double pairs, t, t_error, e, e_error;
} rx_rho_bin;

/* Angle where bin k begins, arcmin; k = RX_RHO_BINS: where the last one ends. */
double rx_rho_edge(int k);

/* A residual in units, at most half of 1 so that sums stay far from overflow. */
int rx_rho_units(double residual);

/* dst's centre is given. */
void rx_rho_of(int n, const rx_rho_star *stars, rx_rho *dst);

/* Pairs within images, and between images that do not overlap: these at the angle of the centres, the same numbers for
 * any order of images[n]. Only images nearer than the largest angle in declination are compared. Errors: RX_SYSTEM,
 * RX_INTERRUPTED. */
rx_status rx_rho_all(int n, const rx_rho *const *images, rx_rho_bin dst[RX_RHO_BINS], rx_error *err);

#endif
