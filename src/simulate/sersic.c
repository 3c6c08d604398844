/* Sersic profile: normalisation, half-light radius, growth. */
#include "simulate/sersic.h"

#include <math.h>

#include "num/special.h"

#define FARTHEST 10.0 /* truncation, half-light radii */
#define BEYOND 1e-3   /* share of the flux that may lie beyond the truncation where it is nearer */

#define UNCUT 1e6 /* times b: nothing lies beyond */

static double gamma_density(double a, double x)
{
    return exp((a - 1.0) * log(x) - x - rx_gamma_log(a));
}

/* b with P(a, b) = P(a, b t) / 2: Newton, kept inside an interval that shrinks. */
static double half_light(double a, double t, double start)
{
    double low = 0.0, high = 2.0 * start + 1.0, b = start;
    for (int i = 0; i < 200; i++) {
        double value = rx_gamma_p(a, b) - 0.5 * rx_gamma_p(a, b * t);
        double slope = gamma_density(a, b) - 0.5 * t * gamma_density(a, b * t);
        if (value > 0.0)
            high = b;
        else
            low = b;
        double next = b - value / slope;
        if (!(next > low && next < high))
            next = 0.5 * (low + high);
        double moved = fabs(next - b);
        b = next;
        if (moved < 1e-13 * b)
            break;
    }
    return b;
}

void rx_sersic_set(double n, rx_sersic *dst)
{
    n = fmin(fmax(n, RX_SERSIC_LEAST), RX_SERSIC_MOST);
    double a = 2.0 * n;
    double guess = fmax(a - 1.0 / 3.0 + 4.0 / (405.0 * n), 0.1); /* Ciotti and Bertin, eq. 18 */
    double whole = half_light(a, UNCUT, guess);
    dst->n = n;
    dst->truncation = fmin(FARTHEST, pow(rx_gamma_q_inverse(a, BEYOND) / whole, n));
    double t = pow(dst->truncation, 1.0 / n);
    dst->b = half_light(a, t, whole);
    double within = rx_gamma_p(a, dst->b * t);
    dst->centre = exp(a * log(dst->b) - rx_gamma_log(a)) / (2.0 * M_PI * n * within);
}

double rx_sersic_within(const rx_sersic *profile, double radius)
{
    if (radius >= profile->truncation)
        return 1.0;
    double a = 2.0 * profile->n, power = 1.0 / profile->n;
    return rx_gamma_p(a, profile->b * pow(radius, power)) /
           rx_gamma_p(a, profile->b * pow(profile->truncation, power));
}
