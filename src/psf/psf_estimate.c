/* PSF_TYPE AUTO: choose among the sources of a list those that are stars, fit them one by one, leave out what
 * does not agree, then fit one elliptical Moffat to all of them together.
 *
 * Weights: 1/sigma^2 with sigma^2 = sky noise^2 + star / gain + (2 % of the star)^2; the last term keeps the
 * few brightest stars, on which a Moffat never fits to the noise, from deciding alone.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/map.h"
#include "num/lsq.h"
#include "num/stats.h"
#include "psf/moffat_fit.h"
#include "psf/psf.h"

/* --- which sources are stars --- */

typedef struct candidate {
    int source; /* index in the source list */
    double snr;
    double radius; /* half-light radius, pixels */
} candidate;

typedef struct star_list {
    int n;
    candidate *list;
} star_list;

static void free_list(star_list *stars)
{
    free(stars->list);
    *stars = (star_list){.n = 0};
}

enum { STARS_MAX = 80, LOCI_MAX = 6 };

/* What selection looks at; level 0 takes sources with FLAGS 0 and no neighbour of weight, level 1 (crowded
 * fields) lets in close neighbours and blends. */
typedef struct star_search {
    const rx_psf_params *par;
    const rx_image *image;
    const rx_sources *sources;
    int level;
} star_search;

/* Half-width of the stellar locus in ln(radius). */
static const double locus_half = 0.10;
/* Half-light radius, pixels: wider than any PSF that can be given (FWHM 200); fits take six radii around. */
static const double widest = 120.0;

static double sky_level(const star_search *v, int x, int y)
{
    const rx_map sky = rx_image_sky(v->image);
    return (double)rx_map_at(&sky, x, y);
}

/* No masked pixel, no plateau at the saturation level, and light around the peak: a hot pixel or the hit
 * of a particle is narrower than any PSF. */
static int clean_core(const star_search *v, const rx_source *s, double radius)
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

static int usable(const star_search *v, const rx_source *s, int radius_index, candidate *star)
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

/* Detectors (and plates) that saturate softly, or at a level nobody told, pile the brightest peaks up just
 * below their limit. Where a tenth of all sources reach 80 % of the highest peak, only those below 70 % of
 * it are trusted. Peaks follow a falling power law otherwise: 80 % is reached by one or two. */
static double highest_peak(const star_search *search)
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

/* Sources that are bright, unsaturated, unmasked, roundish and wider than a hot pixel; free_list(). Errors:
 * RX_SYSTEM memory; none found is not one. */
static rx_status find_candidates(const star_search *search, star_list *dst, rx_error *err)
{
    const rx_sources *sources = search->sources;
    double limit = highest_peak(search);
    int half_light = 0;
    *dst = (star_list){.list = RX_NEW(candidate, (size_t)sources->n + 1)};
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
static void add_loci(const double (*sorted)[2], int m, double smoothing, double share, double radii[LOCI_MAX],
                     int *n)
{
    double density[GRID] = {0.0}, highest = 0.0;
    for (int g = 0; g < GRID; g++) {
        for (int i = 0; i < m; i++) {
            double d = (sorted[i][1] - grid_position(g)) / smoothing;
            density[g] += exp(-0.5 * d * d);
        }
        highest = fmax(highest, density[g]);
    }
    int room = *n + LOCI_MAX / 2;
    for (int g = 0; g < GRID && *n < room; g++) {
        int known = density[g] <= fmax(share * highest, 2.0) || !is_top(density, g);
        for (int k = 0; k < *n && !known; k++)
            known = fabs(log(radii[k]) - grid_position(g)) < 0.04;
        if (!known)
            radii[(*n)++] = exp(grid_position(g));
    }
}

/* Half-light radii (pixels) where candidates crowd: the stellar locus is one of them, usually
 * the narrowest. Returns how many. Errors as above. */
static rx_status find_loci(const star_search *search, const star_list *candidates, double radii[LOCI_MAX],
                           int *n, rx_error *err)
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
static rx_status take_locus(const star_list *candidates, double *radius, star_list *dst, rx_error *err)
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
    const candidate *x = a, *y = b;
    if (x->snr != y->snr)
        return x->snr < y->snr ? 1 : -1;
    return (x->source > y->source) - (x->source < y->source);
}

/* Isolated candidates of that half-light radius, by falling S/N, at most STARS_MAX. *radius becomes
 * their median. */
static rx_status stars_near(const star_search *search, const star_list *candidates, double *radius,
                            star_list *dst, rx_error *err)
{
    *dst = (star_list){.list = RX_NEW(candidate, (size_t)candidates->n + 1)};
    if (dst->list == NULL)
        return rx_error_memory(err, 0);
    rx_status status = take_locus(candidates, radius, dst, err);
    if (status != RX_OK) {
        free_list(dst);
        return status;
    }
    qsort(dst->list, (size_t)dst->n, sizeof *dst->list, by_snr);
    double limit = search->level > 0 ? 0.2 : 0.03;
    int kept = 0;
    for (int i = 0; i < dst->n && kept < STARS_MAX; i++)
        if (contamination(search->sources, dst->list[i].source, 2.0 * *radius) < limit)
            dst->list[kept++] = dst->list[i];
    dst->n = kept;
    return RX_OK;
}

/* --- their profile --- */

static const double model_error = 0.02;

typedef struct fitted_star {
    const rx_source *source;
    rx_moffat_pixels pixels; /* x, y of the tile; value above the background */
    double *noise;           /* [n] sky noise of each pixel */
    rx_moffat_fit fit;
    double fwhm, chi2; /* chi2 per degree of freedom */
    int kept;
} fitted_star;

typedef struct scene {
    const rx_image *image;
    const rx_sources *sources;
    double radius; /* pixels, of what is fitted around each star */
} scene;

/* Of n pixels from (x, y) on those in the disc that belong to the star or to the sky, unmasked. */
static void cut_piece(const scene *sc, const rx_source *s, int y, int x, int n, fitted_star *star)
{
    const rx_image *image = sc->image;
    const rx_map sky = rx_image_sky(image);
    float room[2][RX_MAP_PIECE];
    const float *level = rx_map_row(&sky, y, x, n, room[0]);
    const float *sigmas = rx_map_given(&image->noise) ? rx_map_row(&image->noise, y, x, n, room[1]) : NULL;
    rx_moffat_pixels *p = &star->pixels;
    for (int i = 0; i < n; i++) {
        const size_t at = (size_t)y * (size_t)image->width + (size_t)(x + i);
        const int32_t owner = sc->sources->segments != NULL ? sc->sources->segments[at] : 0;
        const double sigma = sigmas != NULL ? (double)sigmas[i] : 1.0;
        if (hypot(x + i - s->x, y - s->y) > sc->radius || rx_image_hides(image, at) ||
            (owner != 0 && owner != s->segment) || !(sigma > 0.0))
            continue;
        p->x[p->n] = x + i;
        p->y[p->n] = y;
        p->value[p->n] = (double)image->pixels[at] - (double)level[i];
        star->noise[p->n++] = sigma;
    }
}

/* The pixels of a disc around the star. */
static rx_status cut_out(const scene *sc, const rx_source *s, fitted_star *star, rx_error *err)
{
    const int reach = (int)ceil(sc->radius), cx = (int)lround(s->x), cy = (int)lround(s->y);
    const int x0 = cx > reach ? cx - reach : 0, y0 = cy > reach ? cy - reach : 0;
    const int x1 = cx + reach < sc->image->width ? cx + reach + 1 : sc->image->width;
    const int y1 = cy + reach < sc->image->height ? cy + reach + 1 : sc->image->height;
    star->source = s;
    rx_status status = rx_moffat_pixels_new((2 * reach + 1) * (2 * reach + 1), &star->pixels, err);
    star->noise = RX_NEW(double, (2 * reach + 1) * (2 * reach + 1));
    if (status != RX_OK || star->noise == NULL)
        return rx_error_memory(err, 0);
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x += RX_MAP_PIECE)
            cut_piece(sc, s, y, x, rx_map_piece(x, x1), star);
    return RX_OK;
}

/* Weights from the present fit; away from the core, pixels that disagree by 4 sigma are dropped:
 * neighbours below the detection limit, particle hits. */
static void weigh(const scene *sc, fitted_star *star, int drop)
{
    rx_moffat_pixels *p = &star->pixels;
    rx_moffat profile;
    rx_moffat_set(&profile, star->fit.shape);
    double core = rx_moffat_fit_fwhm(&star->fit);
    int kept = 0;
    for (int i = 0; i < p->n; i++) {
        double model = rx_moffat_fit_value(&star->fit, &profile, p->x[i], p->y[i]);
        double light = fmax(model - star->fit.sky, 0.0), gain = sc->image->gain;
        double sigma = sqrt(star->noise[i] * star->noise[i] + (gain > 0.0 ? light / gain : 0.0) +
                            model_error * model_error * light * light);
        if (drop && fabs(p->value[i] - model) > 4.0 * sigma &&
            hypot(p->x[i] - star->fit.x, p->y[i] - star->fit.y) > core)
            continue;
        p->x[kept] = p->x[i];
        p->y[kept] = p->y[i];
        p->value[kept] = p->value[i];
        star->noise[kept] = star->noise[i];
        p->sigma[kept++] = sigma;
    }
    p->n = kept;
}

static rx_status fit_star(const scene *sc, const double shape[RX_MOFFAT_SHAPE], fitted_star *star,
                          rx_error *err)
{
    const rx_source *s = star->source;
    rx_status status = RX_OK;
    star->fit = (rx_moffat_fit){.peak = s->peak, .x = s->x, .y = s->y};
    for (int k = 0; k < RX_MOFFAT_SHAPE; k++)
        star->fit.shape[k] = shape[k];
    for (int pass = 0; pass < 2 && status == RX_OK; pass++) {
        weigh(sc, star, pass > 0);
        status = rx_moffat_fit_run(&star->pixels, 1, &star->fit, err);
        if (!star->fit.converged)
            break;
    }
    star->fwhm = rx_moffat_fit_fwhm(&star->fit);
    star->chi2 = star->fit.chi2 / fmax(star->pixels.n - 8, 1);
    double away = hypot(star->fit.x - s->x, star->fit.y - s->y), start = 2.0 * exp(shape[0]);
    star->kept = star->fit.converged && away < fmax(1.0, 0.3 * start) && star->fwhm > 0.3 * start &&
                 star->fwhm < 3.0 * start;
    return status;
}

static double measure(const fitted_star *star, int which)
{
    return which == 0   ? log(star->fwhm)
           : which == 1 ? star->fit.shape[1]
           : which == 2 ? star->fit.shape[2]
                        : log(star->chi2 + 0.1);
}

/* Leave out stars that differ in width, ellipse or quality of the fit from the others by 3 robust sigmas
 * (quality: only the bad side). Floors keep perfect fields from losing stars to rounding. */
static rx_status reject_outliers(fitted_star *stars, int n, rx_error *err)
{
    static const double floors[4] = {0.02, 0.02, 0.02, 0.3};
    double *values = RX_NEW(double, n);
    if (values == NULL)
        return rx_error_memory(err, 0);
    for (int round = 0; round < 6; round++)
        for (int which = 0; which < 4; which++) {
            size_t m = 0;
            for (int i = 0; i < n; i++)
                if (stars[i].kept)
                    values[m++] = measure(&stars[i], which);
            if (m < 3)
                break;
            double centre, sigma = rx_sigma_mad(values, m, &centre),
                           limit = 3.0 * fmax(sigma, floors[which] / 3.0);
            for (int i = 0; i < n; i++) {
                double off = measure(&stars[i], which) - centre;
                if (stars[i].kept && (which == 3 ? off : fabs(off)) > limit)
                    stars[i].kept = 0;
            }
        }
    free(values);
    return RX_OK;
}

typedef struct joint_task {
    const fitted_star *stars;
    int n;
} joint_task;

/* All kept stars with one shape; peak and sky of each follow by linear least squares (variable projection,
 * Golub and Pereyra 1973), centres stay where the single fits put them. */
static int joint_model(void *user, const double *shape, double *residuals, double *jacobian)
{
    const joint_task *task = user;
    rx_moffat profile;
    (void)jacobian;
    for (int k = 0; k < RX_MOFFAT_SHAPE; k++)
        if (!isfinite(shape[k]))
            return 1;
    rx_moffat_set(&profile, shape);
    for (int s = 0; s < task->n; s++) {
        const fitted_star *star = &task->stars[s];
        const rx_moffat_pixels *p = &star->pixels;
        if (!star->kept)
            continue;
        double w1 = 0.0, wf = 0.0, wff = 0.0, wv = 0.0, wfv = 0.0;
        for (int i = 0; i < p->n; i++) {
            double f = rx_moffat_pixel(&profile, p->x[i] - star->fit.x, p->y[i] - star->fit.y, NULL);
            double w = 1.0 / (p->sigma[i] * p->sigma[i]);
            residuals[i] = f;
            w1 += w;
            wf += w * f;
            wff += w * f * f;
            wv += w * p->value[i];
            wfv += w * f * p->value[i];
        }
        double det = w1 * wff - wf * wf;
        if (!(det > 0.0))
            return 1;
        double peak = (w1 * wfv - wf * wv) / det, sky = (wff * wv - wf * wfv) / det;
        for (int i = 0; i < p->n; i++)
            residuals[i] = (peak * residuals[i] + sky - p->value[i]) / p->sigma[i];
        residuals += p->n;
    }
    return 0;
}

static rx_status fit_joint(const fitted_star *stars, int n, double shape[RX_MOFFAT_SHAPE], rx_error *err)
{
    joint_task task = {.stars = stars, .n = n};
    rx_lsq_problem problem = {.nparameters = RX_MOFFAT_SHAPE,
                              .model = joint_model,
                              .user = &task,
                              .max_iterations = 30,
                              .tolerance = 1e-5};
    for (int i = 0; i < n; i++)
        if (stars[i].kept)
            problem.nresiduals += (size_t)stars[i].pixels.n;
    return rx_lsq_fit(&problem, shape, NULL, NULL, err);
}

/* Median shape of the kept stars, where the joint fit starts, and their robust scatter: relative in the
 * width, absolute in the ellipse, added in quadrature. */
static rx_status summarise(const fitted_star *stars, int n, double shape[RX_MOFFAT_SHAPE], double *scatter,
                           rx_error *err)
{
    double *values = RX_NEW(double, n), sum = 0.0;
    if (values == NULL)
        return rx_error_memory(err, 0);
    for (int k = 0; k < RX_MOFFAT_SHAPE; k++) {
        size_t m = 0;
        for (int i = 0; i < n; i++)
            if (stars[i].kept)
                values[m++] = stars[i].fit.shape[k];
        if (m == 0)
            continue;
        double sigma = rx_sigma_mad(values, m, &shape[k]);
        sum += k < 3 ? sigma * sigma : 0.0;
    }
    *scatter = sqrt(sum);
    free(values);
    return RX_OK;
}

static int count_kept(const fitted_star *stars, int n)
{
    int kept = 0;
    for (int i = 0; i < n; i++)
        kept += stars[i].kept;
    return kept;
}

static rx_status too_few(const rx_psf_params *par, const rx_image *image, int found, rx_error *err)
{
    return rx_error_at(
        err, RX_INPUT, image->name != NULL ? image->name : "", image->hdu, 0,
        "PSF_TYPE AUTO found %d usable star%s of S/N above %g and needs %d; give PSF_FWHM in pixels, "
        "SEEING_FWHM in arcsec, or a lower PSF_MINSNR",
        found, found == 1 ? "" : "s", par->min_snr, par->min_stars);
}

/* Robust scatter of the single widths over sqrt(n). */
static rx_status width_error(const fitted_star *stars, int n, double fwhm, double *error, rx_error *err)
{
    size_t m = 0;
    double *values = RX_NEW(double, n);
    if (values == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < n; i++)
        if (stars[i].kept)
            values[m++] = log(stars[i].fwhm);
    *error = m > 1 ? fwhm * rx_sigma_mad(values, m, NULL) / sqrt((double)m) : 0.0;
    free(values);
    return RX_OK;
}

static void tell_stars(const fitted_star *stars, int n, rx_log *log)
{
    for (int i = 0; i < n; i++)
        rx_log_detail(log, "PSF star at (%.2f,%.2f): FWHM %.3f px, ellipticity %.3f, chi2 %.2f: %s",
                      stars[i].source->x + 1.0, stars[i].source->y + 1.0, stars[i].fwhm,
                      rx_moffat_fit_ellipticity(&stars[i].fit), stars[i].chi2,
                      stars[i].kept ? "used" : "left out");
}

/* One try: the candidates of one half-light radius, fitted and cleaned. */
typedef struct attempt {
    star_list list;
    fitted_star *stars; /* [list.n] */
    int candidates, kept;
    double radius; /* half-light, pixels */
    double shape[RX_MOFFAT_SHAPE];
    double scatter; /* how much the stars differ from each other */
} attempt;

static void free_attempt(attempt *a)
{
    for (int i = 0; a->stars != NULL && i < a->list.n; i++) {
        rx_moffat_pixels_free(&a->stars[i].pixels);
        free(a->stars[i].noise);
    }
    free(a->stars);
    free_list(&a->list);
    *a = (attempt){.kept = 0};
}

static rx_status fit_attempt(const star_search *search, attempt *a, rx_error *err)
{
    scene sc = {.image = search->image, .sources = search->sources, .radius = fmax(6.0 * a->radius, 5.0)};
    rx_status status = RX_OK;
    a->stars = RX_NEW(fitted_star, (size_t)a->list.n + 1);
    if (a->stars == NULL)
        return rx_error_memory(err, 0);
    rx_moffat_shape(1.9 * a->radius, 4.0, 1.0, 0.0, a->shape);
    for (int i = 0; i < a->list.n && status == RX_OK; i++) {
        status = cut_out(&sc, &sc.sources->list[a->list.list[i].source], &a->stars[i], err);
        if (status == RX_OK)
            status = fit_star(&sc, a->shape, &a->stars[i], err);
    }
    if (status == RX_OK)
        status = reject_outliers(a->stars, a->list.n, err);
    if (status == RX_OK)
        status = summarise(a->stars, a->list.n, a->shape, &a->scatter, err);
    a->kept = count_kept(a->stars, a->list.n);
    return status;
}

/* Stars are alike, galaxies and particle hits are not: the lower the better. Differences below 1.5 % are
 * noise; few stars count less. */
static double badness(const attempt *a, int enough)
{
    return fmax(a->scatter, 0.015) * sqrt(fmax(1.0, (double)enough / fmax(a->kept, 1.0)));
}

/* Try each place where candidates crowd in radius; *best (to be freed) is the one whose members are most
 * alike. */
static rx_status search_stars(star_search *search, int needed, int enough, attempt *best, int *found,
                              rx_error *err)
{
    rx_status status = RX_OK;
    for (search->level = 0; search->level < 2 && best->kept < enough && status == RX_OK; search->level++) {
        star_list candidates;
        double radii[LOCI_MAX];
        int nloci = 0;
        status = find_candidates(search, &candidates, err);
        if (status == RX_OK)
            status = find_loci(search, &candidates, radii, &nloci, err);
        for (int k = 0; k < nloci && status == RX_OK; k++) {
            attempt a = {.candidates = candidates.n, .radius = radii[k]};
            status = stars_near(search, &candidates, &a.radius, &a.list, err);
            if (status == RX_OK)
                status = fit_attempt(search, &a, err);
            *found = a.kept > *found ? a.kept : *found;
            if (status == RX_OK && a.kept >= needed &&
                (best->kept == 0 || badness(&a, enough) < badness(best, enough))) {
                attempt swap = *best;
                *best = a;
                a = swap;
            }
            free_attempt(&a);
        }
        free_list(&candidates);
    }
    return status;
}

/* The tile's PSF from the shape, with what is known of its making. */
static rx_status build(const rx_psf_params *par, const rx_image *image, const attempt *best, rx_psf **dst,
                       rx_error *err)
{
    const fitted_star *stars = best->stars;
    const int n = best->list.n;
    rx_moffat profile;
    rx_moffat_set(&profile, best->shape);
    double fwhm = 2.0 * profile.hwhm, beta = fmin(fmax(profile.beta, 1.2), 100.0);
    double ratio = fmax(exp(-hypot(profile.e1, profile.e2)), 0.05),
           angle = 0.5 * atan2(profile.e2, profile.e1);
    int most = image->width < image->height ? image->width : image->height;
    rx_psf *psf = NULL;
    rx_status status = rx_psf_moffat(fwhm, beta, ratio, angle, par->size, &psf, err);
    if (status == RX_OK && psf->size > most) {
        rx_psf_free(psf);
        status = rx_psf_moffat(fwhm, beta, ratio, angle, most - 1 + most % 2, &psf, err);
    }
    if (status == RX_OK)
        status = width_error(stars, n, fwhm, &psf->fwhm_error, err);
    if (status != RX_OK)
        goto exit;
    psf->type = RX_PSF_AUTO;
    psf->stars = rx_alloc((size_t)n, sizeof *psf->stars);
    if (psf->stars == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    for (int i = 0; i < n; i++)
        if (stars[i].kept) {
            psf->stars[psf->nstars][0] = stars[i].fit.x;
            psf->stars[psf->nstars++][1] = stars[i].fit.y;
        }
    snprintf(psf->description, sizeof psf->description,
             "AUTO: elliptical Moffat FWHM %.3f +- %.3f px, beta %.2f, ellipticity %.3f, from %d of %d "
             "candidate stars",
             fwhm, psf->fwhm_error, beta, psf->ellipticity, psf->nstars, best->candidates);
    *dst = psf;
    psf = NULL;
exit:
    rx_psf_free(psf);
    return status;
}

rx_status rx_psf_estimate(const rx_psf_params *par, const rx_image *image, const rx_sources *sources,
                          rx_log *log, rx_psf **dst, rx_error *err)
{
    star_search search = {.par = par, .image = image, .sources = sources};
    attempt best = {.kept = 0};
    int needed = par->min_stars > 2 ? par->min_stars : 2, found = 0;
    *dst = NULL;
    rx_status status = search_stars(&search, needed, needed > 10 ? needed : 10, &best, &found, err);
    if (status == RX_OK && best.kept == 0)
        status = too_few(par, image, found, err);
    if (status == RX_OK) {
        tell_stars(best.stars, best.list.n, log);
        if (best.scatter > 0.15)
            rx_log_warning(
                log,
                "PSF_TYPE AUTO: the %d stars differ by %.0f %% in width and shape; the PSF varies, or "
                "some are no stars",
                best.kept, 100.0 * best.scatter);
        status = fit_joint(best.stars, best.list.n, best.shape, err);
    }
    if (status == RX_OK)
        status = build(par, image, &best, dst, err);
    free_attempt(&best);
    return status;
}
