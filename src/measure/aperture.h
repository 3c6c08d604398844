/* Sums in circles and ellipses; Kron and Petrosian apertures. */
#ifndef RX_MEASURE_APERTURE_H
#define RX_MEASURE_APERTURE_H

#include "measure/view.h"

/* A sum: flux (ADU, local sky subtracted) and its error; pixels whose centre is inside. */
typedef struct rx_sum {
    double flux, error;
    double area;    /* pixels, shares counted */
    int pixels;     /* whole pixels looked at */
    int hidden;     /* of these, neighbours or masked */
    int masked;     /* of these, masked */
    bool truncated; /* the aperture leaves the image */
} rx_sum;

/* Share of pixel (dx, dy off the centre) inside a circle: `oversampling`^2 samples near the rim. */
double rx_pixel_in_circle(float dx, float dy, float radius, int oversampling);

/* MAG_APER: 5 x 5 samples in rim pixels. */
void rx_sum_circle(const rx_view *view, double x, double y, double radius, rx_sum *sum);

/* FLUX_AUTO (Kron 1980): radius factor * sum(r I) / sum(I) within 6 rms ellipses, at least
 * auto_min_radius, in units of A and B. Fills flux_auto, fluxerr_auto, kron_radius (factor included,
 * 0 where the circle of PHOT_AUTOAPERS was used or the flux is not positive), masked_fraction, flags. */
void rx_measure_auto(const rx_view *view, const rx_measure_params *par, rx_source *s);

/* FLUX_PETRO (Petrosian 1976): radius where the local surface brightness falls to 0.2 of the mean inside. */
void rx_measure_petro(const rx_view *view, const rx_measure_params *par, rx_source *s);

#endif
