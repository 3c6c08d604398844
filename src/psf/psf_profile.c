/* The stretched profile, by its spline. */
#include "psf/psf_profile.h"

#include <math.h>
#include <stddef.h>

static const double LEAST_AREA = 0.04; /* that a stretch may leave of the profile's */

/* Value at (x, y) nodes off the middle of the spline of coefficients [side][side] and, unless NULL, its slopes; 0 outside. */
static double spline_at(const float *c, int side, double x, double y, double slope[2])
{
    const double at[2] = {x + side / 2, y + side / 2};
    double weight[2][4], steep[2][4], sum = 0.0, along[2] = {0.0};
    int first[2];
    for (int d = 0; d < 2; d++) {
        const double below = floor(at[d]), t = at[d] - below, s = 1.0 - t;
        if (!(at[d] >= 1.0 && at[d] < side - 2)) {
            if (slope != NULL)
                slope[0] = slope[1] = 0.0;
            return 0.0;
        }
        first[d] = (int)below - 1;
        weight[d][0] = s * s * s / 6.0;
        weight[d][1] = (4.0 - 3.0 * t * t * (2.0 - t)) / 6.0;
        weight[d][2] = (4.0 - 3.0 * s * s * (2.0 - s)) / 6.0;
        weight[d][3] = t * t * t / 6.0;
        steep[d][0] = -0.5 * s * s;
        steep[d][1] = t * (1.5 * t - 2.0);
        steep[d][2] = -s * (1.5 * s - 2.0);
        steep[d][3] = 0.5 * t * t;
    }
    for (int j = 0; j < 4; j++) {
        const float *row = c + (size_t)(first[1] + j) * (size_t)side + (size_t)first[0];
        double value = 0.0, rise = 0.0;
        for (int i = 0; i < 4; i++) {
            value += weight[0][i] * (double)row[i];
            rise += steep[0][i] * (double)row[i];
        }
        sum += weight[1][j] * value;
        along[0] += weight[1][j] * rise;
        along[1] += steep[1][j] * value;
    }
    if (slope != NULL) {
        slope[0] = along[0];
        slope[1] = along[1];
    }
    return sum;
}

double rx_psf_stretched(const float *c, int side, double x, double y, const double a[RX_PSF_STRETCH],
                        double gradient[2 + RX_PSF_STRETCH])
{
    static const double by_a[RX_PSF_STRETCH][3] = {{1.0, 1.0, 0.0}, {0.5, -0.5, 0.0}, {0.0, 0.0, 0.5}};
    const double xx = 1.0 + a[0] + 0.5 * a[1], yy = 1.0 + a[0] - 0.5 * a[1], xy = 0.5 * a[2],
                 det = xx * yy - xy * xy;
    for (int k = 0; k < 2 + RX_PSF_STRETCH && gradient != NULL; k++)
        gradient[k] = 0.0;
    if (!(xx + yy > 0.0 && det > LEAST_AREA)) /* longer than any PSF; beyond, light would be negative */
        return 0.0;
    double slope[2];
    const double u = (yy * x - xy * y) / det, v = (xx * y - xy * x) / det;
    const double value = spline_at(c, side, u, v, gradient != NULL ? slope : NULL) / det;
    if (gradient == NULL)
        return value;
    gradient[0] = (slope[0] * yy - slope[1] * xy) / (det * det);
    gradient[1] = (slope[1] * xx - slope[0] * xy) / (det * det);
    for (int q = 0; q < RX_PSF_STRETCH; q++) {
        const double *d = by_a[q], grows = (d[0] * yy + d[1] * xx - 2.0 * xy * d[2]) / det,
                     du = (d[1] * x - d[2] * y) / det - u * grows,
                     dv = (d[0] * y - d[2] * x) / det - v * grows;
        gradient[2 + q] = (slope[0] * du + slope[1] * dv) / det - value * grows;
    }
    return value;
}
