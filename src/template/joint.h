/* Fluxes of one group of templates and its background, by weighted linear least squares. */
#ifndef RX_TEMPLATE_JOINT_H
#define RX_TEMPLATE_JOINT_H

#include "base/error.h"
#include "template/canvas.h"

typedef struct rx_joint_params {
    double background_sigma; /* of the prior, in sigmas of a pixel; 0: none fitted */
    int non_negative;
} rx_joint_params;

/* One member, given and found. */
typedef struct rx_joint_member {
    const rx_footprint *footprint;
    double before;   /* flux that canvas->model holds of it */
    double flux;     /* NAN without data */
    double variance; /* ADU^2 */
    double blend;    /* largest |coefficient| with another member */
    int flags;       /* RX_TPHOT_BOUND, SINGULAR, NO_DATA */
} rx_joint_member;

/* n members; data are what the model of all others leaves. covariance [n][n] of the fluxes, NULL: not
 * wanted. Errors: RX_SYSTEM. */
rx_status rx_joint_fit(const rx_joint_params *par, const rx_canvas *canvas, int n, rx_joint_member *members,
                       double *background, double *covariance, rx_error *err);

#endif
