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
 * of a particle is narrower than any PSF, by more than noise. */
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
    const double sigma = rx_map_given(&image->noise) ? (double)rx_map_at(&image->noise, px, py) : 1.0;
    return centre > 0.0 && ring > 0.7 * centre - 2.0 * sqrt(8.5) * sigma;
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

/* Detectors and plates that saturate softly, or at an unknown level, pile peaks up just below it while sources go on
 * growing. Peaks of a sky follow a falling power law, so that 80 % of the highest is reached by one or two: where a
 * tenth of all sources reach it, 20 sigmas above the sky or more, only peaks below 70 % of it are trusted. */
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
    return near >= 5 && near > bright / 10 && highest > 20.0 * search->image->global_noise ? 0.7 * highest
                                                                                           : HUGE_VAL;
}

rx_status rx_stars_candidates(const rx_star_search *search, rx_star_list *dst, rx_error *err)
{
    const rx_sources *sources = search->sources;
    const char *listed = search->par->stars_file;
    const int all = listed == NULL || listed[0] == '\0';
    int half_light = 0;
    const double given = search->par->flattened, highest = given > 0.0 ? HUGE_VAL : highest_peak(search);
    *dst = (rx_star_list){.list = RX_NEW(rx_candidate, (size_t)sources->n + 1), .limit = HUGE_VAL};
    if (dst->list == NULL)
        return rx_error_memory(err, 0);
    for (int i = 1; i < sources->nradii; i++)
        if (fabs(sources->flux_fraction[i] - 0.5) < fabs(sources->flux_fraction[half_light] - 0.5))
            half_light = i;
    for (int i = 0; i < sources->n; i++) {
        const rx_source *s = &sources->list[i];
        rx_candidate *star = &dst->list[dst->n];
        if ((!all && s->number_assoc <= 0) || !usable(search, s, half_light, star))
            continue;
        const double sky = sky_level(search, (int)lround(s->x), (int)lround(s->y));
        star->source = i;
        star->level = s->peak + sky;
        if (s->peak >= highest || (given > 0.0 && star->level >= given)) {
            dst->limit = fmin(dst->limit, star->level);
            dst->flattened++;
        } else if (!(search->limit > 0.0) || s->peak < search->share * (search->limit - sky)) {
            dst->n++;
        }
    }
    return RX_OK;
}

static int by_first(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return (x[0] < y[0]) - (x[0] > y[0]);
}

/* From the highest peak down, eight at a time: even their narrow quarter is wider than the stars, and fluxes differ by
 * more than peaks do (those of galaxies differ alike). */
rx_status rx_stars_flattened(const rx_star_search *search, double radius, rx_star_list *list, rx_error *err)
{
    enum { EIGHT = 8 };
    static const double wider = 0.06, steeper = 1.5;
    const int n = list->n;
    int flat = 0, kept = 0;
    if (search->par->flattened > 0.0)
        return RX_OK;
    if (n < 5 * EIGHT)
        return RX_OK;
    double(*sorted)[4] = rx_alloc((size_t)n, sizeof *sorted), *values = RX_NEW(double, n), spread[2];
    if (sorted == NULL || values == NULL) {
        free(sorted);
        free(values);
        return rx_error_memory(err, 0);
    }
    for (int i = 0; i < n; i++) {
        const rx_source *s = &search->sources->list[list->list[i].source];
        sorted[i][0] = list->list[i].level;
        sorted[i][1] = log(list->list[i].radius / radius);
        sorted[i][2] = log(s->peak);
        sorted[i][3] = log(s->flux_auto);
    }
    qsort(sorted, (size_t)n, sizeof *sorted, by_first);
    for (; flat + EIGHT <= n / 2; flat += EIGHT) {
        for (int i = 0; i < EIGHT; i++)
            values[i] = sorted[flat + i][1];
        if (rx_quantile(values, EIGHT, 0.25) < wider)
            break;
    }
    for (int k = 0; k < 2 && flat > 0; k++) {
        for (int i = 0; i < flat; i++)
            values[i] = sorted[i][2 + k];
        spread[k] = rx_sigma_mad(values, (size_t)flat, NULL);
    }
    if (flat > 0 && spread[1] > steeper * spread[0]) {
        list->limit = sorted[flat][0];
        for (int i = 0; i < n; i++)
            if (list->list[i].level <= list->limit)
                list->list[kept++] = list->list[i];
        list->flattened += n - kept;
        list->n = kept;
    }
    free(sorted);
    free(values);
    return RX_OK;
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
    int room = *n + RX_LOCI_MAX / 3;
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
    /* stars are the most concentrated sources: the upper half in peak, at least 30; and among the brightest, where
     * specks (hits of particles, grains, hot pixels) may be many more */
    const int few = candidates->n < 30 ? candidates->n : 30;
    const int m = candidates->n / 2 > few ? candidates->n / 2 : few;
    double(*sorted)[2] = rx_alloc((size_t)candidates->n, sizeof *sorted);
    *n = 0;
    if (sorted == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < candidates->n; i++) {
        sorted[i][0] = search->sources->list[candidates->list[i].source].peak;
        sorted[i][1] = log(candidates->list[i].radius);
    }
    qsort(sorted, (size_t)candidates->n, sizeof *sorted, by_first);
    /* few but excellent stars among many galaxies stand out at a fine scale, noisy ones at a coarse one */
    add_loci((const double(*)[2])sorted, m, 0.02, 0.5, radii, n);
    add_loci((const double(*)[2])sorted, m, 0.05, 0.15, radii, n);
    for (int i = 0; i < candidates->n; i++) {
        sorted[i][0] = search->sources->list[candidates->list[i].source].flux_auto;
        sorted[i][1] = log(candidates->list[i].radius);
    }
    qsort(sorted, (size_t)candidates->n, sizeof *sorted, by_first);
    add_loci((const double(*)[2])sorted, few, 0.05, 0.3, radii, n);
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

void rx_candidates_sort(rx_candidate *list, int n)
{
    qsort(list, (size_t)n, sizeof *list, by_snr);
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
    rx_candidates_sort(dst->list, dst->n);
    double limit = search->level > 0 ? 0.2 : 0.03;
    int kept = 0;
    for (int i = 0; i < dst->n && kept < RX_STARS_MAX; i++)
        if (contamination(search->sources, dst->list[i].source, 2.0 * *radius) < limit)
            dst->list[kept++] = dst->list[i];
    dst->n = kept;
    return RX_OK;
}

/* The third narrowest of ten or more, the second of three or more; each wider by two sigmas of its own. Half the light of
 * a Gaussian lies within half its FWHM; with wings it lies farther out. */
double rx_psf_bound(const rx_psf_params *par, const rx_image *image, const rx_sources *sources)
{
    rx_psf_params faint = *par;
    faint.min_snr = 7.0;
    const rx_star_search search = {.par = &faint, .image = image, .sources = sources, .level = 1};
    double narrowest[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL};
    int n = 0;
    for (int i = 0; i < sources->n; i++) {
        rx_candidate c;
        if (!usable(&search, &sources->list[i], 0, &c) || c.radius < RX_STARS_NARROW)
            continue;
        n++;
        double radius = c.radius * (1.0 + 2.0 / c.snr);
        for (int k = 0; k < 3; k++)
            if (radius < narrowest[k]) {
                const double swap = narrowest[k];
                narrowest[k] = radius;
                radius = swap;
            }
    }
    return n < 3 ? 0.0 : 2.0 * narrowest[n < 10 ? 1 : 2];
}
