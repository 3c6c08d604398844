/* How probable it is that a source is there. */
#include "fit/preal.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "num/stats.h"

static const double LEAST = 2.5;  /* sigmas */
static const double BRIGHT = 6.0; /* of noise none is found above, */
static const double PRIOR = 1.0;  /* but no sky is without sources: that many more */
static const double LAW = -2.0, LAW_WIDTH = 2.0, LEAST_LAW = -3.5; /* of real ones; P rises from LEAST on */
static const double SCALE_SIGMA = 0.2, LEAST_SCALE = 0.1;          /* of peaks of noise in a crowd */
/* Sigmas in a crowd: 0.2 above the least S/N of what is added, where most of that is held, to where none is noise. */
static const double NEAR = 3.4, FAR = 7.0;
enum { BINS = 72 };
/* True S/N at which the counts of a crowd may end, 14 of them; that they do not, the first case, is as probable as all these. */
static const double FIRST_END = 2.0, NEXT_END = 0.25;
enum { ENDS = 15 };
static const double CONFIDENCE = 0.95,
                    SURE = 1.645; /* sigmas that as much of a normal distribution lies below */
/* Of ln(R / F) of a tile at 4 sigma: SCALE_SIGMA, and as much by counts from 6 sigma on that go on by a power of half more or less. */
static const double ODDS_SIGMA = 0.3;
static const double PIVOT = 25.0; /* evidence that powers refer to */

/* Of sources brighter than `end`, whose S/N errors of 1 blur. */
static double share_above(double s, double end)
{
    return 0.5 * erfc((end - s) * M_SQRT1_2);
}

rx_preal rx_preal_default(const double *evidence, int n, double pixels, double fwhm)
{
    const double w = fmax(fwhm, 1.0) / 2.3548;
    rx_preal preal = {
        .power = LAW, .end = -HUGE_VAL, .peaks = 1.0 / (pow(2.0 * acos(-1.0), 1.5) * 2.0 * w * w)};
    int bright = 0;
    for (int i = 0; i < n; i++)
        bright += evidence[i] > BRIGHT * BRIGHT;
    preal.real = (PRIOR + bright) * BRIGHT / (PIVOT * fmax(pixels, 1.0));
    return preal;
}

/* Counts by s, and what is expected of them under ln scale, ln real and power: ln likelihood with priors, its gradient, and the Fisher
 * information, upper triangle by rows. */
typedef struct crowd_counts {
    double found[BINS], noise[BINS]; /* noise: peaks at a scale of 1 */
    double above[BINS];              /* share of real ones that the end of the counts leaves */
    double scale;                    /* ln of what is expected */
    double
        amount; /* of real ones, as those above 6 sigma have it: exp(ln real), with the weight of PRIOR sources */
} crowd_counts;

static void add_counts(const crowd_counts *c, const double law[3], double sums[10])
{
    const double off = (law[0] - c->scale) / SCALE_SIGMA, steep = (law[2] - LAW) / LAW_WIDTH,
                 step = (FAR - NEAR) / BINS;
    for (int k = 0; k < 10; k++)
        sums[k] = 0;
    for (int i = 0; i < BINS; i++) {
        const double u = log((NEAR + (i + 0.5) * step) / sqrt(PIVOT));
        const double noise = exp(law[0]) * c->noise[i], real = exp(law[1] + law[2] * u) * c->above[i] * step;
        const double all = noise + real, by[3] = {noise, real, real * u}, rest = c->found[i] / all - 1;
        sums[0] += c->found[i] * log(all) - all;
        for (int j = 0, at = 4; j < 3; j++) {
            sums[1 + j] += rest * by[j];
            for (int k = j; k < 3; k++)
                sums[at++] += by[j] * by[k] / all;
        }
    }
    const double more = exp(law[1]) / c->amount;
    sums[0] += PRIOR * (law[1] - more) - 0.5 * (off * off + steep * steep);
    sums[2] += PRIOR * (1 - more);
    sums[7] += PRIOR * more;
    sums[1] -= off / SCALE_SIGMA;
    sums[3] -= steep / LAW_WIDTH;
    sums[4] += 1 / (SCALE_SIGMA * SCALE_SIGMA);
    sums[9] += 1 / (LAW_WIDTH * LAW_WIDTH);
}

/* by = information^-1 gradient. */
static void scoring_step(const double sums[10], double by[3])
{
    const double a = sums[4], b = sums[5], c = sums[6], d = sums[7], e = sums[8], f = sums[9];
    const double inverse[6] = {d * f - e * e, c * e - b * f, b * e - c * d,
                               a * f - c * c, b * c - a * e, a * d - b * b};
    const double det = a * inverse[0] + b * inverse[1] + c * inverse[2], *g = sums + 1;
    by[0] = (inverse[0] * g[0] + inverse[1] * g[1] + inverse[2] * g[2]) / det;
    by[1] = (inverse[1] * g[0] + inverse[3] * g[1] + inverse[4] * g[2]) / det;
    by[2] = (inverse[2] * g[0] + inverse[4] * g[1] + inverse[5] * g[2]) / det;
}

/* The maximum from `law` on; its ln. */
static double climb(const crowd_counts *c, double law[3])
{
    enum { STEPS = 100 };
    double now[10], next[10], by[3], there[3];
    add_counts(c, law, now);
    for (int k = 0; k < STEPS; k++) { /* Fisher's scoring, halved until it leads up */
        int halvings = 0;
        scoring_step(now, by);
        do {
            for (int j = 0; j < 3; j++) {
                there[j] = law[j] + by[j];
                by[j] *= 0.5;
            }
            there[2] = fmax(there[2], LEAST_LAW);
            add_counts(c, there, next);
        } while (!(next[0] >= now[0]) && ++halvings < 30);
        if (!(next[0] > now[0] + 1e-10))
            break;
        for (int j = 0; j < 3; j++)
            law[j] = there[j];
        for (int j = 0; j < 10; j++)
            now[j] = next[j];
    }
    return now[0];
}

rx_preal rx_preal_crowd(const double *evidence, int n, double pixels, double fwhm)
{
    const double w = fmax(fwhm, 1.0) / 2.3548, step = (FAR - NEAR) / BINS;
    rx_preal preal = rx_preal_default(evidence, n, pixels, fwhm);
    crowd_counts c = {.scale = log(fmax(1 - 12 * acos(-1.0) * w * w * n / fmax(pixels, 1.0), LEAST_SCALE)),
                      .amount = preal.real * fmax(pixels, 1.0)};
    double all = PRIOR, most = -HUGE_VAL, best[3] = {0};
    for (int i = 0; i < BINS; i++) {
        const double s = NEAR + (i + 0.5) * step;
        c.noise[i] = preal.peaks * (s * s - 1) * exp(-0.5 * s * s) * step * pixels;
    }
    for (int i = 0; i < n; i++)
        if (evidence[i] >= NEAR * NEAR && evidence[i] < FAR * FAR) {
            const int bin = (int)((sqrt(evidence[i]) - NEAR) / step);
            c.found[bin < BINS ? bin : BINS - 1]++;
            all++;
        }
    for (int k = 0; k < ENDS; k++) {
        const double end = FIRST_END + k * NEXT_END;
        double law[3] = {c.scale, log(all / (FAR - NEAR)), LAW};
        for (int i = 0; i < BINS; i++)
            c.above[i] = k > 0 ? share_above(NEAR + (i + 0.5) * step, end) : 1;
        const double ln = climb(&c, law) - (k > 0 ? log(ENDS - 1) : 0);
        if (ln > most) {
            most = ln;
            memcpy(best, law, sizeof best);
            preal.end = k > 0 ? end : -HUGE_VAL;
        }
    }
    preal.peaks *= exp(best[0]);
    preal.real = exp(best[1]) / fmax(pixels, 1.0);
    preal.power = best[2];
    return preal;
}

double rx_preal_of(const rx_preal *preal, double evidence)
{
    if (!(evidence > 0.0))
        return isnan(evidence) ? NAN : 0.0;
    /* ln(R / F); below LEAST F is that of the noise at a given place, no longer of its peaks. */
    const double e = fmin(fmax(evidence, LEAST * LEAST), 1e6);
    const double log_odds = log(preal->real / (preal->peaks * (e - 1.0))) +
                            0.5 * preal->power * log(e / PIVOT) + log(share_above(sqrt(e), preal->end)) +
                            0.5 * e + 0.5 * fmin(evidence - LEAST * LEAST, 0.0);
    return 1.0 / (1.0 + exp(-log_odds));
}

double rx_preal_limit(const rx_preal *preal)
{
    double low = 0.0, high = 100.0;
    for (int i = 0; i < 40; i++) {
        const double s = 0.5 * (low + high);
        if (rx_preal_of(preal, s * s) < 0.5)
            low = s;
        else
            high = s;
    }
    return high;
}

/* Probabilities that so many of a list are not there, `of` them from `low` to `high`; others are below DBL_EPSILON, of which a million make no difference. */
typedef struct misses {
    double *of;
    int low, high;
} misses;

/* One more, that is not there with probability q; of those above `most` nothing has to be known. */
static void add_one(misses *m, int most, double q)
{
    if (q < DBL_EPSILON)
        return;
    if (m->high < most)
        m->of[++m->high] = 0.0;
    for (int k = m->high; k > m->low; k--)
        m->of[k] = m->of[k] * (1.0 - q) + m->of[k - 1] * q;
    m->of[m->low] *= 1.0 - q;
    while (m->low < m->high && m->of[m->low] < DBL_EPSILON)
        m->of[m->low++] = 0.0;
    while (m->high > m->low && m->of[m->high] < DBL_EPSILON)
        m->high--;
}

rx_status rx_preal_least(const double *preal, int n, double precision, double *least, rx_error *err)
{
    rx_status status = RX_OK;
    int known = 0;
    misses found = {.of = RX_NEW(double, (size_t)n + 1)};
    rx_ranked *ranked = RX_NEW(rx_ranked, (size_t)n);
    *least = HUGE_VAL;
    if (found.of == NULL || ranked == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)n * (sizeof *found.of + sizeof *ranked)));
    for (int i = 0; i < n; i++)
        if (preal[i] >= 0.5)
            ranked[known++] = (rx_ranked){preal[i], i};
    rx_rank_falling(ranked, (size_t)known);
    found.of[0] = 1.0;
    for (int i = 0; i < known; i++) {
        const double p = ranked[i].value, odds = (1.0 - p) * exp(SURE * ODDS_SIGMA);
        const int room = (int)((1.0 - precision) * (i + 1) + 1e-9);
        double sum = 0.0;
        add_one(&found, rx_min_int(i, (int)((1.0 - precision) * known)) + 1, odds / (p + odds));
        for (int k = found.low; k <= rx_min_int(room, found.high); k++)
            sum += found.of[k];
        if (sum >= CONFIDENCE)
            *least = p;
    }
exit:
    free(found.of);
    free(ranked);
    return status;
}
