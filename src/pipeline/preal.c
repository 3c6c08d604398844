/* How probable it is that a source is there. */
#include "pipeline/preal.h"

#include <math.h>

static const double LEAST = 2.5;           /* sigmas */
static const double BRIGHT = 6.0;          /* of noise none is found above, */
static const double PRIOR = 1.0;           /* but no sky is without sources: that many more */
static const double NEAR = 4.5, FAR = 7.0; /* sigmas: whether counts go on; most peaks of noise are below */
static const double PIVOT = 25.0;          /* evidence at which the slope changes nothing */
static const double SHIFT_SIGMA = 1.0, SLOPE_SIGMA = 0.5;
static const double LEAST_SLOPE = -0.25; /* P rises from LEAST on */

rx_preal rx_preal_default(const double *evidence, int n, double pixels, double fwhm)
{
    const double w = fmax(fwhm, 1.0) / 2.3548;
    rx_preal preal = {.bright = PRIOR, .peaks = 1.0 / (pow(2.0 * acos(-1.0), 1.5) * 2.0 * w * w)};
    for (int i = 0; i < n; i++)
        preal.bright += evidence[i] > BRIGHT * BRIGHT;
    preal.bright /= fmax(pixels, 1.0);
    return preal;
}

void rx_preal_complete(rx_preal *preal, const double *evidence, int n, double pixels)
{
    const double noise =
        preal->peaks * (NEAR * exp(-0.5 * NEAR * NEAR) - FAR * exp(-0.5 * FAR * FAR)) * pixels;
    double found = 0.0;
    for (int i = 0; i < n; i++)
        found += evidence[i] > NEAR * NEAR && evidence[i] < FAR * FAR;
    const double law = BRIGHT * (1.0 / NEAR - 1.0 / FAR); /* share of those above BRIGHT */
    preal->bright = fmin(preal->bright, (PRIOR + fmax(found - noise, 0.0) / law) / fmax(pixels, 1.0));
}

double rx_preal_of(const rx_preal *preal, double evidence)
{
    if (!(evidence > 0.0))
        return isnan(evidence) ? NAN : 0.0;
    /* ln(R / F); below LEAST F is that of the noise at a given place, no longer of its peaks. */
    const double e = fmin(fmax(evidence, LEAST * LEAST), 1e6);
    const double log_odds = log(preal->bright * BRIGHT / (preal->peaks * e * (e - 1.0))) + 0.5 * e +
                            preal->shift + 0.5 * preal->slope * (e - PIVOT) +
                            0.5 * fmin(evidence - LEAST * LEAST, 0.0);
    return 1.0 / (1.0 + exp(-log_odds));
}

int rx_preal_doubtful(const rx_preal *preal, double evidence)
{
    return rx_preal_of(preal, evidence) < 0.5;
}

double rx_preal_limit(const rx_preal *preal)
{
    double low = 0.0, high = 100.0;
    for (int i = 0; i < 40; i++) {
        const double s = 0.5 * (low + high);
        if (rx_preal_doubtful(preal, s * s))
            low = s;
        else
            high = s;
    }
    return high;
}

int rx_preal_owes(double evidence, double snr)
{
    return snr > 0.0 && evidence < 0.5 * snr * snr;
}

/* What a sample adds to ln likelihood, its gradient and the Fisher information. */
static void add_sample(const rx_preal *preal, const rx_preal_sample *sample, double ratio, int is_noise,
                       double sums[6])
{
    for (int i = 0; i < sample->n; i++) {
        if (!isfinite(sample->evidence[i]))
            continue;
        const double p = rx_preal_of(preal, sample->evidence[i]),
                     by = 0.5 * (fmin(fmax(sample->evidence[i], LEAST * LEAST), 1e6) - PIVOT);
        const double false_share = fmax(1.0 - p, 1e-300),
                     noise = ratio * false_share / (1.0 + ratio * false_share);
        const double slope = (noise - is_noise) * p, weight = p * p * noise * (1.0 - noise);
        sums[0] += is_noise ? log(fmax(noise, 1e-300)) : log1p(-noise);
        sums[1] += slope;
        sums[2] += slope * by;
        sums[3] += weight;
        sums[4] += weight * by;
        sums[5] += weight * by * by;
    }
}

/* The same of both and the prior. */
static void add_up(const rx_preal *preal, const rx_preal_sample *tile, const rx_preal_sample *noise,
                   double sums[6])
{
    const double shift = preal->shift / SHIFT_SIGMA, slope = preal->slope / SLOPE_SIGMA,
                 ratio = noise->pixels / tile->pixels;
    for (int i = 0; i < 6; i++)
        sums[i] = 0.0;
    add_sample(preal, tile, ratio, 0, sums);
    add_sample(preal, noise, ratio, 1, sums);
    sums[0] -= 0.5 * (shift * shift + slope * slope);
    sums[1] -= shift / SHIFT_SIGMA;
    sums[2] -= slope / SLOPE_SIGMA;
    sums[3] += 1.0 / (SHIFT_SIGMA * SHIFT_SIGMA);
    sums[5] += 1.0 / (SLOPE_SIGMA * SLOPE_SIGMA);
}

void rx_preal_fit(rx_preal *preal, const rx_preal_sample *tile, const rx_preal_sample *noise)
{
    enum { STEPS = 100 };
    double now[6], next[6];
    if (!(tile->pixels > 0.0) || !(noise->pixels > 0.0))
        return;
    preal->tile = 1;
    preal->shift = preal->slope = 0.0;
    add_up(preal, tile, noise, now);
    for (int step = 0; step < STEPS; step++) { /* Fisher's scoring, halved until it leads up */
        const double det = now[3] * now[5] - now[4] * now[4];
        double dshift = (now[5] * now[1] - now[4] * now[2]) / det,
               dslope = (now[3] * now[2] - now[4] * now[1]) / det;
        if (preal->slope <= LEAST_SLOPE && dslope < 0.0) { /* at its bound: the shift alone */
            dshift = now[1] / now[3];
            dslope = 0.0;
        }
        rx_preal there;
        int halvings = 0;
        do {
            there = *preal;
            there.shift += dshift;
            there.slope = fmax(there.slope + dslope, LEAST_SLOPE);
            add_up(&there, tile, noise, next);
            dshift *= 0.5;
            dslope *= 0.5;
        } while (!(next[0] >= now[0]) && ++halvings < 30);
        if (!(next[0] > now[0] + 1e-10))
            return;
        *preal = there;
        for (int i = 0; i < 6; i++)
            now[i] = next[i];
    }
}
