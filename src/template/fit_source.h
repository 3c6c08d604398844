/* A source while it is being fitted, and what a fit of it sees. */
#ifndef RX_TEMPLATE_FIT_SOURCE_H
#define RX_TEMPLATE_FIT_SOURCE_H

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
    double as_point, point_error; /* flux if it is a point, and its error, ADU */
    double star, chi2_gain;
    double evidence;  /* for a profile: chi2_gain - Occam's factor, before any odds; 2 ln of the ratio of
                        evidences; NAN where none was tried */
    double agreement; /* what of it is the law's of radii */
    rx_likelihood size, slope; /* what its pixels say of ln radius and ln(1 + nu) */
    double variance;           /* of the flux, shape free, ADU^2; 0: that at fixed shape */
    double misfit;             /* error of the flux because no galaxy is a Spergel profile, ADU */
    double shape_error;        /* error of the flux over that at fixed shape, >= 1 */
    double position_gain; /* how much of two positions the data decide, 0..2: the flux at the best position is
                             too high by that / 2 * fluxerr^2 / flux */
    double structure;     /* variance that the structure of the sky adds to the flux, ADU^2 */
    double presence;      /* what rx_tphot_source.evidence will be */
    double two;           /* probability that it is two sources; NAN: not known */
    int flags;
    int added;         /* number among those that were added; -1: listed */
    int moved;         /* since its footprint was made */
    int paired;        /* not in a crowd, and two points describe it, no profile does: */
    double pair[2][3]; /* flux, x, y of both, the brighter one first */
    int still;         /* nothing has changed around it since it was fitted */
    int movable;       /* position and shape are fitted */
    int positive;      /* its flux was found far below 0 beside others: it is held at 0 or above */
    /* from the source list; segment 0: not listed */
    int untouched; /* found on untouched pixels, not on restored ones */
    int32_t segment;
    int xmin, xmax, ymin, ymax;
} rx_fit_source;

/* What every refinement sees; image->model holds the footprint of the source with its flux. */
typedef struct rx_refine_view {
    const rx_fit_image *image;
    const rx_restored *restored;
    const uint8_t *shape_mask; /* as rx_tphot_input has them; NULL: none */
    int shape_bits;
    const int32_t *segments;  /* [height][width] */
    const rx_crowding *crowd; /* where two points are tried beside a profile; NULL: nowhere */
    const rx_sky_mesh *
        structure; /* of the sky: what it adds to the variance of a point's flux, over that of the noise; NULL: none */
    double fwhm;
} rx_refine_view;

#endif
