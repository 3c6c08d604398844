/* Learning from clear sources. */
#include "template/prior.h"

#include <math.h>

static const double USUAL_RADIUS = 0.6, RADIUS_WIDTH = 1.0; /* FWHM; of its logarithm */
static const double USUAL_NU = 0.5, NU_WIDTH = 0.5;
static const double MOST_ODDS = 30.0;
static const double CLEAR = 15, BRIGHT = 150;              /* S/N */
static const double ALREADY = 5.0;                         /* sources that the start counts as */
static const double SLOPE_WIDTH = 0.3, LEAST_WIDTH = 0.15; /* of the law's slope; of the population */
/* Widths are used that much wider than found: a lognormal law is not what faint galaxies follow, and on
 * simulated ones a prior of just the width found made those of S/N 10 to 20 2 % too faint. */
static const double WIDER = 1.4;
enum { STEPS = 20, LEAST = 20 };

rx_tile_prior rx_tile_prior_start(double fwhm)
{
    return (rx_tile_prior){.star_odds = 1,
                           .radius = {log(USUAL_RADIUS * fwhm), 0, RADIUS_WIDTH},
                           .nu = {log1p(USUAL_NU), 0, NU_WIDTH}};
}

double rx_prior_scaling_mean(const rx_tile_prior *usual, const rx_prior_scaling *law, double flux)
{
    return law->mean + (flux > 0 && law->slope != 0 ? law->slope * (log(flux) - usual->pivot) : 0);
}

double rx_point_probability(double evidence, double penalty)
{
    return 1 / (1 + exp(0.5 * fmin(fmax(evidence - penalty, -80), 80)));
}

rx_likelihood rx_likelihood_of(double value, double variance, double centre, double width)
{
    const double prior = 1 / (width * width), all = 1 / variance, own = all - prior;
    if (!isfinite(value) || !isfinite(all) || !(own > 1e-3 * prior))
        return (rx_likelihood){0, 0};
    return (rx_likelihood){(value * all - centre * prior) / own, own};
}

int rx_prior_is_clear(double snr)
{
    return snr > CLEAR && snr < BRIGHT;
}

/* One step for one law: what each source is under it, and the law of these. */
static void learn_law(const rx_prior_sample *cases, int n, double penalty, const rx_tile_prior *usual,
                      int of_nu, const rx_prior_scaling *start, rx_prior_scaling *law)
{
    const double prior = 1 / (law->width * law->width), sloped = of_nu ? 0 : 1;
    const double stiff = pow(start->width / SLOPE_WIDTH, 2);
    double w1 = ALREADY, wu = 0, wuu = stiff, wy = ALREADY * start->mean, wuy = 0;
    for (int i = 0; i < n; i++) {
        const rx_likelihood *word = of_nu ? &cases[i].nu : &cases[i].radius;
        if (!rx_prior_is_clear(cases[i].snr) || !(word->precision > 0))
            continue;
        const double w = 1 - rx_point_probability(cases[i].evidence, penalty);
        const double u = sloped * (log(cases[i].flux) - usual->pivot);
        const double centre = law->mean + law->slope * u;
        const double y = (word->precision * word->mean + prior * centre) / (word->precision + prior);
        w1 += w;
        wu += w * u;
        wuu += w * u * u;
        wy += w * y;
        wuy += w * u * y;
    }
    const double det = w1 * wuu - wu * wu;
    rx_prior_scaling next = {(wuu * wy - wu * wuy) / det, sloped * (w1 * wuy - wu * wy) / det, 0};
    double square = ALREADY * start->width * start->width;
    for (int i = 0; i < n; i++) {
        const rx_likelihood *word = of_nu ? &cases[i].nu : &cases[i].radius;
        if (!rx_prior_is_clear(cases[i].snr) || !(word->precision > 0))
            continue;
        const double w = 1 - rx_point_probability(cases[i].evidence, penalty);
        const double u = sloped * (log(cases[i].flux) - usual->pivot);
        const double centre = law->mean + law->slope * u;
        const double y = (word->precision * word->mean + prior * centre) / (word->precision + prior);
        const double off = y - next.mean - next.slope * u;
        square += w * (1 / (word->precision + prior) + off * off);
    }
    next.width = fmax(sqrt(square / w1), LEAST_WIDTH);
    *law = next;
}

static double learn_odds(const rx_prior_sample *cases, int n, double penalty)
{
    double points = 1, others = 1;
    for (int i = 0; i < n; i++) {
        if (!rx_prior_is_clear(cases[i].snr))
            continue;
        const double star = rx_point_probability(cases[i].evidence, penalty);
        points += star;
        others += 1 - star;
    }
    /* no field is so pure */
    return fmin(fmax(points / others, 1 / MOST_ODDS), MOST_ODDS);
}

void rx_tile_prior_fit(const rx_prior_sample *cases, int n, double star_penalty, double fwhm,
                       rx_tile_prior *usual)
{
    const rx_tile_prior start = rx_tile_prior_start(fwhm);
    double sum = 0;
    int clear = 0;
    for (int i = 0; i < n; i++)
        if (rx_prior_is_clear(cases[i].snr)) {
            clear++;
            sum += log(cases[i].flux);
        }
    if (clear < LEAST)
        return;
    usual->pivot = sum / clear;
    usual->radius = start.radius;
    usual->nu = start.nu;
    for (int step = 0; step < STEPS; step++) {
        const double penalty = star_penalty + 2 * log(usual->star_odds);
        learn_law(cases, n, penalty, usual, 0, &start.radius, &usual->radius);
        learn_law(cases, n, penalty, usual, 1, &start.nu, &usual->nu);
        usual->star_odds = learn_odds(cases, n, penalty);
    }
    usual->radius.width *= WIDER;
}
