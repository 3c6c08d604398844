/* Which sources of a list are stars: bright, unmasked, roundish, and of a half-light radius that many share. */
#include "psf/psf_stars.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/map.h"
#include "num/stats.h"

/* Half-width of the stellar locus in ln(radius). */
static const double locus_half = 0.10;
/* Half-light radius, pixels: wider than any PSF that can be given (FWHM 200); fits take six radii around. */
static const double widest = 120.0;

void rx_star_list_free(rx_star_list *stars)
{
    free(stars->list);
    *stars = (rx_star_list){.n = 0};
}

static double sky_level(const rx_star_search *v, int x, int y)
{
    const rx_map sky = rx_image_sky(v->image);
    return (double)rx_map_at(&sky, x, y);
}

/* No masked pixel, no plateau at the saturation level, and light around the peak: a hot pixel or the hit
 * of a particle is narrower than any PSF. */
static int clean_core(const rx_star_search *v, const rx_source *s, double radius)
{
    const rx_image *image = v->image;
    int cx = (int)lround(s->x), cy = (int)lround(s->y), reach = (int)ceil(fmax(2.0 * radius, 3.0));
    if (cx - reach < 0 || cy - reach < 0 || cx + reach >= image->width || cy + reach >= image->height)
        return 0;
    int px = cx, py = cy;
    for (int y = cy - reach; y <= cy + reach; y++)
        for (int x = cx - reach; x <= cx + reach; x++) {
            size_t at = (size_t)y * (size_t)image->width + (size_t)x;
            if (rx_image_hides(image, at) || (double)image->pixels[at] >= 0.9 * image->saturation)
                return 0;
            if (abs(x - cx) <= 1 && abs(y - cy) <= 1 &&
                image->pixels[at] > image->pixels[(size_t)py * (size_t)image->width + (size_t)px]) {
                px = x;
                py = y;
            }
        }
    double ring = 0.0, centre = 0.0;
    for (int y = py - 1; y <= py + 1; y++)
        for (int x = px - 1; x <= px + 1; x++) {
            size_t at = (size_t)y * (size_t)image->width + (size_t)x;
            double value = (double)image->pixels[at] - sky_level(v, x, y);
            *(x == px && y == py ? &centre : &ring) += value;
        }
    return centre > 0.0 && ring > 0.7 * centre;
}

static int usable(const rx_star_search *v, const rx_source *s, int radius_index, rx_candidate *star)
{
    int allowed = v->level > 0 ? RX_FLAG_CROWDED | RX_FLAG_MERGED : 0;
    star->radius = s->flux_radius[radius_index];
    star->snr = s->fluxerr_auto > 0.0 ? s->flux_auto / s->fluxerr_auto : 0.0;
    if ((s->flags & ~allowed) != 0 || !(star->snr >= v->par->min_snr))
        return 0;
    if (!(star->radius > 0.4 && star->radius < fmin(0.1 * v->image->width, widest)) || !(s->b > 0.5 * s->a))
        return 0;
    return clean_core(v, s, star->radius);
}

/* Detectors (and plates) that saturate softly, or at an unknown level, pile the brightest peaks up just
 * below their limit. Where a tenth of all sources reach 80 % of the highest peak, only those below 70 % of
 * it are trusted. Peaks follow a falling power law otherwise: 80 % is reached by one or two. */
static double highest_peak(const rx_star_search *search)
{
    const rx_sources *sources = search->sources;
    double highest = 0.0;
    int near = 0, bright = 0;
    for (int i = 0; i < sources->n; i++)
        if ((sources->list[i].flags & RX_FLAG_SATURATED) == 0)
            highest = fmax(highest, sources->list[i].peak);
    for (int i = 0; i < sources->n; i++)
        if ((sources->list[i].flags & RX_FLAG_SATURATED) == 0) {
            near += sources->list[i].peak > 0.8 * highest;
            bright += sources->list[i].flux_auto > search->par->min_snr * sources->list[i].fluxerr_auto;
        }
    return near >= 5 && near > bright / 10 ? 0.7 * highest : HUGE_VAL;
}

rx_status rx_stars_candidates(const rx_star_search *search, rx_star_list *dst, rx_error *err)
{
    const rx_sources *sources = search->sources;
    double limit = highest_peak(search);
    int half_light = 0;
    *dst = (rx_star_list){.list = RX_NEW(rx_candidate, (size_t)sources->n + 1)};
    if (dst->list == NULL)
        return rx_error_memory(err, 0);
    for (int i = 1; i < sources->nradii; i++)
        if (fabs(sources->flux_fraction[i] - 0.5) < fabs(sources->flux_fraction[half_light] - 0.5))
            half_light = i;
    for (int i = 0; i < sources->n; i++)
        if (sources->list[i].peak < limit &&
            usable(search, &sources->list[i], half_light, &dst->list[dst->n]))
            dst->list[dst->n++].source = i;
    return RX_OK;
}

static int by_peak(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return (x[0] < y[0]) - (x[0] > y[0]);
}

/* Number density of the candidates over ln(radius), on a grid, smoothed by a Gaussian. */
enum { GRID = 501 };
static const double grid_low = -1.0, grid_high = 4.0;

static double grid_position(int i)
{
    return grid_low + (grid_high - grid_low) * i / (GRID - 1);
}

/* A top counts when the density falls to 4/5 of it on both sides before anything higher comes. */
static int is_top(const double *density, int i)
{
    for (int side = -1; side <= 1; side += 2) {
        int j = i;
        while (j >= 0 && j < GRID && density[j] > 0.8 * density[i]) {
            if (density[j] > density[i] || (density[j] == density[i] && j < i))
                return 0;
            j += side;
        }
    }
    return density[i] > 0.0;
}

/* Tops of the density at one smoothing length that are at least `share` of the highest; those close to one
 * that is known already are the same. */
static void add_loci(const double (*sorted)[2], int m, double smoothing, double share,
                     double radii[RX_LOCI_MAX], int *n)
{
    double density[GRID] = {0.0}, highest = 0.0;
    for (int g = 0; g < GRID; g++) {
        for (int i = 0; i < m; i++) {
            double d = (sorted[i][1] - grid_position(g)) / smoothing;
            density[g] += exp(-0.5 * d * d);
        }
        highest = fmax(highest, density[g]);
    }
    int room = *n + RX_LOCI_MAX / 2;
    for (int g = 0; g < GRID && *n < room; g++) {
        int known = density[g] <= fmax(share * highest, 2.0) || !is_top(density, g);
        for (int k = 0; k < *n && !known; k++)
            known = fabs(log(radii[k]) - grid_position(g)) < 0.04;
        if (!known)
            radii[(*n)++] = exp(grid_position(g));
    }
}

rx_status rx_stars_loci(const rx_star_search *search, const rx_star_list *candidates,
                        double radii[RX_LOCI_MAX], int *n, rx_error *err)
{
    /* stars are the most concentrated sources: the upper half in peak, at least 30 */
    int m = candidates->n / 2 > 30 ? candidates->n / 2 : candidates->n < 30 ? candidates->n : 30;
    double(*sorted)[2] = rx_alloc((size_t)candidates->n, sizeof *sorted);
    *n = 0;
    if (sorted == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < candidates->n; i++) {
        sorted[i][0] = search->sources->list[candidates->list[i].source].peak;
        sorted[i][1] = log(candidates->list[i].radius);
    }
    qsort(sorted, (size_t)candidates->n, sizeof *sorted, by_peak);
    /* few but excellent stars among many galaxies stand out at a fine scale, noisy ones at a coarse one */
    add_loci((const double(*)[2])sorted, m, 0.02, 0.5, radii, n);
    add_loci((const double(*)[2])sorted, m, 0.05, 0.15, radii, n);
    free(sorted);
    return RX_OK;
}

/* Copy those within the locus: around the median of what lies around the top (once: repeated, the
 * window would walk into the galaxies where they outnumber the stars). */
static rx_status take_locus(const rx_star_list *candidates, double *radius, rx_star_list *dst, rx_error *err)
{
    double centre = log(*radius), *inside = RX_NEW(double, candidates->n);
    size_t m = 0;
    if (inside == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < candidates->n; i++)
        if (fabs(log(candidates->list[i].radius) - centre) < 0.5 * locus_half)
            inside[m++] = log(candidates->list[i].radius);
    if (m > 0)
        centre = rx_median(inside, m);
    free(inside);
    for (int i = 0; i < candidates->n; i++)
        if (fabs(log(candidates->list[i].radius) - centre) < locus_half)
            dst->list[dst->n++] = candidates->list[i];
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
    const rx_candidate *x = a, *y = b;
    if (x->snr != y->snr)
        return x->snr < y->snr ? 1 : -1;
    return (x->source > y->source) - (x->source < y->source);
}

rx_status rx_stars_near(const rx_star_search *search, const rx_star_list *candidates, double *radius,
                        rx_star_list *dst, rx_error *err)
{
    *dst = (rx_star_list){.list = RX_NEW(rx_candidate, (size_t)candidates->n + 1)};
    if (dst->list == NULL)
        return rx_error_memory(err, 0);
    rx_status status = take_locus(candidates, radius, dst, err);
    if (status != RX_OK) {
        rx_star_list_free(dst);
        return status;
    }
    qsort(dst->list, (size_t)dst->n, sizeof *dst->list, by_snr);
    double limit = search->level > 0 ? 0.2 : 0.03;
    int kept = 0;
    for (int i = 0; i < dst->n && kept < RX_STARS_MAX; i++)
        if (contamination(search->sources, dst->list[i].source, 2.0 * *radius) < limit)
            dst->list[kept++] = dst->list[i];
    dst->n = kept;
    return RX_OK;
}
