/* Spergel profiles in Fourier space. */
#include "template/spergel.h"

#include <math.h>
#include <stddef.h>

double rx_spergel_half_light(double nu, double *slope)
{
    static const double p[8] = {0.2288561167,   0.7540844887,   -0.1163544469,    0.03985938715,
                                -0.01231771899, 0.003532367094, -0.0008353176496, 0.000105305456};
    const double x = log1p(nu);
    double value = 0, derivative = 0;
    for (int i = 7; i >= 0; i--) {
        derivative = derivative * x + value;
        value = value * x + p[i];
    }
    if (slope != NULL)
        *slope = derivative;
    return exp(value);
}

void rx_spergel_set(const rx_spergel *profile, rx_spergel_form *form)
{
    const double pi2 = 6.283185307179586;
    const double scale = pi2 * profile->radius / rx_spergel_half_light(profile->nu, &form->slope);
    const double g1 = profile->g1, g2 = profile->g2, gg = g1 * g1 + g2 * g2;
    const double s2 = scale * scale, norm = s2 / (1 - gg);
    /* A^T A (1 - g^2) = [[(1 + g1)^2 + g2^2, 2 g2], [2 g2, (1 - g1)^2 + g2^2]] */
    const double xx = 1 + gg + 2 * g1, yy = 1 + gg - 2 * g1, xy = 2 * g2;
    form->uxx = norm * xx;
    form->uyy = norm * yy;
    form->uxy = norm * xy;
    const double d1 = 2 * g1 / (1 - gg), d2 = 2 * g2 / (1 - gg); /* d ln norm */
    form->g1xx = norm * (xx * d1 + 2 * g1 + 2);
    form->g1yy = norm * (yy * d1 + 2 * g1 - 2);
    form->g1xy = norm * xy * d1;
    form->g2xx = norm * (xx * d2 + 2 * g2);
    form->g2yy = norm * (yy * d2 + 2 * g2);
    form->g2xy = norm * (xy * d2 + 2);
    form->power = 1 + profile->nu;
}

double rx_spergel_at(const rx_spergel_form *form, double kx, double ky, double gradient[4])
{
    const double u = form->uxx * kx * kx + form->uyy * ky * ky + 2 * form->uxy * kx * ky;
    const double ln = log1p(u), value = exp(-form->power * ln);
    if (gradient != NULL) {
        const double du = -form->power * value / (1 + u);
        gradient[0] = 2 * u * du;
        gradient[1] = du * (form->g1xx * kx * kx + form->g1yy * ky * ky + 2 * form->g1xy * kx * ky);
        gradient[2] = du * (form->g2xx * kx * kx + form->g2yy * ky * ky + 2 * form->g2xy * kx * ky);
        gradient[3] = -ln * value * form->power - gradient[0] * form->slope;
    }
    return value;
}
