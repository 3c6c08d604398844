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

/* Of member i of a group of n after its last fit: subjects[member[..]] and members[member[..]]. */
rx_fit_neighbour rx_evidence_neighbour(const rx_fit_source *subjects, const rx_joint_member *members,
                                       const int *member, int n, int i);

/* Source rival->one, whose footprint is shown, and rx_refine_alone_window() of its rival where it has one. Whether
 * it is there its own photons cannot say. Without a brighter neighbour that reaches over it (0.3 of its flux under its template, or coefficient of covariance
 * 0.2)
 *
 *   *evidence = flux^2 / variance
 *
 * which is exactly the rise of chi2 when a column is left out of linear least squares, the variance that without its own photons
 * and PSF errors, by what these take of the weights under its template; else
 *
 *   *evidence = 1 / (1 / rise + lumps^2)
 *   rise      = the smaller of flux^2 / variance and what rx_refine_alone() says of the neighbour with most
 *               light there (if it has that light, it has the photons)
 *   lumps     = 0.3 r^2 / (r^2 + FWHM^2) * the neighbour's light under the template in fluxes of the source
 *   r         = half-light radius of the neighbour; 0 for points
 *
 * Galaxies have arms and knots, which no smooth profile takes up and which the pixels want: 0.3 is the least
 * contrast of arms in simulate/scene.h. par: never frozen. Errors: RX_SYSTEM. */
rx_status rx_evidence_of(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *lens,
                         const rx_fit_source *subjects, const rx_fit_neighbour *rival, double *evidence,
                         rx_error *err);

/* What that evidence is amid a sky whose structure the models and the mesh do not follow: the edge of a chip, a filament, a
 * dark cloud. The template, moved about the source by half of its width sqrt(N), N = (sum T)^2 / sum T^2, finds z_k errors of
 * flux in data - model within 2.5 widths. Noise alone makes them 0 +- 1 about a plane's slopes, structure `level` +- sqrt(1 + S^2).
 * A star or cosmic ray beside it that no model has, or that its model does not fit (then they are of both signs), is no structure
 * of the sky, and few places see it: the plane is Huber's (1964, Ann. Math. Stat. 35, 73), and
 *
 *   1 + S^2 = mean square below the plane (light that no model has only adds), at least 1, without the z_k within 1.2 widths of the
 *             one farthest from it, what a point covers
 *   share   = 1 / (1 + exp(-gain)), gain = n / 2 (S^2 + level^2 - ln(1 + S^2)) - ln n
 *
 * the probability of structure by Schwarz's criterion (1978, Ann. Stat. 6, 461) for its two numbers, n the z_k that are a width
 * apart. A source there stands above the level only, and within that spread: with alone = flux^2 / variance
 *
 *   evidence = (1 - share level / sqrt(alone))^2 / (1 / evidence + share S^2 / alone), never more than before.
 *
 * data and model must be filled within rx_evidence_window(). Errors: RX_SYSTEM. */
rx_window rx_evidence_window(const rx_fit_image *image, const rx_fit_source *source);
rx_status rx_evidence_amid_sky(const rx_fit_image *image, const rx_fit_source *source, double alone,
                               double *evidence, rx_error *err);

#endif
