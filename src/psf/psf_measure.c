/* PSF_TYPE AUTO: the PSF of a tile from the pixels of its stars.
 *
 * 1. The elliptical Moffat of the tile (psf_estimate.c) says where the stars are in size, and is the first model.
 * 2. Every source as wide as a star is subtracted as a point; fluxes, positions and skies of all take steps against
 *    the same residual, so that neighbours do not hurt (as in DAOPHOT, Stetson 1987, PASP 99, 191, and crowdsource,
 *    Schlafly et al. 2018, ApJS 234, 39). Extended sources are masked by their segments.
 * 3. The wings: mean residual of bright stars in rings out to 20 FWHM, each star on the sky around these, which no
 *    background mesh has eaten; saturated stars, scaled by the rings just outside their cores, carry them farther
 *    out; beyond the ring where they vanish in the noise they are extrapolated.
 * 4. The core: splines on nodes finer than the pixel (psf_fit.c), held to Moffat and wings, varying over the tile with
 *    a polynomial of the degree that stars which were held out like best.
 * 5. A fifth of the stars is never fitted: what they say of the model (psf_rings.c) goes into headers.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/random.h"
#include "num/special.h"
#include "num/stats.h"
#include "psf/psf_fit.h"
#include "psf/psf_rings.h"
#include "psf/psf_stars.h"
#include "psf/psf_stretch.h"

enum {
    MOST_STARS = 600,
    CHOSEN_BY = 160,
    LEAST_STARS = 8,
    LEAST_FITTED = 4,
    FEW = 10,
    FOLDS = 3,
    PASSES = 5,
    CHOICE = 2,
    WIDER = 2,
    MOST_RINGED =
        200 /* stars, and a third as many saturated ones: some three times as many as rings are looked at around */
};
static const double MOST_GAIN = 5.0; /* chi2 of a star that counts for more as its logarithm only */
static const double WIDEST = 20.0;   /* FWHM, pixels, of a core of pixels */
static const double RESERVED = 0.2;  /* share of the stars */
static const double LOCUS = 0.22;    /* half-width in ln(half-light radius): blends are wider */
static const double FLOORS[4] = {0.03, 0.03, 0.03,
                                 0.7};  /* of the scatter of size, ellipse, ln chi2, of four sigmas */
static const double POINT = 1.35;       /* wider than a star by this: masked, not subtracted */
static const double MESH_ERROR = 0.1;   /* of a sky mesh, sigmas of a pixel */
static const double MODEL_ERROR = 0.01; /* of a pixel of the first model, relative */
/* Of fluxes, relative, where fewer than FEW are fitted: rms of small tiles, validation/results/psf (few stars). */
static const double FEW_ERROR = 0.03;
static const double BEYOND = 1e-3;   /* light that may be left out */
static const double SATURATES = 0.9; /* of the level that saturates: pixels from there on are none */
static const double LEAST_TERM =
    2e-4; /* light that a term of the polynomial moves at most where it is left out */
static const uint64_t SEED = 20, RESERVE = 1, FOLD = 2;

/* ---- points ---- */

/* Steps of sources whose light overlaps add up: each takes a smaller one. */
static rx_status set_damping(rx_psf_job *job, rx_error *err)
{
    rx_ranked *rows = RX_NEW(rx_ranked, (size_t)job->n + 1);
    if (rows == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < job->n; i++)
        rows[i] = (rx_ranked){job->points[i].y, i};
    rx_rank(rows, (size_t)job->n);
    for (int i = 0; i < job->n; i++) {
        double overlap = 0.0;
        for (int side = -1; side <= 1; side += 2)
            for (int k = i + side;
                 k >= 0 && k < job->n && fabs(rows[k].value - rows[i].value) < 2.0 * job->fwhm; k += side) {
                const double dx = job->points[rows[k].index].x - job->points[rows[i].index].x,
                             dy = rows[k].value - rows[i].value;
                overlap += exp(-1.39 * (dx * dx + dy * dy) / (job->fwhm * job->fwhm));
            }
        job->points[rows[i].index].damping = 1.0 / (1.0 + 0.7 * overlap);
    }
    free(rows);
    return RX_OK;
}

/* Saturated stars of the smallest cores are ringed, too. */
static rx_status ring_saturated(rx_psf_job *job, rx_error *err)
{
    rx_ranked *cores = RX_NEW(rx_ranked, (size_t)job->n + 1);
    int n = 0;
    if (cores == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < job->n; i++)
        if (job->points[i].saturated > 0.0)
            cores[n++] = (rx_ranked){job->points[i].saturated, i};
    rx_rank(cores, (size_t)n);
    for (int k = 0; k < n && k < MOST_RINGED / 3; k++)
        job->points[cores[k].index].ringed = 1;
    free(cores);
    return RX_OK;
}

/* Only light that falls on the cores of stars or on the discs of ringed ones counts: points whose light does not reach there go, on
 * a large tile most of them. Of bright ones it may reach farther than the first profile says. */
static rx_status leave_out_far(rx_psf_job *job, rx_error *err)
{
    typedef struct {
        double x, y, radius;
    } disc;
    const double ring = rx_psf_rings_reach(job);
    int ndiscs = 0, n = 0;
    RX_TRY(ring_saturated(job, err));
    disc *discs = rx_alloc((size_t)job->n + 1, sizeof *discs);
    if (discs == NULL)
        return rx_error_memory(err, (size_t)job->n * sizeof *discs);
    for (int i = 0; i < job->n; i++) {
        const rx_psf_point *p = &job->points[i];
        if (p->star || p->ringed)
            discs[ndiscs++] = (disc){p->x, p->y, p->ringed ? ring : M_SQRT2 * job->model.half};
    }
    for (int i = 0; i < job->n; i++) {
        const rx_psf_point p = job->points[i];
        const double reach = 2.0 * rx_psf_job_reach(job, &p);
        int near = p.star || p.saturated > 0.0;
        for (int k = 0; k < ndiscs && !near; k++) {
            const double dx = p.x - discs[k].x, dy = p.y - discs[k].y, r = discs[k].radius + reach;
            near = dx * dx + dy * dy < r * r;
        }
        if (near)
            job->points[n++] = p;
    }
    job->n = n;
    free(discs);
    return RX_OK;
}

/* Candidates of the locus, *n of them, brightest first, then wider ones, which may be stars of a bad corner or galaxies:
 * at most MOST_STARS. */
static rx_status choose_stars(const rx_psf_params *par, const rx_psf_job *job, double radius,
                              rx_star_list *dst, int *n, rx_error *err)
{
    const rx_star_search search = {.par = par, .image = job->image, .sources = job->sources, .level = 1};
    RX_TRY(rx_stars_candidates(&search, dst, err));
    RX_TRY(rx_stars_flattened(&search, radius, dst, err)); /* the caller frees dst */
    int near = 0, all;
    for (int i = 0; i < dst->n; i++)
        if (fabs(log(dst->list[i].radius / radius)) < LOCUS) {
            const rx_candidate star = dst->list[i];
            dst->list[i] = dst->list[near];
            dst->list[near++] = star;
        }
    all = near;
    for (int i = near; i < dst->n; i++)
        if (dst->list[i].radius > radius && dst->list[i].radius < POINT * radius)
            dst->list[all++] = dst->list[i];
    rx_candidates_sort(dst->list, near);
    rx_candidates_sort(dst->list + near, all - near);
    *n = near < MOST_STARS ? near : MOST_STARS;
    dst->n = all < MOST_STARS ? all : MOST_STARS;
    return RX_OK;
}

/* Radius of the core of a saturated star that is of no use, from the pixels at `level` (ADU) or above and hidden ones
 * along eight directions. 0: none, cut by the border, or bled, which makes it long. */
static double saturated_core(const rx_image *image, const rx_source *s, double level)
{
    double longest = 0.0, shortest = HUGE_VAL;
    if ((s->flags & RX_FLAG_TRUNCATED) != 0 || ((s->flags & RX_FLAG_SATURATED) == 0 && !(s->peak >= level)))
        return 0.0;
    for (int k = 0; k < 9; k++) {
        const int dx = k % 3 - 1, dy = k / 3 - 1;
        int n = 0;
        for (; k != 4; n++) {
            const int x = (int)lround(s->x) + n * dx, y = (int)lround(s->y) + n * dy;
            if (x < 0 || y < 0 || x >= image->width || y >= image->height)
                return 0.0;
            const size_t at = (size_t)y * (size_t)image->width + (size_t)x;
            if (!rx_image_hides(image, at) && (double)image->pixels[at] < level)
                break;
        }
        if (k != 4) {
            longest = fmax(longest, n * hypot(dx, dy));
            shortest = fmin(shortest, n * hypot(dx, dy));
        }
    }
    return shortest > 0.0 && longest <= 2.0 * shortest + 2.0 ? longest : 0.0;
}

/* Points and the plane of what is used. */
static rx_status gather(rx_psf_job *job, const rx_star_list *stars, int near, double radius, rx_error *err)
{
    const rx_image *image = job->image;
    const rx_sources *sources = job->sources;
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    const size_t stamp = (size_t)(2 * job->model.half + 1) * (size_t)(2 * job->model.half + 1);
    const rx_map sky = rx_image_sky(image);
    int most = 0;
    for (int i = 0; i < sources->n; i++)
        most = sources->list[i].segment > most ? sources->list[i].segment : most;
    unsigned char *extended = RX_NEW(unsigned char, (size_t)most + 1),
                  *star = RX_NEW(unsigned char, 2 * (size_t)sources->n + 1), *ringed = star + sources->n;
    job->points = RX_NEW(rx_psf_point, (size_t)sources->n + 1);
    job->used = RX_NEW(unsigned char, pixels);
    job->rest = RX_NEW(float, pixels);
    rx_status status = RX_OK;
    if (extended == NULL || star == NULL || job->points == NULL || job->used == NULL || job->rest == NULL) {
        status = rx_error_memory(err, pixels * 5);
        goto exit;
    }
    for (int i = 0; i < stars->n; i++) {
        star[stars->list[i].source] = i < near ? 1 : WIDER;
        ringed[stars->list[i].source] = i < MOST_RINGED;
    }
    const double flat = SATURATES * fmin(image->saturation, stars->limit); /* HUGE_VAL: not known */
    double peak = 0.0;
    for (int i = 0; i < job->model.side * job->model.side; i++)
        peak = fmax(peak, (double)job->prior[i]);
    for (int i = 0; i < sources->n; i++) {
        const rx_source *s = &sources->list[i];
        const double snr = s->fluxerr_auto > 0.0 ? s->flux_auto / s->fluxerr_auto : 0.0;
        if (!(s->peak > 0.0) ||
            !(s->x >= 0.0 && s->y >= 0.0 && s->x <= image->width - 1 && s->y <= image->height - 1))
            continue;
        double core = 0.0;
        if (!star[i] && (s->flux_radius[0] > POINT * radius || (s->flags & RX_FLAG_SATURATED) != 0) &&
            snr > 7.0) {
            core = saturated_core(image, s, flat);
            if (s->segment > 0)
                extended[s->segment] = core > 0.0 ? RX_PSF_OWN : 1;
            if (!(core > 0.0))
                continue;
        }
        rx_psf_point *p = &job->points[job->n++];
        *p = (rx_psf_point){.source = i,
                            .x = s->x,
                            .y = s->y,
                            .flux = core > 0.0 ? 0.0 : s->peak / peak,
                            .damping = 1.0,
                            .star = star[i] != 0,
                            .ringed = ringed[i],
                            .saturated = core};
        p->wider = star[i] == WIDER;
        p->kept = star[i] == 1;
        p->sky = p->sky_guess = (double)rx_map_at(&sky, (int)lround(s->x), (int)lround(s->y));
        p->sky_error = MESH_ERROR * fmax(image->global_noise, 1e-30);
        if (!p->star)
            continue;
        p->data = RX_NEW(float, 2 * stamp);
        p->weight = p->data + stamp;
        if (p->data == NULL) {
            status = rx_error_memory(err, 0);
            goto exit;
        }
        p->reserved = near >= 10 && !p->wider && rx_random_uniform(SEED, RESERVE, (uint64_t)i) < RESERVED;
    }
    for (size_t k = 0; k < pixels; k++) {
        const int32_t owner = sources->segments != NULL ? sources->segments[k] : 0;
        const int kind = owner > 0 && owner <= most ? extended[owner] : 0;
        job->used[k] = rx_image_hides(image, k) || kind == 1                   ? 0
                       : kind == RX_PSF_OWN && (double)image->pixels[k] < flat ? RX_PSF_OWN
                                                                               : kind == 0;
    }
    status = leave_out_far(job, err);
    if (status == RX_OK)
        status = set_damping(job, err);
exit:
    free(extended);
    free(star);
    return status;
}

static void free_job(rx_psf_job *job)
{
    for (int i = 0; i < job->n; i++)
        free(job->points[i].data);
    free(job->points);
    free(job->rest);
    free(job->used);
    free(job->prior);
    free(job->values);
    free(job->stamps);
    rx_psf_model_free(&job->model);
}

/* ---- the profile that the core is held to ---- */

/* The Moffat of the tile, as first profile of core and wing. */
static void fill_moffat(rx_psf_job *job)
{
    rx_psf_model *model = &job->model;
#pragma omp parallel for schedule(static) num_threads(job->nthreads)
    for (int k = 0; k < model->side * model->side; k++)
        job->values[k] = rx_moffat_pixel(&job->profile, (k % model->side - model->middle) / (double)model->m,
                                         (k / model->side - model->middle) / (double)model->m, NULL);
    for (int i = 0; i < model->nwing; i++) {
        const double r = i * RX_PSF_WING_STEP / job->profile.hwhm;
        model->wing[i] = (float)exp(-job->profile.beta * log1p(job->profile.k * r * r));
    }
}

/* Sum 1 within the radius, of core and wing; fluxes go up by what the profile goes down, and coefficients follow it. */
static rx_status normalise(rx_psf_job *job, double radius, rx_error *err)
{
    rx_psf_model *model = &job->model;
    const size_t n = (size_t)model->side * (size_t)model->side;
    const int reach = (int)radius;
    double *nodes = RX_NEW(double, n), sum = 0.0;
    if (nodes == NULL)
        return rx_error_memory(err, n * sizeof(double));
    for (int j = -reach; j <= reach; j++)
        for (int i = -reach; i <= reach; i++)
            if (i * i + j * j <= radius * radius)
                sum += abs(i) <= model->half && abs(j) <= model->half
                           ? job->values[(size_t)(model->middle + j * model->m) * (size_t)model->side +
                                         (size_t)(model->middle + i * model->m)]
                           : (double)rx_psf_model_wing(model, hypot(i, j));
    for (size_t k = 0; k < n; k++)
        nodes[k] = job->values[k] /= sum;
    rx_psf_model_interpolate(model, nodes);
    for (size_t k = 0; k < n; k++)
        job->prior[k] = (float)nodes[k];
    for (int i = 0; i < model->nwing; i++)
        model->wing[i] /= (float)sum;
    for (int k = 0; k < job->halo.n; k++)
        job->halo.amount[k] /= sum;
    for (int i = 0; i < job->n; i++)
        job->points[i].flux *= sum;
    free(nodes);
    return RX_OK;
}

/* ---- which stars, which degree ---- */

/* Stars that are kept, fitted ones or reserved ones; returns how many. */
static int list_stars(const rx_psf_job *job, int reserved, int *dst)
{
    int n = 0;
    for (int i = 0; i < job->n; i++)
        if (job->points[i].kept && job->points[i].reserved == reserved)
            dst[n++] = i;
    return n;
}

/* Marks stars that are wider than most by that many sigmas, [n] of shapes, as more of the seven around them are than chance
 * explains (binomial): the PSF is wider there, where galaxies and blends lie everywhere. */
static void find_together(rx_psf_job *job, const rx_star_shape *shapes, double sigmas, double *values,
                          rx_ranked *near)
{
    enum { AROUND = 7 };
    static const double chance = 1e-3;
    double centre, all = 0.0, wider = 0.0;
    size_t m = 0;
    for (int i = 0; i < job->n; i++)
        if (job->points[i].kept && isfinite(shapes[i].off[0]))
            values[m++] = shapes[i].off[0];
    if (m <= AROUND)
        return;
    const double sigma = fmax(rx_sigma_mad(values, m, &centre), FLOORS[0] / 4.0);
    for (int i = 0; i < job->n; i++) {
        values[i] = NAN;
        if (!job->points[i].kept || !isfinite(shapes[i].off[0]))
            continue;
        values[i] = shapes[i].off[0] - centre > sigmas * hypot(sigma, 0.5 * shapes[i].error);
        all += 1.0;
        wider += values[i];
    }
    for (int i = 0; i < job->n; i++) {
        rx_psf_point *p = &job->points[i];
        int n = 0, same = 0;
        for (int j = 0; j < job->n && values[i] > 0.0; j++)
            if (j != i && !isnan(values[j]))
                near[n++] = (rx_ranked){hypot(job->points[j].x - p->x, job->points[j].y - p->y), j};
        if (n < AROUND)
            continue;
        rx_rank(near, (size_t)n);
        for (int k = 0; k < AROUND; k++)
            same += values[near[k].index] > 0.0;
        if (same > 0 && rx_beta_inc(same, AROUND - same + 1.0, wider / all) < chance)
            p->together = 1;
    }
}

/* Leaves out stars whose width, shape or chi2 differs from those of the others by that many robust sigmas, but for those
 * that are wider together: these are excused of all three, and for good, as a corner that the model has begun to follow is
 * less wide and not yet round (taken back each pass, or excused of width alone, one corner of six was lost: fluxes 0.30 mag). */
static rx_status reject(rx_psf_job *job, double sigmas, rx_error *err)
{
    rx_star_shape *shapes = rx_alloc((size_t)job->n + 1, sizeof *shapes);
    double *values = RX_NEW(double, (size_t)job->n + 1);
    rx_ranked *near = RX_NEW(rx_ranked, (size_t)job->n + 1);
    if (shapes == NULL || values == NULL || near == NULL) {
        free(shapes);
        free(values);
        free(near);
        return rx_error_memory(err, 0);
    }
    for (int i = 0; i < job->n; i++) /* who did not suit the last model may suit this one */
        job->points[i].kept = job->points[i].star && job->points[i].chi2 < HUGE_VAL &&
                              (!job->points[i].wider || job->variation.with_wider);
    rx_psf_shapes(job, shapes);
    find_together(job, shapes, sigmas, values, near);
    for (int round = 0; round < 3; round++)
        for (int which = 0; which < 4; which++) {
            size_t m = 0;
            for (int i = 0; i < job->n; i++)
                if (job->points[i].kept && (which == 3 || isfinite(shapes[i].off[which])))
                    values[m++] = which == 3 ? log(job->points[i].chi2 + 0.1) : shapes[i].off[which];
            if (m < 6)
                break;
            double centre;
            const double sigma = fmax(rx_sigma_mad(values, m, &centre), FLOORS[which] / 4.0);
            for (int i = 0; i < job->n; i++) {
                rx_psf_point *p = &job->points[i];
                const double off = (which == 3 ? log(p->chi2 + 0.1) : shapes[i].off[which]) - centre;
                const double limit = sigmas * hypot(sigma, which == 3 ? 0.0 : 0.5 * shapes[i].error);
                if (p->kept && (!isfinite(off) || (!p->together && (which == 3 ? off : fabs(off)) > limit)))
                    p->kept = 0;
            }
        }
    free(shapes);
    free(values);
    free(near);
    return RX_OK;
}

/* chi2 of each of the stars against the model of the other folds. */
static rx_status held_out(const rx_psf_job *job, const int *stars, int n, int pixels, double *chi2,
                          rx_error *err)
{
    rx_psf_model model = {.m = 0};
    int *part = RX_NEW(int, 2 * (size_t)n + 1);
    double *values = RX_NEW(double, (size_t)n + 1);
    rx_status status = part == NULL || values == NULL ? rx_error_memory(err, 0)
                                                      : rx_psf_model_copy(&job->model, &model, err);
    for (int fold = 0; fold < FOLDS && status == RX_OK; fold++) {
        int fitted = 0, out = 0, *away = part + n;
        for (int i = 0; i < n; i++) {
            const int mine =
                (int)(FOLDS * rx_random_uniform(SEED, FOLD, (uint64_t)job->points[stars[i]].source));
            if (mine == fold)
                away[out++] = stars[i];
            else
                part[fitted++] = stars[i];
        }
        status = rx_psf_job_solve(job, part, fitted, pixels, &model, err);
        if (status == RX_OK)
            status = rx_psf_job_chi2(job, &model, away, out, values, err);
        for (int i = 0, k = 0; i < n; i++)
            if (k < out && stars[i] == away[k])
                chi2[i] = values[k++];
    }
    rx_psf_model_free(&model);
    free(part);
    free(values);
    return status;
}

/* Pixels are freer where stars that were held out, the brightest, fit better by more than the scatter of that from star to
 * star. */
static rx_status choose_pixels(const rx_psf_job *job, const int *stars, int n, int *best, rx_log *log,
                               rx_error *err)
{
    const int m = n < CHOSEN_BY ? n : CHOSEN_BY;
    double *least = RX_NEW(double, 2 * (size_t)m + 1), *chi2 = least + m;
    rx_ranked *order = RX_NEW(rx_ranked, (size_t)n + 1);
    int *some = RX_NEW(int, (size_t)m + 1);
    rx_status status = least == NULL || some == NULL || order == NULL ? rx_error_memory(err, 0) : RX_OK;
    for (int i = 0; i < n && status == RX_OK; i++)
        order[i] = (rx_ranked){job->points[stars[i]].flux, stars[i]};
    if (status == RX_OK)
        rx_rank_falling(order, (size_t)n);
    for (int i = 0; i < m && status == RX_OK; i++)
        some[i] = order[i].index;
    *best = RX_PSF_STIFF;
    for (int next = RX_PSF_STIFF; next < RX_PSF_FREEDOMS && status == RX_OK; next++) {
        if (next == RX_PSF_LOOSE_ALL && job->variation.degree == 0)
            break;
        status = held_out(job, some, m, next, chi2, err);
        double mean = 0.0, square = 0.0;
        for (int i = 0; i < m && next > RX_PSF_STIFF; i++) {
            const double gain =
                MOST_GAIN * asinh((least[i] - chi2[i]) / MOST_GAIN); /* no star decides alone */
            mean += gain / m;
            square += gain * gain / m;
        }
        const double error = sqrt(fmax(square - mean * mean, 0.0) / m);
        if (next > RX_PSF_STIFF)
            rx_log_detail(log,
                          "PSF_TYPE AUTO: pixels %d: stars held out fit better by %.3g +- %.2g than with %d",
                          next, mean, error, *best);
        if (status == RX_OK && (next == RX_PSF_STIFF || mean > error)) {
            *best = next;
            memcpy(least, chi2, (size_t)m * sizeof *least);
        }
    }
    free(least);
    free(some);
    free(order);
    return status;
}

/* ---- the result ---- */

/* Coefficients of the Legendre polynomials by powers. */
static const double POWERS[RX_PSF_DEGREE + 1][RX_PSF_DEGREE + 1] = {
    {1},
    {0, 1},
    {-0.5, 0, 1.5},
    {0, -1.5, 0, 2.5},
    {0.375, 0, -3.75, 0, 4.375},
    {0, 1.875, 0, -8.75, 0, 7.875},
    {-0.3125, 0, 6.5625, 0, -19.6875, 0, 14.4375}};

/* The least of the sum of the terms but the first over X, Y in -1..1, at 9 x 9 places; a term's are `stride` apart. */
static double lowest(const double *sums, size_t stride, int nterms, const int *px, const int *py)
{
    double least = 0.0;
    for (int place = 0; place < 81; place++) {
        double powers[2][RX_PSF_DEGREE + 1] = {{1.0}, {1.0}}, sum = 0.0;
        for (int d = 1; d <= RX_PSF_DEGREE; d++) {
            powers[0][d] = powers[0][d - 1] * (place % 9 / 4.0 - 1.0);
            powers[1][d] = powers[1][d - 1] * (place / 9 / 4.0 - 1.0);
        }
        for (int b = 1; b < nterms; b++)
            sum += sums[(size_t)b * stride] * powers[0][px[b]] * powers[1][py[b]];
        least = fmin(least, sum);
    }
    return least;
}

/* Basis images: the terms on the pixels (of a narrow PSF on samples between them, too), as monomials of the position; sums
 * 1, 0, 0, ... */
static rx_status build(const rx_psf_job *job, double fwhm, double radius, rx_psf **dst, rx_error *err)
{
    const rx_psf_model *model = &job->model;
    const int fine = rx_psf_narrow_samples(fwhm), reach = (int)radius, size = 2 * reach + 1,
              side = fine * (size - 1) + 1, middle = side / 2;
    const int half = model->half < reach ? model->half : reach, core = 2 * half + 1;
    const size_t n = (size_t)side * (size_t)side, nodes = (size_t)model->side * (size_t)model->side;
    rx_psf *psf = rx_psf_new(RX_PSF_AUTO, size, model->nterms);
    float *stamp = RX_NEW(float, (size_t)core *(size_t)core), *work = RX_NEW(float, rx_psf_model_work(model));
    double *sums = RX_NEW(double, (size_t)model->nterms *n);
    rx_status status = RX_OK;
    if (psf == NULL || stamp == NULL || work == NULL || sums == NULL ||
        (fine > 1 && !rx_psf_sample(psf, fine))) {
        status = rx_error_memory(err, (size_t)model->nterms * n * sizeof(double));
        goto exit;
    }
    int px[RX_PSF_TERMS], py[RX_PSF_TERMS];
    rx_psf_model_powers(model->degree, px, py);
    const double most2 = radius * radius * fine * fine;
    for (int k = 0; k < model->nterms * fine * fine; k++) {
        const int term = k / (fine * fine), phase = k % (fine * fine), a = phase % fine - (fine - 1) / 2,
                  c = phase / fine - (fine - 1) / 2; /* samples from the pixels' centres */
        rx_psf_model_stamp(model, model->c + (size_t)term * nodes, -(double)a / fine, -(double)c / fine, half,
                           &(rx_psf_stamp){stamp, NULL, NULL, work});
        for (int b = 0; b < model->nterms; b++) {
            const double factor = POWERS[px[term]][px[b]] * POWERS[py[term]][py[b]];
            for (int j = -half; j <= half && factor != 0.0; j++)
                for (int i = -half; i <= half; i++) {
                    const int x = fine * i + a, y = fine * j + c;
                    if (x * x + y * y <= most2 && abs(x) <= fine * half && abs(y) <= fine * half)
                        sums[(size_t)b * n + (size_t)(y + middle) * (size_t)side + (size_t)(x + middle)] +=
                            factor * (double)stamp[(size_t)(j + half) * (size_t)core + (size_t)(i + half)];
                }
        }
    }
    for (int j = -middle; j <= middle; j++)
        for (int i = -middle; i <= middle; i++)
            if ((abs(i) > fine * half || abs(j) > fine * half) && i * i + j * j <= most2)
                sums[(size_t)(j + middle) * (size_t)side + (size_t)(i + middle)] +=
                    (double)rx_psf_model_wing(model, hypot((double)i / fine, (double)j / fine));
    for (size_t i = 0; i < n; i++) { /* nothing below 0 anywhere */
        double most = 0.0;
        sums[i] = fmax(sums[i], 0.0);
        for (int b = 1; b < model->nterms; b++)
            most += fabs(sums[(size_t)b * n + i]);
        if (most <= sums[i])
            continue;
        const double least = lowest(sums + i, n, model->nterms, px, py);
        for (int b = 1; b < model->nterms && -least > sums[i]; b++)
            sums[(size_t)b * n + i] *= sums[i] / -least;
    }
    double whole = 0.0;
    for (int j = 0; j < side; j += fine)
        for (int i = 0; i < side; i += fine)
            whole += sums[j * side + i];
    psf->nbasis = 0;
    for (int b = 0; b < model->nterms; b++) {
        const double *term = sums + (size_t)b * n;
        double sum = 0.0, moved = 0.0;
        for (int j = 0; j < side && b > 0; j += fine)
            for (int i = 0; i < side; i += fine) {
                sum += term[j * side + i];
                moved += fabs(term[j * side + i]);
            }
        if (b > 0 && moved < LEAST_TERM * whole)
            continue;
        float *image = (fine > 1 ? psf->samples : psf->basis) + (size_t)psf->nbasis * n;
        for (size_t i = 0; i < n; i++)
            image[i] = (float)((term[i] - sum / whole * sums[i]) / whole);
        psf->px[psf->nbasis] = px[b];
        psf->py[psf->nbasis++] = py[b];
        psf->quality.degree = px[b] + py[b] > psf->quality.degree ? px[b] + py[b] : psf->quality.degree;
    }
    if (fine > 1)
        rx_psf_pick(psf);
    psf->x0 = model->x0;
    psf->y0 = model->y0;
    psf->xs = model->xs;
    psf->ys = model->ys;
    *dst = psf;
    psf = NULL;
exit:
    rx_psf_free(psf);
    free(stamp);
    free(work);
    free(sums);
    return status;
}

/* What headers say of it. */
static rx_status describe(const rx_psf_job *job, const rx_psf *moffat, int candidates, rx_psf *psf,
                          rx_error *err)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    float *stamp = RX_NEW(float, n);
    psf->stars = rx_alloc((size_t)job->n + 1, sizeof *psf->stars);
    if (stamp == NULL || psf->stars == NULL) {
        free(stamp);
        return rx_error_memory(err, 0);
    }
    rx_psf_at(psf, psf->x0, psf->y0, stamp);
    rx_status status = rx_psf_shape(stamp, psf->size, &psf->fwhm, &psf->ellipticity, NULL, err);
    free(stamp);
    for (int i = 0; i < job->n; i++)
        if (job->points[i].kept && !job->points[i].reserved) {
            psf->stars[psf->nstars][0] = job->points[i].x;
            psf->stars[psf->nstars++][1] = job->points[i].y;
        }
    psf->beta = moffat->beta;
    psf->fwhm_error = moffat->fwhm_error;
    psf->quality.limit = moffat->quality.limit;
    snprintf(psf->description, sizeof psf->description,
             "AUTO: pixels to %d px, wings to %.0f px, FWHM %.3f px, ellipticity %.3f, degree %d, from %d of "
             "%d candidate stars",
             job->model.half, psf->quality.radius, psf->fwhm, psf->ellipticity, psf->quality.degree,
             psf->nstars, candidates);
    return status;
}

/* What users should know before they use its fluxes. */
static void warn(const rx_psf_quality *q, const rx_psf_variation *v, rx_log *log)
{
    if (fabs(v->missed) > 0.02)
        rx_log_warning(log,
                       "PSF_TYPE AUTO: around (%.0f, %.0f) stars are %.1f %% %s than the PSF, whose "
                       "degree over the tile is %d; errors of fluxes there hold it",
                       v->missed_at[0] + 1.0, v->missed_at[1] + 1.0, 100.0 * fabs(v->missed),
                       v->missed > 0.0 ? "wider" : "narrower", v->degree);
    if (fabs(q->growth) > 0.01)
        rx_log_warning(log,
                       "PSF_TYPE AUTO: within %.1f pixels stars have %.1f %% %s light than the PSF; fluxes "
                       "of templates may be off by as much",
                       q->growth_radius, 100.0 * fabs(q->growth), q->growth > 0.0 ? "more" : "less");
    if (q->hidden > 0.01)
        rx_log_warning(log,
                       "PSF_TYPE AUTO: stars are too faint to show wings of the PSF that hold less than some "
                       "%.0f %% of the light; fluxes of templates may be off by %.1f %%, which is part of "
                       "their errors",
                       200.0 * q->hidden, 100.0 * q->hidden);
    if (q->beyond > 0.01)
        rx_log_warning(log,
                       "PSF_TYPE AUTO: %.1f %% of the light of stars lies beyond the PSF's %.0f pixels; "
                       "fluxes of templates are without it",
                       100.0 * q->beyond, q->radius);
    if (q->reserved >= 5 && fabs(q->trace[0]) > fmax(0.01, 5.0 * q->trace[1]))
        rx_log_warning(log,
                       "PSF_TYPE AUTO: %d stars that were not fitted are %.1f %% %s in area than the PSF",
                       q->reserved, 100.0 * fabs(q->trace[0]), q->trace[0] > 0.0 ? "larger" : "smaller");
}

/* Model, prior and room of the threads. */
static rx_status open_job(const rx_psf_params *par, const rx_psf *moffat, rx_psf_job *job, rx_error *err)
{
    const rx_image *image = job->image;
    const int least = image->width < image->height ? image->width : image->height;
    const int most = (least - 1) / 2; /* a stamp is no larger than the tile */
    int half = (int)ceil(fmax(3.5 * job->fwhm, 6.0));
    half = half > most ? most : half > RX_PSF_HALF ? RX_PSF_HALF : half;
    const int reach = (int)fmax(half, fmin(ceil(20.0 * job->fwhm), least / 3));
    const int m = (int)fmin(fmax(ceil(6.0 / moffat->fwhm), 1.0), 4.0);
    RX_TRY(rx_psf_model_new(m, half, reach, image->width, image->height, &job->model, err));
    const rx_psf_model *model = &job->model;
    const size_t nodes = (size_t)model->side * (size_t)model->side,
                 stamp = (size_t)(2 * half + 1) * (size_t)(2 * half + 1);
    job->most = par->size > 0 ? par->size / 2 : most;
    job->nthreads = par->nthreads > 1 ? par->nthreads : 1;
    job->prior = RX_NEW(float, nodes);
    job->values = RX_NEW(double, nodes);
    job->stamps = RX_NEW(float, (size_t)job->nthreads *(nodes + 3 * stamp + rx_psf_model_work(model)));
    return job->prior != NULL && job->values != NULL && job->stamps != NULL ? RX_OK : rx_error_memory(err, 0);
}

/* The last step moves none, so that the stars' stamps are of the pixels around their positions. */
static rx_status steps(rx_psf_job *job, int n, rx_error *err)
{
    for (int i = 0; i <= n; i++)
        RX_TRY(rx_psf_job_step(job, i < n, err));
    return RX_OK;
}

rx_status rx_psf_measure(const rx_psf_params *par, const rx_image *image, const rx_sources *sources,
                         rx_log *log, rx_psf **dst, rx_error *err)
{
    rx_psf *moffat = NULL;
    rx_moffat_tile found;
    rx_star_list stars = {.n = 0};
    rx_psf_job job = {
        .image = image, .sources = sources, .model_error = MODEL_ERROR, .variation = {.nterms = 1}};
    int *fitted = NULL, near = 0, n = 0;
    *dst = NULL;
    RX_TRY(rx_psf_fit_moffat(par, image, sources, log, &found, &moffat, err));
    job.fwhm = hypot(moffat->fwhm, 0.8); /* of the star on pixels */
    rx_status status = open_job(par, moffat, &job, err);
    if (status == RX_OK)
        status = choose_stars(par, &job, found.radius, &stars, &near, err);
    if (status != RX_OK)
        goto exit;
    if (moffat->fwhm > WIDEST || near < LEAST_STARS || moffat->quality.how != RX_PSF_BY_MOFFAT) {
        *dst = moffat;
        moffat = NULL;
        goto exit;
    }
    rx_moffat_set(&job.profile, found.shape);
    fill_moffat(&job);
    rx_psf_wing wing = {.radius = fmin((job.model.nwing - 2) * RX_PSF_WING_STEP, job.most)};
    status = normalise(&job, wing.radius, err);
    if (status == RX_OK) {
        memcpy(job.model.c, job.prior, sizeof(float) * (size_t)job.model.side * (size_t)job.model.side);
        status = gather(&job, &stars, near, found.radius, err);
    }
    fitted = RX_NEW(int, (size_t)job.n + 1);
    if (status == RX_OK && fitted == NULL)
        status = rx_error_memory(err, 0);
    if (status == RX_OK)
        status = rx_psf_job_subtract(&job, err);
    if (status == RX_OK)
        status = steps(&job, 3, err);
    int pixels = RX_PSF_STIFF;
    for (int pass = 0; pass < PASSES && status == RX_OK; pass++) {
        status = rx_interrupt_check(err);
        if (status == RX_OK)
            status = reject(&job, pass == 0 ? 12.0 : pass == 1 ? 6.0 : 4.0, err);
        if (status == RX_OK)
            status = rx_psf_wings(&job, BEYOND, &wing, log, err);
        if (status == RX_OK)
            status = normalise(&job, wing.radius, err);
        if (status == RX_OK)
            status = rx_psf_vary(&job, par->max_degree, log, err);
        n = list_stars(&job, 0, fitted);
        if (status == RX_OK && pass == CHOICE)
            status = choose_pixels(&job, fitted, n, &pixels, log, err);
        if (status == RX_OK)
            status = rx_psf_job_solve(&job, fitted, n, pixels, &job.model, err);
        if (status == RX_OK)
            status = rx_psf_job_subtract(&job, err);
        if (status == RX_OK)
            status = steps(&job, 2, err);
        if (status == RX_OK)
            status = rx_psf_job_measure_error(&job, err);
        rx_log_detail(log, "PSF pass %d: %d stars, pixels of the model +- %.2g of their light", pass, n,
                      job.model_error);
    }
    if (status == RX_OK && n < LEAST_FITTED) {
        rx_log_warning(log, "PSF_TYPE AUTO: %d stars suit one another; the PSF is their elliptical Moffat",
                       n);
        *dst = moffat;
        moffat = NULL;
        goto exit;
    }
    if (status == RX_OK)
        status = build(&job, moffat->fwhm, wing.radius, dst, err);
    if (status == RX_OK) {
        rx_psf_quality *q = &(*dst)->quality;
        q->how = RX_PSF_BY_PIXELS;
        status = rx_psf_test(&job, &wing, *dst, err);
        if (n < FEW) /* that test themselves */
            q->flux_error = hypot(q->flux_error, FEW_ERROR);
    }
    if (status == RX_OK)
        status = describe(&job, moffat, near, *dst, err);
    if (status == RX_OK) {
        warn(&(*dst)->quality, &job.variation, log);
        /* the first stars were sharper than those that suit one another in the end */
        if (moffat->quality.sharper == 0 && moffat->fwhm < 0.9 * (*dst)->fwhm)
            rx_stars_set_sharper(moffat->nstars, moffat->fwhm / (*dst)->fwhm, &(*dst)->quality, log);
        else if (moffat->quality.sharper > 0) /* the warning was given */
            rx_stars_set_sharper(moffat->quality.sharper, moffat->quality.sharpness, &(*dst)->quality, NULL);
    }
exit:
    rx_psf_free(moffat);
    rx_star_list_free(&stars);
    free(fitted);
    free_job(&job);
    if (status != RX_OK) {
        rx_psf_free(*dst);
        *dst = NULL;
    }
    return status;
}
