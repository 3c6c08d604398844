/* Sersic profile: normalisation, half-light radius, growth. */
#include "simulate/sersic.h"

#include <math.h>

#define PI 3.14159265358979323846
#define FARTHEST 10.0      /* truncation, half-light radii */
#define BEYOND 1e-3        /* share of the flux that may lie beyond the truncation where it is nearer */
#define BEYOND_Z 3.0902323 /* the same as a deviation of the normal distribution */

static double log_gamma(double a)
{
    int sign;
    return lgamma_r(a, &sign); /* lgamma() writes a variable that all threads share */
}

#define UNCUT 1e6 /* times b: nothing lies beyond */

/* Series for small x, Lentz's continued fraction for large ones (Abramowitz and Stegun 6.5.29, 6.5.31). */
double rx_gamma_within(double a, double x)
{
    if (!(x > 0.0))
        return 0.0;
    double scale = exp(a * log(x) - x - log_gamma(a));
    if (x < a + 1.0) {
        double term = 1.0 / a, sum = term;
        for (int i = 1; i < 1000 && term > 1e-15 * sum; i++) {
            term *= x / (a + i);
            sum += term;
        }
        return scale * sum;
    }
    double b = x + 1.0 - a, c = 1e300, d = 1.0 / b, h = d;
    for (int i = 1; i < 1000; i++) {
        double an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= c * d;
        if (fabs(c * d - 1.0) < 1e-14)
            break;
    }
    return 1.0 - scale * h;
}

static double gamma_density(double a, double x)
{
    return exp((a - 1.0) * log(x) - x - log_gamma(a));
}

/* x with P(a, x) = 1 - BEYOND: Wilson and Hilferty's (1931) cube, then Newton. */
static double gamma_edge(double a)
{
    double root = 1.0 - 1.0 / (9.0 * a) + BEYOND_Z / (3.0 * sqrt(a)), x = a * root * root * root;
    for (int i = 0; i < 20; i++) {
        double step = (rx_gamma_within(a, x) - (1.0 - BEYOND)) / gamma_density(a, x);
        x = fmax(x - step, 0.5 * x);
        if (fabs(step) < 1e-12 * x)
            break;
    }
    return x;
}

/* b with P(a, b) = P(a, b t) / 2: Newton, kept inside an interval that shrinks. */
static double half_light(double a, double t, double start)
{
    double low = 0.0, high = 2.0 * start + 1.0, b = start;
    for (int i = 0; i < 200; i++) {
        double value = rx_gamma_within(a, b) - 0.5 * rx_gamma_within(a, b * t);
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
    dst->truncation = fmin(FARTHEST, pow(gamma_edge(a) / whole, n));
    double t = pow(dst->truncation, 1.0 / n);
    dst->b = half_light(a, t, whole);
    double within = rx_gamma_within(a, dst->b * t);
    dst->centre = exp(a * log(dst->b) - log_gamma(a)) / (2.0 * PI * n * within);
}

double rx_sersic_within(const rx_sersic *profile, double radius)
{
    if (radius >= profile->truncation)
        return 1.0;
    double a = 2.0 * profile->n, power = 1.0 / profile->n;
    return rx_gamma_within(a, profile->b * pow(radius, power)) /
           rx_gamma_within(a, profile->b * pow(profile->truncation, power));
}
