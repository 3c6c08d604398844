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
 * probability: that of a point is p = 1 / (1 + exp((chi2 gain - Occam's factor - star_penalty) / 2)). A
 * choice would take galaxies of S/N 10 for stars half of the time, 20 to 40 % too faint, and say nothing of
 * it in the error. */
#ifndef RX_TEMPLATE_REFINE_H
#define RX_TEMPLATE_REFINE_H

#include "base/error.h"
#include "template/crowd.h"
#include "template/fit_image.h"
#include "template/prior.h"
#include "template/spergel.h"
#include "template/template_otf.h"

/* A source while it is being fitted. */
typedef struct rx_fit_source {
    rx_tphot_kind kind;
    double x, y;        /* now */
    double x0, y0;      /* as given: centre of the prior */
    rx_spergel profile; /* radius 0: a point */
    double guess;       /* half-light radius expected from the restored image, pixels */
    double point;       /* share of the light that is a point's, 0..1 */
    double flux;        /* now, ADU, of its template */
    double lift;        /* mean of the flux over what the shape may be, over that of the template */
    rx_footprint footprint;
    double grain; /* noise of its flux over that of independent pixels, rx_noise_factor() of its template */
    /* found by the last refinement */
    double star, chi2_gain;
    double evidence; /* for a profile: chi2_gain - Occam's factor, before any odds; 2 ln of the ratio of
                        evidences */
    rx_likelihood size, slope; /* what its pixels say of ln radius and ln(1 + nu) */
    double variance;           /* of the flux, shape free, ADU^2; 0: that at fixed shape */
    double misfit;             /* error of the flux because no galaxy is a Spergel profile, ADU */
    double shape_error;        /* error of the flux over that at fixed shape, >= 1 */
    double position_gain; /* how much of two positions the data decide, 0..2: the flux at the best position is
                             too high by that / 2 * fluxerr^2 / flux */
    double presence;      /* what rx_tphot_source.evidence will be */
    int flags;
    int added;         /* number among those that were added; -1: listed */
    int moved;         /* since its footprint was made */
    int paired;        /* not in a crowd, and two points describe it, no profile does: */
    double pair[2][3]; /* flux, x, y of both, the brighter one first */
    int still;         /* nothing has changed around it since it was fitted */
    /* from the source list; segment 0: not listed */
    int untouched; /* found on untouched pixels, not on restored ones */
    int32_t segment;
    int xmin, xmax, ymin, ymax;
} rx_fit_source;

typedef struct rx_refine_params {
    int extended, substructure;
    double star_penalty; /* without what is learnt */
    const rx_tile_prior *usual;
    int frozen; /* positions and profiles stay, only the footprint is made */
} rx_refine_params;

/* What every refinement sees; canvas->model holds the footprint of the subject with its flux. */
typedef struct rx_refine_view {
    const rx_fit_image *canvas;
    const rx_restored *restored;
    const uint8_t *shape_mask; /* as rx_tphot_input has them; NULL: none */
    int shape_bits;
    const int32_t *segments;  /* [height][width] */
    const rx_crowding *crowd; /* where two points are tried beside a profile; NULL: nowhere */
    double fwhm;
} rx_refine_view;

/* Width of the prior of a position, pixels. */
double rx_refine_reach(double fwhm);

/* What of the canvas rx_refine() reads. */
rx_window rx_refine_window(const rx_refine_params *par, const rx_refine_view *view,
                           const rx_template_otf *lens, const rx_fit_source *subject);

/* *after = subject, refined, with a footprint of its own; subject stays as it is. Errors: RX_SYSTEM. */
rx_status rx_refine(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *lens,
                    const rx_fit_source *subject, rx_fit_source *after, rx_error *err);

/* How much better the pixels are described with `other` than by `subject` alone: chi2 (priors included) of
 * the subject's best point or profile with the other's light put back into the data, less that with it taken
 * out. Errors: RX_SYSTEM. */
rx_window rx_refine_alone_window(const rx_refine_view *view, const rx_fit_source *subject,
                                 const rx_fit_source *other); /* what of the canvas it reads */
rx_status rx_refine_alone(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *lens,
                          const rx_fit_source *subject, const rx_fit_source *other, double *rise,
                          rx_error *err);

#endif
