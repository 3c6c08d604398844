/* Errors from injected objects. */
#include "check/conformal.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

enum {
    PLENTY = 200, /* cases of a group where there are several, */
    ENOUGH = 60,  /* and of the blended ones, for a group of their own */
    MOST = 8      /* groups of isolated ones, of blended ones */
};
static const double BLENDED = 0.1;
static const double LEVELS[] = {0.682689, 0.95};

typedef struct group {
    double below; /* S/N */
    double factor[RX_CONFORMAL_LEVELS];
} group;

/* Groups by S/N of one kind of places. */
typedef struct place {
    int n;
    group groups[MOST];
} place;

struct rx_conformal {
    long n;
    int split;       /* are blended ones by themselves? */
    place places[2]; /* isolated or all; blended */
};

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
static void fill_group(rx_conformal_case *cases, long n, group *dst)
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

/* As many cases in each group; the last one ends at the brightest. */
static void fill_place(rx_conformal_case *cases, long n, place *dst)
{
    const long groups = n / PLENTY < 1 ? (n > 0) : n / PLENTY > MOST ? MOST : n / PLENTY;
    qsort(cases, (size_t)n, sizeof *cases, by_snr);
    for (long k = 0; k < groups; k++)
        dst->groups[k].below = cases[(k + 1) * n / groups - 1].snr;
    for (long k = 0; k < groups; k++)
        fill_group(cases + k * n / groups, (k + 1) * n / groups - k * n / groups, &dst->groups[k]);
    dst->n = (int)groups;
}

rx_status rx_conformal_new(const rx_conformal_case *cases, long n, rx_conformal **dst, rx_error *err)
{
    rx_conformal *conformal = RX_NEW(rx_conformal, 1);
    rx_conformal_case *own = RX_NEW(rx_conformal_case, (size_t)n);
    if (conformal == NULL || own == NULL) {
        free(conformal);
        free(own);
        return rx_error_memory(err, (size_t)n * sizeof *own);
    }
    /* isolated ones from the front, blended ones from the back */
    long front = 0, back = n;
    for (long i = 0; i < n; i++) {
        const rx_conformal_case *c = &cases[i];
        if (!isfinite(c->snr + c->blend + c->score) || !(c->weight > 0.0))
            continue;
        if (c->blend < BLENDED)
            own[front++] = *c;
        else
            own[--back] = *c;
    }
    conformal->split = front >= ENOUGH && n - back >= ENOUGH;
    if (conformal->split) {
        fill_place(own + back, n - back, &conformal->places[1]);
    } else {
        for (long i = back; i < n; i++)
            own[front++] = own[i];
    }
    fill_place(own, front, &conformal->places[0]);
    conformal->n = conformal->split ? front + n - back : front;
    free(own);
    *dst = conformal;
    return RX_OK;
}

void rx_conformal_free(rx_conformal *conformal)
{
    free(conformal);
}

void rx_conformal_at(const rx_conformal *conformal, double snr, double blend,
                     double factor[RX_CONFORMAL_LEVELS])
{
    const place *p = conformal != NULL ? &conformal->places[conformal->split && blend >= BLENDED] : NULL;
    int k = 0;
    while (p != NULL && k < p->n && !(snr <= p->groups[k].below))
        k++;
    for (int level = 0; level < RX_CONFORMAL_LEVELS; level++)
        factor[level] = p != NULL && k < p->n ? p->groups[k].factor[level] : NAN;
}

long rx_conformal_cases(const rx_conformal *conformal)
{
    return conformal->n;
}

int rx_conformal_groups(const rx_conformal *conformal)
{
    return conformal->places[0].n + conformal->places[1].n;
}
