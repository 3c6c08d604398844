/* What PSF_TYPE AUTO measures of the residuals of stars: rings around bright ones, moments. Internal to psf/. */
#ifndef RX_PSF_RINGS_H
#define RX_PSF_RINGS_H

#include "base/log.h"
#include "psf/psf.h"
#include "psf/psf_fit.h"

/* Of a star, data - model under a round Gaussian of the PSF's width: [0] (T_data - T_model) / T_model, T = xx + yy; [1]
 * e1 = (xx - yy) / T; [2] e2 = 2 xy / T; all times 2, which undoes what the weight takes off (exact for a Gaussian as
 * wide as it). error: 1 sigma of each from the pixels' noise. */
typedef struct rx_star_shape {
    double off[3], error;
} rx_star_shape;

/* shapes [job->n], of stars that are kept. */
void rx_psf_shapes(const rx_psf_job *job, rx_star_shape *shapes);

typedef struct rx_psf_wing {
    double radius, beyond; /* pixels within which all but `least` of the light lies, and what lies outside */
    double error;          /* of the light within, relative, 1 sigma */
    double hidden;         /* the part of it that is light in the rings' noise */
} rx_psf_wing;

/* Outer radius, pixels, of the ring around a star that says its sky. */
double rx_psf_rings_reach(const rx_psf_job *job);

/* The profile of core and wing from rings around the brightest stars that are ringed, which get the sky around these. Where
 * no ring stands out of the noise the wing stays, with the halo that is to be expected. */
rx_status rx_psf_wings(rx_psf_job *job, double least, rx_psf_wing *dst, rx_log *log, rx_error *err);

/* What reserved stars say of the model, into quality and tested of dst. */
rx_status rx_psf_test(const rx_psf_job *job, const rx_psf_wing *wing, rx_psf *dst, rx_error *err);

#endif
