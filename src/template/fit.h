/* The nonlinear fit of one point or profile to a patch. */
#ifndef RX_TEMPLATE_FIT_H
#define RX_TEMPLATE_FIT_H

#include "template/patch.h"
#include "template/spergel.h"
#include "template/template_otf.h"

/* Order of the parameters; a point has the first three. */
enum { RX_FIT_FLUX, RX_FIT_X, RX_FIT_Y, RX_FIT_RADIUS, RX_FIT_G1, RX_FIT_G2, RX_FIT_NU, RX_FIT_ALL };
enum { RX_FIT_POINT = RX_FIT_RADIUS };

typedef struct rx_fit {
    int n;                         /* RX_FIT_POINT or RX_FIT_ALL */
    const rx_sersic_table *sersic; /* profiles are Sersic's; NULL: Spergel's */
    /* x, y: off the middle of the domain; radius: its logarithm; nu: ln(1 + nu), of Sersic's ln n */
    double p[RX_FIT_ALL];
    double prior[RX_FIT_ALL];                 /* centre */
    double width[RX_FIT_ALL];                 /* of the prior, 0: none */
    double low[RX_FIT_ALL], high[RX_FIT_ALL]; /* limits, where low < high */
    int iterations;                           /* at most */
    /* found */
    double chi2;                       /* with the priors' part */
    double a[RX_FIT_ALL * RX_FIT_ALL]; /* normal matrix at the end, priors included */
    int at_limit;                      /* bits of the parameters that ended at a limit */
} rx_fit;

/* From fit->p on. Plane 0 of the domain holds the template of fit->p afterwards. The flux is that of the
 * linear fit at the start, whatever p says. */
void rx_fit_run(rx_fit *fit, rx_template_domain *size, const rx_patch *patch);

/* Profile of the parameters. */
rx_spergel rx_fit_profile(const rx_fit *fit);

/* ln det fit->a, HUGE_VAL when singular. */
double rx_fit_log_determinant(const rx_fit *fit);

/* Element [j][j] of the inverse of fit->a; HUGE_VAL when singular. */
double rx_fit_variance(const rx_fit *fit, int j);

/* Chi2 of the two points, both brighter than 0, that describe the patch best, found from fit's position, its flux in halves,
 * off to either side; neither goes farther than `room` from there. Any pair below `enough` will do. pair: flux, x, y of each;
 * NULL: not asked for.
 * HUGE_VAL: there is no such pair. Planes 0 and 1 are lost. */
double rx_fit_pair(const rx_fit *fit, const double off[2], double room, double enough,
                   rx_template_domain *size, const rx_patch *patch, double pair[2][3]);

/* Averages over what the shape may be, where its posterior is not the Gaussian around the best fit: flux
 * grows faster than linearly with radius and steepness, and faint sources' radii are uncertain by half. */
typedef struct rx_fit_mean {
    double flux, variance;
    double evidence; /* 2 ln of the evidence over that of the Gaussian */
} rx_fit_mean;

/* After rx_fit_run() with fit->n = RX_FIT_ALL, whose plane 0 it starts from. Along the direction of the shape
 * that the flux depends on, d = Cov(shape, F) / sqrt(Var F - Var(F | shape)), at 0 and +- sqrt(3) standard
 * deviations (the nodes of Gauss-Hermite's rule of degree 5) with the best flux each: nodes count by
 * exp(-chi2 / 2) over the Gaussian's, times the width that the flux has there. Where a node is better than
 * the best fit by more than a posterior's skewness explains, the best fit and its variance. Plane 0 is lost.
 */
rx_fit_mean rx_fit_average(const rx_fit *fit, rx_template_domain *size, const rx_patch *patch);

#endif
