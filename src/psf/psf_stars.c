#include "psf/psf_stars.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"

/* Half-width of the stellar locus in ln(radius): never narrower than this. */
static const double locus_floor = 0.10;

typedef struct view {
    const rx_psf_params *par;
    const rx_tile *tile;
    const rx_background *background;
    const rx_sources *sources;
    int radius_index; /* of the half-light radius in flux_radius */
} view;

static double sky_level(const view *v, size_t at)
{
    return v->background != NULL ? (double)v->background->level[at] : 0.0;
}

/* No masked pixel, no plateau at the saturation level, and light around the peak: a hot pixel or the hit
 * of a particle is narrower than any PSF. */
static int clean_core(const view *v, const rx_source *s, double radius)
{
    const rx_tile *t = v->tile;
    int cx = (int)lround(s->x), cy = (int)lround(s->y), reach = (int)ceil(fmax(2.0 * radius, 3.0));
    if (cx - reach < 0 || cy - reach < 0 || cx + reach >= t->width || cy + reach >= t->height)
        return 0;
    int px = cx, py = cy;
    for (int y = cy - reach; y <= cy + reach; y++)
        for (int x = cx - reach; x <= cx + reach; x++) {
            size_t at = (size_t)y * (size_t)t->width + (size_t)x;
            if (t->mask[at] != 0 || (double)t->pixels[at] >= 0.9 * t->saturation)
                return 0;
            if (abs(x - cx) <= 1 && abs(y - cy) <= 1 &&
                t->pixels[at] > t->pixels[(size_t)py * (size_t)t->width + (size_t)px]) {
                px = x;
                py = y;
            }
        }
    double ring = 0.0, centre = 0.0;
    for (int y = py - 1; y <= py + 1; y++)
        for (int x = px - 1; x <= px + 1; x++) {
            size_t at = (size_t)y * (size_t)t->width + (size_t)x;
            double value = (double)t->pixels[at] - sky_level(v, at);
            *(x == px && y == py ? &centre : &ring) += value;
        }
    return centre > 0.0 && ring > 0.7 * centre;
}

/* level 0: FLAGS 0; level 1: neighbours and blends too. */
static int usable(const view *v, const rx_source *s, int level, rx_star *star)
{
    int allowed = level > 0 ? RX_FLAG_CROWDED | RX_FLAG_MERGED : 0;
    star->radius = s->flux_radius[v->radius_index];
    star->snr = s->fluxerr_auto > 0.0 ? s->flux_auto / s->fluxerr_auto : 0.0;
    if ((s->flags & ~allowed) != 0 || !(star->snr >= v->par->min_snr))
        return 0;
    if (!(star->radius > 0.4 && star->radius < 0.1 * v->tile->width) || !(s->b > 0.5 * s->a))
        return 0;
    return clean_core(v, s, star->radius);
}

static int by_peak(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return (x[0] < y[0]) - (x[0] > y[0]);
}

/* The locus: the densest ln(radius) among the candidates of highest peak (stars are the most concentrated
 * sources); of two nearly equal ones the narrower, as galaxies are wider than stars. Returns the radius. */
static rx_status find_locus(const view *v, const rx_star *stars, int n, double *radius, rx_error *err)
{
    const double width = 0.05;
    int m = n / 2 > 30 ? n / 2 : n < 30 ? n : 30;
    double(*sorted)[2] = rx_alloc((size_t)n, sizeof *sorted), *density = RX_NEW(double, n), highest = 0.0;
    *radius = 0.0;
    if (sorted == NULL || density == NULL) {
        free(sorted);
        free(density);
        return rx_error_memory(err, 0);
    }
    for (int i = 0; i < n; i++) {
        sorted[i][0] = v->sources->list[stars[i].source].peak;
        sorted[i][1] = log(stars[i].radius);
    }
    qsort(sorted, (size_t)n, sizeof *sorted, by_peak);
    for (int i = 0; i < m; i++) {
        for (int j = 0; j < m; j++) {
            double d = (sorted[i][1] - sorted[j][1]) / width;
            density[i] += exp(-0.5 * d * d);
        }
        highest = fmax(highest, density[i]);
    }
    double best = HUGE_VAL;
    for (int i = 0; i < m; i++)
        if (density[i] >= 0.7 * highest && sorted[i][1] < best)
            best = sorted[i][1];
    /* from the foot of the narrowest dense group up to its top */
    double top = 0.0, at = best;
    for (int i = 0; i < m; i++)
        if (fabs(sorted[i][1] - best) < 2.0 * width && density[i] > top) {
            top = density[i];
            at = sorted[i][1];
        }
    if (m > 0)
        *radius = exp(at);
    free(sorted);
    free(density);
    return RX_OK;
}

/* Keep those within the locus; its centre and width are measured again from what is inside. */
static rx_status keep_locus(rx_star *stars, int *n, double *radius, rx_error *err)
{
    double centre = log(*radius), half = 2.0 * locus_floor, *inside = RX_NEW(double, *n);
    if (inside == NULL)
        return rx_error_memory(err, 0);
    for (int round = 0; round < 5; round++) {
        size_t m = 0;
        for (int i = 0; i < *n; i++)
            if (fabs(log(stars[i].radius) - centre) < half)
                inside[m++] = log(stars[i].radius);
        if (m == 0)
            break;
        double sigma = rx_sigma_mad(inside, m, &centre);
        half = fmin(fmax(3.0 * sigma, locus_floor), 2.0 * locus_floor);
    }
    free(inside);
    int kept = 0;
    for (int i = 0; i < *n; i++)
        if (fabs(log(stars[i].radius) - centre) < half)
            stars[kept++] = stars[i];
    *n = kept;
    *radius = exp(centre);
    return RX_OK;
}

/* Light of neighbours that reaches into the star, as a share of its own: their wings fall like a cube. */
static double contamination(const rx_sources *sources, int index, double fwhm)
{
    const rx_source *s = &sources->list[index];
    double worst = 0.0;
    for (int j = 0; j < sources->n; j++) {
        const rx_source *other = &sources->list[j];
        double dx = other->x - s->x, dy = other->y - s->y, d2 = (dx * dx + dy * dy) / (fwhm * fwhm);
        if (j == index || d2 > 64.0 || !(other->flux_auto > 0.0))
            continue;
        worst = fmax(worst, other->flux_auto / s->flux_auto / fmax(d2 * sqrt(d2), 1e-3));
    }
    return worst;
}

static int by_snr(const void *a, const void *b)
{
    const rx_star *x = a, *y = b;
    if (x->snr != y->snr)
        return x->snr < y->snr ? 1 : -1;
    return (x->source > y->source) - (x->source < y->source);
}

static void keep_isolated(const rx_sources *sources, int level, rx_star_list *dst)
{
    int kept = 0;
    double limit = level > 0 ? 0.2 : 0.03;
    for (int i = 0; i < dst->n && kept < RX_STARS_MAX; i++)
        if (contamination(sources, dst->list[i].source, 2.0 * dst->radius) < limit)
            dst->list[kept++] = dst->list[i];
    dst->n = kept;
}

static rx_status select_level(const view *v, int level, rx_star_list *dst, rx_error *err)
{
    dst->n = 0;
    dst->radius = 0.0;
    for (int i = 0; i < v->sources->n; i++)
        if (usable(v, &v->sources->list[i], level, &dst->list[dst->n]))
            dst->list[dst->n++].source = i;
    dst->candidates = dst->n;
    if (dst->n == 0)
        return RX_OK;
    rx_status status = find_locus(v, dst->list, dst->n, &dst->radius, err);
    if (status == RX_OK)
        status = keep_locus(dst->list, &dst->n, &dst->radius, err);
    if (status != RX_OK)
        return status;
    qsort(dst->list, (size_t)dst->n, sizeof *dst->list, by_snr);
    keep_isolated(v->sources, level, dst);
    return RX_OK;
}

rx_status rx_stars_select(const rx_psf_params *par, const rx_tile *tile, const rx_background *background,
                          const rx_sources *sources, int enough, rx_star_list *dst, rx_error *err)
{
    view v = {.par = par, .tile = tile, .background = background, .sources = sources};
    *dst = (rx_star_list){.list = RX_NEW(rx_star, (size_t)sources->n + 1)};
    if (dst->list == NULL)
        return rx_error_memory(err, 0);
    for (int i = 1; i < sources->nradii; i++)
        if (fabs(sources->flux_fraction[i] - 0.5) < fabs(sources->flux_fraction[v.radius_index] - 0.5))
            v.radius_index = i;
    rx_status status = RX_OK;
    for (int level = 0; level < 2 && status == RX_OK && dst->n < enough; level++)
        status = select_level(&v, level, dst, err);
    if (status != RX_OK)
        rx_stars_free(dst);
    return status;
}

void rx_stars_free(rx_star_list *stars)
{
    free(stars->list);
    *stars = (rx_star_list){.n = 0};
}
