/* Fluxes of one group of templates and its background, by weighted linear least squares. */
#ifndef RX_TEMPLATE_JOINT_H
#define RX_TEMPLATE_JOINT_H

#include "base/error.h"
#include "template/fit_image.h"

typedef struct rx_joint_params {
    double background_sigma; /* of the prior, in sigmas of a pixel; 0: none fitted */
    int errors;              /* variances, covariances and blends are asked for, not only fluxes and shifts */
    int nthreads;            /* for the equations of one group; < 1 counts as 1 */
} rx_joint_params;

/* One member, given and found. */
typedef struct rx_joint_member {
    const rx_footprint *footprint;
    double before; /* flux that image->model holds of it */
    double grain;  /* noise of its flux over that of independent pixels; 1 for those */
    int positive;  /* its flux is not below 0 */
    /* Its position may move, linearly: T(p - shift) = T - shift dT/dp. Prior: shift = centre +- width pixels;
     * width 0: it stays. Asked for where neighbours overlap: what a wrong position of one leaves is light
     * that the others take. */
    double shift_width, shift_centre[2];
    double flux; /* NAN without data */
    /* NAN where params.errors is 0: */
    double variance; /* ADU^2, positions free where they were */
    double alone;    /* variance if nothing else were free, ADU^2 */
    double blend;    /* largest |coefficient| with another member's flux */
    double shift[2]; /* pixels */
    int flags;       /* RX_TPHOT_BOUND, SINGULAR, NO_DATA */
} rx_joint_member;

/* n members; data are what the model of all others leaves. Weights are those of independent pixels, variances
 * those of the noise as image->correlation has it (correlated.h); priors count as much as without it. covariance [n][n] of the fluxes, NULL: not
 * wanted. Errors: RX_SYSTEM. */
rx_status rx_joint_fit(const rx_joint_params *par, const rx_fit_image *image, int n, rx_joint_member *members,
                       double *background, double *covariance, rx_error *err);

#endif
