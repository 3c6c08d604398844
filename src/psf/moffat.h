/* The elliptical Moffat profile (Moffat 1969, A&A 3, 455), integrated over pixels.
 *
 *   f(dx, dy) = (1 + k Q)^-beta,  k = 2^(1/beta) - 1,  f = 1 at the centre, 1/2 where Q = 1
 *   Q = [cosh(eta) (dx^2 + dy^2) - sinh(eta)/eta (e1 (dx^2 - dy^2) + 2 e2 dx dy)] / hwhm^2
 *   eta = sqrt(e1^2 + e2^2) = -ln(b/a);  (e1, e2) = eta (cos 2 angle, sin 2 angle)
 *
 * hwhm is the geometric mean of the half widths along the axes, so fwhm and ellipticity are nearly
 * independent in a fit. The exponent enters as u = 1/beta: u -> 0 is the Gaussian 2^-Q, without
 * a singularity. All parameters of a fit are free of bounds (v stands for u, see below).
 */
#ifndef RX_PSF_MOFFAT_H
#define RX_PSF_MOFFAT_H

/* beta = 1/u between 1/RX_MOFFAT_U_MAX (where the wings still hold a finite flux) and 1000. */
#define RX_MOFFAT_U_MAX 0.9
#define RX_MOFFAT_U_MIN 0.001

typedef struct rx_moffat {
    double hwhm, e1, e2, u; /* as above */
    double k, beta;
    double xx, yy, xy;       /* Q = xx dx^2 + yy dy^2 + 2 xy dx dy */
    double gradient_e[2][3]; /* d(xx, yy, xy) / d e1, e2 */
    double narrow;           /* half width along the minor axis: decides how a pixel is integrated */
    int rough; /* to 1e-4 of the peak, for fits to noisy pixels, in half the time; else to 1e-6 */
} rx_moffat;

/* Free parameters of the shape: ln hwhm, e1, e2, v with u = RX_MOFFAT_U_MAX / (1 + exp(-v)). */
enum { RX_MOFFAT_SHAPE = 4 };
void rx_moffat_set(rx_moffat *profile, const double shape[RX_MOFFAT_SHAPE]);
void rx_moffat_shape(double fwhm, double beta, double ratio, double angle, double shape[RX_MOFFAT_SHAPE]);

/* Integral over the pixel (area 1) whose centre is (dx, dy) from the profile's.
 * gradient (may be NULL): d/d dx, d/d dy, then d/d shape. */
double rx_moffat_pixel(const rx_moffat *profile, double dx, double dy, double gradient[2 + RX_MOFFAT_SHAPE]);

/* Radius, in units of the half width, of the circle that holds all but `share` of the flux; and
 * the one where the profile falls to `level` of its peak. */
double rx_moffat_radius_flux(double beta, double share);
double rx_moffat_radius_level(double beta, double level);

#endif
