/* Spergel's (2010, ApJS 191, 58) family of surface brightness profiles, elliptical, as Fourier transforms:
 *
 *   S(k) = (1 + (2 pi c)^2 |A k|^2)^-(1 + nu),   S(0) = 1
 *   A = [[1 + g1, g2], [g2, 1 - g1]] / sqrt(1 - g1^2 - g2^2)
 *   g = (1 - q) / (1 + q) (cos 2 angle, sin 2 angle)
 *
 * nu = 0.5 is the exponential disk exactly, nu = -0.6 close to de Vaucouleurs' profile, large nu near a
 * Gaussian. c is the scale, radius = c * c_nu(nu) the half-light radius, geometric mean of both axes
 * (pixels). k in cycles per pixel. */
#ifndef RX_TEMPLATE_SPERGEL_H
#define RX_TEMPLATE_SPERGEL_H

#include "template/sersic.h"

#define RX_SPERGEL_MIN (-0.8)
#define RX_SPERGEL_MAX 9.0

typedef struct rx_spergel {
    double radius, g1, g2, nu;
    const rx_sersic_table *sersic; /* nu is Sersic's index, the profile his; NULL: Spergel's */
} rx_spergel;

/* Half-light radius in units of the scale, c_nu; to 4e-5 for RX_SPERGEL_MIN .. MAX (a polynomial in
 * ln(1 + nu) through numerical roots of Spergel's equation 6). *slope = d ln c_nu / d ln(1 + nu) (may be
 * NULL). */
double rx_spergel_half_light(double nu, double *slope);

/* The profile ready for evaluation. */
typedef struct rx_spergel_form {
    double uxx, uyy, uxy;    /* u(k) = uxx kx^2 + uyy ky^2 + 2 uxy kx ky */
    double g1xx, g1yy, g1xy; /* d u / d g1, the same form */
    double g2xx, g2yy, g2xy;
    double power; /* 1 + nu */
    double slope; /* d ln c_nu / d ln(1 + nu) */
    int sersic;   /* power and slope are not used, but */
    rx_sersic_line line;
} rx_spergel_form;

void rx_spergel_set(const rx_spergel *profile, rx_spergel_form *form);

/* S(k). gradient (may be NULL): d S / d ln radius, g1, g2, ln(1 + nu). */
double rx_spergel_at(const rx_spergel_form *form, double kx, double ky, double gradient[4]);

/* The same for n frequencies (kx, i step), i = first .. first + n - 1, in single precision (to 1e-6): dst[0]
 * = S [n], and with count = 5 dst[1 .. 4] its derivatives in the order above, of Sersic's by ln n; with count = 1 dst[0] only. */
void rx_spergel_column(const rx_spergel_form *form, double kx, double step, int first, int n, int count,
                       float *const *dst);

#endif
