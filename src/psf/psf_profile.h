/* The profile that the model of a PSF is held to, stretched. Internal to psf/.
 *
 * A stretch (s, g1, g2) makes of the profile that the model is held to
 *   profile(B^-1 u) / det B,  B = (1 + s + g1/2, g2/2; g2/2, 1 + s - g1/2). */
#ifndef RX_PSF_PROFILE_H
#define RX_PSF_PROFILE_H

enum { RX_PSF_STRETCH = 3 };

/* Value at (x, y) nodes off the middle, 0 outside, of the profile stretched by a, whose spline has the coefficients
 * [side][side]; its derivatives by x, y and a, or NULL. */
double rx_psf_stretched(const float *c, int side, double x, double y, const double a[RX_PSF_STRETCH],
                        double gradient[2 + RX_PSF_STRETCH]);

#endif
