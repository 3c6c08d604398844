/* Is a source two? */
#ifndef RX_TEMPLATE_TWO_H
#define RX_TEMPLATE_TWO_H

#include "base/error.h"
#include "template/refine.h"

/* How many sources of the tile are brighter than a flux, of those that models have. */
typedef struct rx_two_counts {
    double *flux; /* [n] brightest first, ADU; owned */
    int n;
    double pixels;
    double least; /* ADU: they are complete to there; fainter ones go on as 1 / flux */
} rx_two_counts;

/* [n] fluxes and their errors; all of S/N above 6. Free the contents with rx_two_counts_clear(). Errors: RX_SYSTEM. */
rx_status rx_two_counts_make(const double *flux, const double *error, int n, double pixels,
                             rx_two_counts *counts, rx_error *err);
void rx_two_counts_clear(rx_two_counts *counts);

/* What of the image rx_two_odds() reads. */
rx_window rx_two_window(const rx_refine_view *view, const rx_fit_source *source);

/* source->two, the probability that a second source is part of what is fitted as one, half to once as bright as the other and within one FWHM, and
 * source->star with it: that of points, one or two. Its hypotheses are one point, one profile (prior.h) and two of either, of the odds
 *
 *   sum over places d, ints of n(f) exp((2 f f' - f^2) / (2 e^2)) df      d up to one FWHM, f from F / 2 to F
 *
 * n(f): density of sources of that flux on the tile, of a pair that is one source of flux F; f' +- e: flux of the template at d in a linear
 * fit beside the template and its derivatives by position, and by size and ellipticity where it is a profile, whose arms and knots add to
 * e (evidence.h). Errors: RX_SYSTEM. */
rx_status rx_two_odds(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *otf,
                      const rx_two_counts *counts, rx_fit_source *source, rx_error *err);

#endif
