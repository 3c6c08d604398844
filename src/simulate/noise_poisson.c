/* Poisson deviates. */
#include <math.h>

#include "base/random.h"
#include "simulate/noise.h"

#define LARGE 10.0 /* PTRS is valid from here on */
#define HUGE_MEAN 1e12
enum { TRIAL_SHIFT = 48, INVERSION_MOST = 200 }; /* P(k > 200) of a mean of 10 is below 1e-160 */

static double invert(double mean, double u)
{
    double p = exp(-mean);
    int k = 0;
    while (u > p && k < INVERSION_MOST) {
        u -= p;
        p *= mean / ++k;
    }
    return k;
}

/* Transformed rejection with squeeze (Hormann 1993, Insurance: Mathematics and Economics 12, 39), algorithm
 * PTRS: its constants. */
static double transformed_rejection(double mean, uint64_t seed, uint64_t stream, uint64_t number)
{
    double b = 0.931 + 2.53 * sqrt(mean), a = -0.059 + 0.02483 * b;
    double inverse_alpha = 1.1239 + 1.1328 / (b - 3.4), squeeze = 0.9277 - 3.6224 / (b - 2.0);
    for (uint64_t trial = 0;; trial++) {
        double both[2];
        int sign;
        rx_random_two(seed, stream, number + (trial << TRIAL_SHIFT), both);
        double u = both[0] - 0.5, v = both[1], us = 0.5 - fabs(u);
        double k = floor((2.0 * a / us + b) * u + mean + 0.43);
        if (us >= 0.07 && v <= squeeze)
            return k;
        if (k < 0.0 || (us < 0.013 && v > us))
            continue;
        if (log(v * inverse_alpha / (a / (us * us) + b)) <= k * log(mean) - mean - lgamma_r(k + 1.0, &sign))
            return k;
    }
}

double rx_noise_poisson(double mean, uint64_t seed, uint64_t stream, uint64_t number)
{
    if (!(mean > 0.0))
        return 0.0;
    if (mean < LARGE)
        return invert(mean, rx_random_uniform(seed, stream, number));
    if (mean < HUGE_MEAN)
        return transformed_rejection(mean, seed, stream, number);
    return floor(mean + sqrt(mean) * rx_random_normal(seed, stream, number) + 0.5);
}
