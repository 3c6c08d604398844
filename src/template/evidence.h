/* Is a source there, or is it a piece of its neighbour? */
#ifndef RX_TEMPLATE_EVIDENCE_H
#define RX_TEMPLATE_EVIDENCE_H

#include "base/error.h"
#include "template/joint.h"
#include "template/refine.h"

/* Who may have the light of a source, too. */
typedef struct rx_fit_neighbour {
    int one;      /* index of the source */
    double alone; /* its flux^2 / variance; 0 where one of them is not above 0 */
    int other;    /* index of that source, -1: none */
    double light; /* of it under the template of the source, in fluxes of the source */
} rx_fit_neighbour;

/* Of member i of a group of n after its last fit: sources[member[..]] and members[member[..]]. */
rx_fit_neighbour rx_evidence_neighbour(const rx_fit_source *sources, const rx_joint_member *members,
                                       const int *member, int n, int i);

/* What arms and knots of its profile amount to, in its fluxes: 0.3 r^2 / (r^2 + FWHM^2), r its half-light radius; 0 of a point. */
double rx_evidence_lumps(const rx_fit_source *source, double fwhm);

/* Source rival->one, whose footprint is shown, and rx_refine_alone_window() of its rival where it has one. Whether
 * it is there its own photons cannot say. Without a brighter neighbour that reaches over it (0.3 of its flux under its template, or coefficient of covariance
 * 0.2)
 *
 *   *evidence = flux^2 / variance
 *
 * which is exactly the rise of chi2 when a column is left out of linear least squares, the variance that without its own photons
 * and PSF errors, by what these take of the weights under its template; times what chi2 of photons, not of a normal distribution,
 * rises by (Cash 1979, ApJ 228, 939): 1 - s k / 3 of s = flux / error on a sky whose sums under the template have the skewness k; else
 *
 *   *evidence = 1 / (1 / rise + lumps^2)
 *   rise      = the smaller of flux^2 / variance and what rx_refine_alone() says of the neighbour with most
 *               light there (if it has that light, it has the photons)
 *   lumps     = 0.3 r^2 / (r^2 + FWHM^2) * the neighbour's light under the template in fluxes of the source
 *   r         = half-light radius of the neighbour; 0 for points
 *
 * Galaxies have arms and knots, which no smooth profile takes up and which the pixels want: 0.3 is the least
 * contrast of arms in simulate/scene.h. Structure of the sky leaves 1 / (1 / *evidence + its variance / flux^2) of it.
 * par: never frozen. Errors: RX_SYSTEM. */
rx_status rx_evidence_of(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *otf,
                         const rx_fit_source *sources, const rx_fit_neighbour *rival, double *evidence,
                         rx_error *err);

#endif
