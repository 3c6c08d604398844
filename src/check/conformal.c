/* Errors from injected objects. */
#include "check/conformal.h"

#include <math.h>
#include <stdlib.h>

#include "quality/statistics.h"

enum {
    PLENTY = 200, /* cases of a group where there are several, */
    ENOUGH = 60   /* and of the blended ones, for a group of their own */
};
static const double BLENDED = 0.1;
static const double LEVELS[] = {0.682689, RX_LEVEL};

static int by_snr(const void *a, const void *b)
{
    const double d = ((const rx_conformal_case *)a)->snr - ((const rx_conformal_case *)b)->snr;
    return (d > 0.0) - (d < 0.0);
}

static int by_score(const void *a, const void *b)
{
    const double d = ((const rx_conformal_case *)a)->score - ((const rx_conformal_case *)b)->score;
    return (d > 0.0) - (d < 0.0);
}

/* Reorders. */
static void fill_group(rx_conformal_case *cases, long n, rx_conformal_group *dst)
{
    double all = 0.0;
    qsort(cases, (size_t)n, sizeof *cases, by_score);
    for (long i = 0; i < n; i++)
        all += cases[i].weight;
    all += all / (double)n;
    for (int level = 0; level < RX_CONFORMAL_LEVELS; level++) {
        double sum = 0.0;
        dst->factor[level] = NAN;
        for (long i = 0; i < n && isnan(dst->factor[level]); i++) {
            sum += cases[i].weight;
            if (sum >= LEVELS[level] * all * (1.0 - 1e-12))
                dst->factor[level] = cases[i].score;
        }
    }
}

/* As many cases in each group; the last one ends at the brightest. Returns how many groups. */
static int fill_place(rx_conformal_case *cases, long n, rx_conformal_group *groups)
{
    const long k = n / PLENTY < 1                     ? (n > 0)
                   : n / PLENTY > RX_CONFORMAL_GROUPS ? RX_CONFORMAL_GROUPS
                                                      : n / PLENTY;
    qsort(cases, (size_t)n, sizeof *cases, by_snr);
    for (long i = 0; i < k; i++) {
        const long from = i * n / k, to = (i + 1) * n / k;
        groups[i].below = cases[to - 1].snr;
        fill_group(cases + from, to - from, &groups[i]);
    }
    return (int)k;
}

void rx_conformal_fit(rx_conformal_case *cases, long n, rx_conformal *dst)
{
    long alone = 0, good = 0; /* isolated ones come first */
    for (long i = 0; i < n; i++) {
        const rx_conformal_case c = cases[i];
        if (!isfinite(c.snr + c.blend + c.score) || !(c.weight > 0.0))
            continue;
        cases[good++] = c.blend < BLENDED ? cases[alone] : c;
        if (c.blend < BLENDED)
            cases[alone++] = c;
    }
    *dst = (rx_conformal){.n = good, .split = alone >= ENOUGH && good - alone >= ENOUGH};
    if (dst->split)
        dst->places[1].n = fill_place(cases + alone, good - alone, dst->places[1].groups);
    dst->places[0].n = fill_place(cases, dst->split ? alone : good, dst->places[0].groups);
}

void rx_conformal_at(const rx_conformal *conformal, double snr, double blend,
                     double factor[RX_CONFORMAL_LEVELS])
{
    const int place = conformal->split && blend >= BLENDED, n = conformal->places[place].n;
    const rx_conformal_group *groups = conformal->places[place].groups;
    int k = 0;
    while (k < n && !(snr <= groups[k].below))
        k++;
    for (int level = 0; level < RX_CONFORMAL_LEVELS; level++)
        factor[level] = k < n ? groups[k].factor[level] : NAN;
}
