/* Learning from the sources of a tile. */
#include "template/prior.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

static const double USUAL_RADIUS = 0.6, RADIUS_WIDTH = 1.0; /* FWHM; of its logarithm */
static const double USUAL_NU = 0.5, NU_WIDTH = 0.5;
static const double CLEAR = 15, BRIGHT = 150; /* S/N */
static const double ALREADY = 5.0;            /* sources that the start counts as */
/* Counts of galaxies rise by 0.4 dex a magnitude and those of stars by 0.2 in the mean: 0.2 dex a magnitude are 0.5 of ln odds a unit
 * of ln flux, and stars' counts from 0 to as steep as galaxies' are half of it to either side. */
static const double ODDS_SLOPE = 0.5, ODDS_SLOPE_WIDTH = 0.5;
/* Of radii: -0.11 dex a magnitude, scatter 0.45 in ln r, in SDSS and COSMOS alike (simulate/scene.h). */
static const double SIZE_SLOPE = 0.275, SIZE_SLOPE_WIDTH = 0.1, SCATTER = 0.45;
enum { STEPS = 30, LEAST = 20 };

rx_tile_prior rx_tile_prior_start(double fwhm)
{
    return (rx_tile_prior){.radius = {log(USUAL_RADIUS * fwhm), 0, RADIUS_WIDTH},
                           .nu = {log1p(USUAL_NU), 0, NU_WIDTH}};
}

double rx_prior_scaling_mean(const rx_tile_prior *tile_prior, const rx_prior_scaling *law, double flux)
{
    return law->mean + (flux > 0 && law->slope != 0 ? law->slope * (log(flux) - tile_prior->pivot) : 0);
}

double rx_prior_log_odds(const rx_tile_prior *tile_prior, double flux, double evidence)
{
    return tile_prior->odds[0] + (flux > 0 ? tile_prior->odds[1] * (log(flux) - tile_prior->pivot) : 0) -
           0.5 * evidence;
}

double rx_prior_point(const rx_tile_prior *tile_prior, double flux, double evidence)
{
    return 1 / (1 + exp(fmin(fmax(-rx_prior_log_odds(tile_prior, flux, evidence), -40), 40)));
}

rx_likelihood rx_likelihood_of(double value, double variance, double centre, double width)
{
    const double prior = 1 / (width * width), all = 1 / variance, own = all - prior;
    if (!isfinite(value) || !isfinite(all) || !(own > 1e-3 * prior))
        return (rx_likelihood){0, 0};
    return (rx_likelihood){(value * all - centre * prior) / own, own};
}

double rx_prior_agreement(const rx_tile_prior *tile_prior, const rx_likelihood *radius, double flux)
{
    if (!(radius->precision > 0))
        return 0;
    const double variance = tile_prior->radius.width * tile_prior->radius.width + 1 / radius->precision;
    const double off = radius->mean - rx_prior_scaling_mean(tile_prior, &tile_prior->radius, flux);
    return -off * off / variance - log(variance);
}

int rx_prior_is_clear(double snr)
{
    return snr > CLEAR && snr < BRIGHT;
}

/* Among brighter ones are other kinds: saturated stars, galaxies with arms. */
static int counts(const rx_prior_sample *one)
{
    return !isnan(one->evidence) && one->snr > 0 && one->snr < BRIGHT && one->flux > 0;
}

/* Under that prior. No law of radii makes a galaxy of what none describes better than a point. */
static double is_point(const rx_prior_sample *one, const rx_tile_prior *tile_prior)
{
    const double now =
        one->evidence - one->agreement + rx_prior_agreement(tile_prior, &one->radius, one->flux);
    return rx_prior_point(tile_prior, one->flux, fmin(now, fmax(one->evidence, 0)));
}

/* One step for one law: what each source is under it, and the law of these. */
static void learn_law(const rx_prior_sample *cases, const double *star, int n,
                      const rx_tile_prior *tile_prior, int of_nu, const rx_prior_scaling *start,
                      rx_prior_scaling *law)
{
    const double square = law->width * law->width, sloped = of_nu ? 0 : 1;
    double w1 = ALREADY / square, wu = 0, wuu = 1 / (SIZE_SLOPE_WIDTH * SIZE_SLOPE_WIDTH),
           wy = w1 * start->mean, wuy = sloped * SIZE_SLOPE * wuu;
    for (int i = 0; i < n; i++) {
        const rx_likelihood *word = of_nu ? &cases[i].nu : &cases[i].radius;
        if (!counts(&cases[i]) || !(word->precision > 0))
            continue;
        const double w = (1 - star[i]) / (square + 1 / word->precision);
        const double u = sloped * (log(cases[i].flux) - tile_prior->pivot);
        w1 += w;
        wu += w * u;
        wuu += w * u * u;
        wy += w * word->mean;
        wuy += w * u * word->mean;
    }
    const double det = w1 * wuu - wu * wu;
    law->mean = (wuu * wy - wu * wuy) / det;
    law->slope = sloped * (w1 * wuy - wu * wy) / det;
    double all = ALREADY, sum = ALREADY * SCATTER * SCATTER;
    for (int i = 0; i < n; i++) {
        const rx_likelihood *word = of_nu ? &cases[i].nu : &cases[i].radius;
        if (!counts(&cases[i]) || !(word->precision > 0))
            continue;
        const double u = sloped * (log(cases[i].flux) - tile_prior->pivot);
        const double share = square / (square + 1 / word->precision);
        const double off = share * (word->mean - law->mean - law->slope * u);
        sum += (1 - star[i]) * (share / word->precision + off * off);
        all += 1 - star[i];
    }
    law->width = sqrt(sum / all);
}

/* A step of Fisher's scoring, by one at most: far from the maximum the information is next to nothing. */
static void learn_odds(const rx_prior_sample *cases, const double *star, int n, rx_tile_prior *tile_prior)
{
    double *odds = tile_prior->odds, half = 1 / (1 + exp(-odds[0]));
    double g0 = 1 - 2 * half, g1 = (ODDS_SLOPE - odds[1]) / (ODDS_SLOPE_WIDTH * ODDS_SLOPE_WIDTH);
    double h00 = 2 * half * (1 - half), h01 = 0, h11 = 1 / (ODDS_SLOPE_WIDTH * ODDS_SLOPE_WIDTH);
    for (int i = 0; i < n; i++) {
        if (!counts(&cases[i]))
            continue;
        const double u = log(cases[i].flux) - tile_prior->pivot, p = 1 / (1 + exp(-odds[0] - odds[1] * u));
        const double rest = star[i] - p, w = p * (1 - p);
        g0 += rest;
        g1 += rest * u;
        h00 += w;
        h01 += w * u;
        h11 += w * u * u;
    }
    const double det = h00 * h11 - h01 * h01;
    const double by[2] = {(h11 * g0 - h01 * g1) / det, (h00 * g1 - h01 * g0) / det};
    const double scale = 1 / fmax(fmax(fabs(by[0]), fabs(by[1])), 1);
    odds[0] += scale * by[0];
    odds[1] += scale * by[1];
}

rx_status rx_tile_prior_fit(const rx_prior_sample *cases, int n, double fwhm, rx_tile_prior *tile_prior,
                            rx_error *err)
{
    const rx_tile_prior start = rx_tile_prior_start(fwhm);
    double sum = 0, *star;
    int clear = 0;
    for (int i = 0; i < n; i++)
        if (rx_prior_is_clear(cases[i].snr)) {
            clear++;
            sum += log(cases[i].flux);
        }
    if (clear < LEAST)
        return RX_OK;
    RX_TRY(RX_MAKE(star, (size_t)n, err));
    tile_prior->odds[0] += tile_prior->odds[1] * (sum / clear - tile_prior->pivot);
    tile_prior->radius.mean += tile_prior->radius.slope * (sum / clear - tile_prior->pivot);
    tile_prior->pivot = sum / clear;
    for (int step = 0; step < STEPS; step++) {
        for (int i = 0; i < n; i++)
            star[i] = is_point(&cases[i], tile_prior);
        learn_law(cases, star, n, tile_prior, 0, &start.radius, &tile_prior->radius);
        learn_law(cases, star, n, tile_prior, 1, &start.nu, &tile_prior->nu);
        learn_odds(cases, star, n, tile_prior);
    }
    free(star);
    return RX_OK;
}
