/* One source against the pixels, its neighbours' models taken out: where it is, whether it is a point, and
 * what profile it has otherwise.
 *
 * Levenberg-Marquardt with priors, so that faint sources end near the prior of the tile instead of anywhere:
 *   minimise sum_p w (c - F T(x, y, ln radius, g1, g2, nu))^2 + sum_j ((parameter_j - usual_j) / width_j)^2
 * c = data - model of all others. Priors: position 0.25 + 0.1 FWHM around the given one, of a
 * profile a quarter of its guessed half-light radius more; g1, g2 0 +- 0.25;
 * radius and nu as the prior of the tile has them (prior.h), to begin with 0.6 FWHM within a factor e and 1 + nu 1.5
 * within a factor exp(0.5). They are weak: a source of S/N 30 hardly feels them.
 *
 * Where the pixels cannot distinguish point from profile both are taken, each with the flux of its fit and its
 * probability: that of a point is p = 1 / (1 + exp((chi2 gain - Occam's factor - 2 ln of the prior odds) / 2)). A
 * choice would take galaxies of S/N 10 for stars half of the time, 20 to 40 % too faint, and say nothing of
 * it in the error. Where a little size gains nothing, disks of three radii say
 * what the profile would. */
#ifndef RX_TEMPLATE_REFINE_H
#define RX_TEMPLATE_REFINE_H

#include "base/error.h"
#include "template/fit_source.h"

#define RX_REFINE_FAINT 0.03 /* of a pixel's noise: fainter light is left out */
#define RX_REFINE_RADIUS 0.1 /* pixels: the smallest half-light radius */

typedef struct rx_refine_params {
    int extended, substructure;
    const rx_tile_prior *tile_prior;
    int frozen; /* positions and profiles stay, only the footprint is made */
} rx_refine_params;

/* Width of the prior of a position, pixels. */
double rx_refine_reach(double fwhm);

/* What of the image rx_refine() reads. */
rx_window rx_refine_window(const rx_refine_params *par, const rx_refine_view *view,
                           const rx_template_otf *otf, const rx_fit_source *source);

/* *after = source, refined, with a footprint of its own; source stays as it is. Errors: RX_SYSTEM. */
rx_status rx_refine(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *otf,
                    const rx_fit_source *source, rx_fit_source *after, rx_error *err);

/* How much better the pixels are described with `other` than by `source` alone: chi2 (priors included) of
 * the source's best point or profile with the other's light put back into the data, less that with it taken
 * out. Errors: RX_SYSTEM. */
rx_window rx_refine_alone_window(const rx_refine_view *view, const rx_fit_source *source,
                                 const rx_fit_source *other); /* what of the image it reads */
rx_status rx_refine_alone(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *otf,
                          const rx_fit_source *source, const rx_fit_source *other, double *rise,
                          rx_error *err);

/* What structure of the sky leaves of a gain in chi2 by such a profile: it adds to the variance of a flux by as much as the
 * profile is wider than a point, squared. */
double rx_refine_amid_structure(const rx_refine_view *view, int cx, int cy, double gain, double radius);

#endif
