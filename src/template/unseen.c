/* Pairs by a grid, sums by prefix sums over sorted fluxes. */
#include "template/unseen.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "num/stats.h"

enum { RINGS = 12, FEWEST = 50, STEPS = 6 };
static const double RING = 0.125; /* FWHM */
static const double SHOWS = 6.0;  /* errors of the noise */
static const double COUNTS = 2.0; /* errors */

/* Crowded sources of the list with a flux above 0. */
typedef struct stars {
    int m;
    int *entry;      /* [m] of the list, by y */
    double *density; /* [m] a pixel, around each */
    double *flux;    /* [m] ascending, */
    double *sums;    /* [m + 1][2] and of the first k of them sum f, sum f^2 */
    double *ratio;   /* room for [m]: errors by what is unseen over those of the noise */
} stars;

static int cell_of(const rx_crowding *crowd, double x, double y)
{
    const int cx = rx_min_int(rx_max_int((int)(x * crowd->nx / crowd->width), 0), crowd->nx - 1);
    const int cy = rx_min_int(rx_max_int((int)(y * crowd->ny / crowd->height), 0), crowd->ny - 1);
    return cy * crowd->nx + cx;
}

/* Crowded sources a pixel in the cells and those around them. */
static void find_densities(const rx_crowding *crowd, const rx_tphot_source *list, int *count, stars *s)
{
    for (int k = 0; k < s->m; k++)
        count[cell_of(crowd, list[s->entry[k]].x, list[s->entry[k]].y)]++;
    const double area = (double)crowd->width / crowd->nx * crowd->height / crowd->ny;
    for (int k = 0; k < s->m; k++) {
        const int own = cell_of(crowd, list[s->entry[k]].x, list[s->entry[k]].y), cx = own % crowd->nx;
        double sum = 0, cells = 0;
        for (int v = rx_max_int(own / crowd->nx - 1, 0); v <= rx_min_int(own / crowd->nx + 1, crowd->ny - 1);
             v++)
            for (int u = rx_max_int(cx - 1, 0); u <= rx_min_int(cx + 1, crowd->nx - 1); u++)
                if (crowd->cells[v * crowd->nx + u]) {
                    sum += count[v * crowd->nx + u];
                    cells++;
                }
        s->density[k] = cells > 0 ? sum / (cells * area) : 0;
    }
}

static rx_status gather(const rx_crowding *crowd, const rx_tphot_source *list, int n, stars *s, rx_error *err)
{
    const size_t cells = (size_t)crowd->nx * (size_t)crowd->ny, room = (size_t)n + 1;
    rx_ranked *lines = RX_NEW(rx_ranked, room);
    int *count = RX_NEW(int, cells);
    s->entry = RX_NEW(int, room);
    s->density = RX_NEW(double, room);
    s->flux = RX_NEW(double, room);
    s->sums = RX_NEW(double, 2 * room);
    s->ratio = RX_NEW(double, room);
    rx_status status = RX_OK;
    if (lines == NULL || count == NULL || s->entry == NULL || s->density == NULL || s->flux == NULL ||
        s->sums == NULL || s->ratio == NULL) {
        status = rx_error_memory(err, room * 7 * sizeof(double));
        goto exit;
    }
    for (int i = 0; i < n; i++)
        if (list[i].crowded && list[i].flux > 0 && isfinite(list[i].flux)) {
            s->flux[s->m] = list[i].flux;
            lines[s->m++] = (rx_ranked){list[i].y, i};
        }
    if (s->m > 0) {
        rx_rank(lines, (size_t)s->m);
        rx_sort(s->flux, (size_t)s->m);
    }
    for (int k = 0; k < s->m; k++) {
        s->entry[k] = lines[k].index;
        s->sums[2 * k + 2] = s->sums[2 * k] + s->flux[k];
        s->sums[2 * k + 3] = s->sums[2 * k + 1] + s->flux[k] * s->flux[k];
    }
    find_densities(crowd, list, count, s);
exit:
    free(lines);
    free(count);
    return status;
}

/* unseen[RINGS]: u(r) 2 pi r dr; 0 where too little is known. Densities become those of found and hidden ones: of a pair that
 * is missing one is hidden. */
static void find_unseen(const rx_tphot_source *list, stars *s, double ring, double *unseen)
{
    double found[RINGS] = {0}, expected = 0, hidden = 0;
    for (int k = 0; k < s->m; k++) {
        const rx_tphot_source *a = &list[s->entry[k]];
        expected += 0.5 * s->density[k];
        for (int l = k + 1; l < s->m && list[s->entry[l]].y < a->y + RINGS * ring; l++) {
            const double dx = (list[s->entry[l]].x - a->x) / ring, dy = (list[s->entry[l]].y - a->y) / ring;
            if (dx * dx + dy * dy < RINGS * RINGS)
                found[(int)sqrt(dx * dx + dy * dy)]++;
        }
    }
    const int known = expected * M_PI * ring * ring * RINGS * RINGS >= FEWEST;
    for (int b = 0; b < RINGS && known; b++)
        hidden += fmax(expected * M_PI * ring * ring * (2 * b + 1) - found[b], 0) / s->m;
    for (int k = 0; k < s->m; k++)
        s->density[k] *= 1 + hidden;
    expected *= (1 + hidden) * (1 + hidden);
    for (int b = 0; b < RINGS; b++) {
        const double area = M_PI * ring * ring * (2 * b + 1);
        unseen[b] = known ? area * fmax(1 - found[b] / (expected * area), 0) : 0;
    }
}

/* How many of the fluxes are below that. */
static int below(const stars *s, double flux)
{
    int first = 0, end = s->m;
    while (first < end) {
        const int middle = first + (end - first) / 2;
        if (s->flux[middle] < flux)
            first = middle + 1;
        else
            end = middle;
    }
    return first;
}

/* What neighbours of that density add to a flux on average, and its variance. */
static void sum_up(const stars *s, const double *unseen, double density, const rx_tphot_source *one,
                   double *mean, double *variance)
{
    double rho[RINGS];
    int hidden[RINGS]; /* so many of the fluxes would not show */
    for (int b = 0; b < RINGS; b++) {
        const double r = RING * (b + 0.5), q = 2 * M_LN2 * r * r; /* s = FWHM / sqrt(8 ln 2) */
        rho[b] = exp(-q);
        const double left = sqrt(1 - rho[b] * rho[b] * (1 + 2 * q));
        hidden[b] = below(s, fmin(one->flux, SHOWS * one->flux / (one->snr * left)));
    }
    *variance = 0;
    for (int step = 0; step < STEPS; step++) {
        const double most = COUNTS * hypot(one->fluxerr, sqrt(*variance));
        *mean = *variance = 0;
        for (int b = 0; b < RINGS; b++) {
            const double share = density * unseen[b] / s->m;
            const int small = rx_min_int(below(s, most / rho[b]), hidden[b]);
            *mean += share * (rho[b] * s->sums[2 * small] + (hidden[b] - small) * most);
            *variance +=
                share * (rho[b] * rho[b] * s->sums[2 * small + 1] + (hidden[b] - small) * most * most);
        }
    }
}

rx_status rx_unseen_allow(const rx_crowding *crowd, double fwhm, rx_tphot_source *list, int n, double *excess,
                          rx_error *err)
{
    stars s = {0};
    double unseen[RINGS];
    int points = 0;
    *excess = 0;
    if (crowd->n == 0)
        return RX_OK;
    rx_status status = gather(crowd, list, n, &s, err);
    if (status == RX_OK)
        find_unseen(list, &s, RING * fwhm, unseen);
    for (int k = 0; k < s.m && status == RX_OK; k++) {
        rx_tphot_source *one = &list[s.entry[k]];
        double variance;
        if (one->kind != RX_TPHOT_POINT || !(one->snr > 0))
            continue;
        sum_up(&s, unseen, s.density[k], one, &one->unseen, &variance);
        one->fluxerr = hypot(one->fluxerr, sqrt(variance));
        s.ratio[points++] = sqrt(variance) * one->snr / one->flux;
    }
    if (points > 0) {
        rx_sort(s.ratio, (size_t)points);
        *excess = s.ratio[points / 2];
    }
    for (int k = 0; k < s.m && status == RX_OK; k++) /* fluxes that others are held to stay until here */
        list[s.entry[k]].flux -= list[s.entry[k]].unseen;
    free(s.entry);
    free(s.density);
    free(s.flux);
    free(s.sums);
    free(s.ratio);
    return status;
}
