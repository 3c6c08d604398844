/* What PSF_TYPE AUTO starts from: choose among the sources of a list those that are stars, fit them one by one, leave out
 * what does not agree, then fit one elliptical Moffat to all of them together.
 *
 * Weights: 1/sigma^2 with sigma^2 = sky noise^2 + star / gain + (2 % of the star)^2; the last term keeps the
 * few brightest stars, on which a Moffat never fits to the noise, from deciding alone.
 */
#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/map.h"
#include "num/lsq.h"
#include "num/stats.h"
#include "psf/moffat_fit.h"
#include "psf/psf.h"
#include "psf/psf_stars.h"

static const double model_error = 0.02;
/* Error of fluxes, relative, by what a Moffat does not describe: where five stars or more say its shape, and where its
 * exponent is assumed. Rms of small tiles with known PSFs of six kinds: validation/results/psf (few stars). */
static const double NOT_MOFFAT = 0.04, FEW_STARS = 0.05;

enum { FULL = 5, ALIKE = 3 }; /* stars that a profile needs; that say they are stars by being alike */

typedef struct fitted_star {
    const rx_source *source;
    rx_moffat_pixels pixels; /* x, y of the tile; value above the background */
    double *noise;           /* [n] sky noise of each pixel */
    rx_moffat_fit fit;
    double fwhm, chi2; /* chi2 per degree of freedom */
    int kept;          /* -1: not by the present fit */
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
    profile.rough = 1;
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
    star->fit = (rx_moffat_fit){.peak = s->peak, .x = s->x, .y = s->y, .rough = 1};
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

/* 1 / exponent that profiles of stars have about 1 / PSF_BETA, 1 sigma on either side. Kolmogorov's turbulence is fitted by 4.765
 * (Trujillo et al. 2001, MNRAS 328, 977). Scattered light makes wings, down to 2.5 (Moffat 1969, A&A 3, 455), taken as 2 sigma: one
 * instrument in 40 has more; jitter and charges that spread make it smoother, up to 6 or so, taken as 1 sigma. */
static const double WINGS = (1.0 / 2.5 - 1.0 / 4.765) / 2.0, SMOOTH = 1.0 / 4.765 - 1.0 / 6.0;

/* The shape that stars share, where it starts, and what is known of it without them: prior +- width (0: nothing); of the last,
 * 1 / exponent, +width -less. */
typedef struct joint_fit {
    double shape[RX_MOFFAT_SHAPE], prior[RX_MOFFAT_SHAPE], width[RX_MOFFAT_SHAPE], less;
    double error[RX_MOFFAT_SHAPE];
} joint_fit;

enum { EXPONENT = RX_MOFFAT_SHAPE - 1 };

static double exponent_width(const joint_fit *fit, double u)
{
    return u < fit->prior[EXPONENT] ? fit->less : fit->width[EXPONENT];
}

/* Of u = 1 / exponent by the parameter that stands for it. */
static double exponent_slope(double u)
{
    return u * (1.0 - u / RX_MOFFAT_U_MAX);
}

typedef struct joint_task {
    const fitted_star *stars;
    int n, nthreads;
    size_t *first; /* [n] residual of each star; then those of the prior */
    size_t prior;
    const joint_fit *fit;
} joint_task;

/* Peak and sky of one star follow by linear least squares (variable projection, Golub and Pereyra 1973, SIAM J. Numer. Anal. 10,
 * 413), with Kaufman's (1975, BIT 15, 49) derivatives; its centre stays where the single fit put it. 0: they do not follow. */
static int joint_star(const fitted_star *star, const rx_moffat *profile, double *residuals, double *jacobian)
{
    enum { nfree = RX_MOFFAT_SHAPE };
    const rx_moffat_pixels *p = &star->pixels;
    double w1 = 0.0, wf = 0.0, wff = 0.0, wv = 0.0, wfv = 0.0;
    double wg[RX_MOFFAT_SHAPE] = {0.0}, wfg[RX_MOFFAT_SHAPE] = {0.0};
    for (int i = 0; i < p->n; i++) {
        double g[2 + RX_MOFFAT_SHAPE];
        const double f = rx_moffat_pixel(profile, p->x[i] - star->fit.x, p->y[i] - star->fit.y, g);
        const double w = 1.0 / (p->sigma[i] * p->sigma[i]);
        residuals[i] = f;
        w1 += w;
        wf += w * f;
        wff += w * f * f;
        wv += w * p->value[i];
        wfv += w * f * p->value[i];
        for (int k = 0; k < nfree; k++) {
            jacobian[i * nfree + k] = g[2 + k];
            wg[k] += w * g[2 + k];
            wfg[k] += w * f * g[2 + k];
        }
    }
    const double det = w1 * wff - wf * wf;
    if (!(det > 0.0))
        return 0;
    const double peak = (w1 * wfv - wf * wv) / det, sky = (wff * wv - wf * wfv) / det;
    for (int i = 0; i < p->n; i++) {
        const double f = residuals[i];
        residuals[i] = (peak * f + sky - p->value[i]) / p->sigma[i];
        for (int k = 0; k < nfree; k++) {
            double *d = &jacobian[i * nfree + k];
            *d = peak / p->sigma[i] *
                 (*d - f * (w1 * wfg[k] - wf * wg[k]) / det - (wff * wg[k] - wf * wfg[k]) / det);
        }
    }
    return 1;
}

/* All kept stars with one shape. */
static int joint_model(void *user, const double *parameters, double *residuals, double *jacobian)
{
    const joint_task *task = user;
    const joint_fit *fit = task->fit;
    rx_moffat profile;
    for (int k = 0; k < RX_MOFFAT_SHAPE; k++)
        if (!isfinite(parameters[k]))
            return 1;
    rx_moffat_set(&profile, parameters);
    profile.rough = 1;
    for (int k = 0; k < RX_MOFFAT_SHAPE; k++) {
        double *row = jacobian + (task->prior + (size_t)k) * RX_MOFFAT_SHAPE;
        const double value = k == EXPONENT ? profile.u : parameters[k];
        const double width = k == EXPONENT ? exponent_width(fit, value) : fit->width[k];
        memset(row, 0, RX_MOFFAT_SHAPE * sizeof *row);
        row[k] = width > 0.0 ? (k == EXPONENT ? exponent_slope(value) : 1.0) / width : 0.0;
        residuals[task->prior + (size_t)k] = width > 0.0 ? (value - fit->prior[k]) / width : 0.0;
    }
    int failed = 0;
#pragma omp parallel for schedule(dynamic, 1) num_threads(task->nthreads) reduction(| : failed)
    for (int s = 0; s < task->n; s++)
        if (task->stars[s].kept > 0)
            failed |= !joint_star(&task->stars[s], &profile, residuals + task->first[s],
                                  jacobian + task->first[s] * RX_MOFFAT_SHAPE);
    return failed;
}

static rx_status fit_joint(const fitted_star *stars, int n, int nthreads, int steps, joint_fit *fit,
                           rx_error *err)
{
    joint_task task = {.stars = stars,
                       .n = n,
                       .nthreads = nthreads > 1 ? nthreads : 1,
                       .first = RX_NEW(size_t, (size_t)n + 1),
                       .fit = fit};
    if (task.first == NULL)
        return rx_error_memory(err, (size_t)n * sizeof(size_t));
    rx_lsq_problem problem = {.nparameters = RX_MOFFAT_SHAPE,
                              .model = joint_model,
                              .user = &task,
                              .max_iterations = steps,
                              .tolerance = 1e-5};
    for (int i = 0; i < n; i++) {
        task.first[i] = task.prior;
        task.prior += stars[i].kept > 0 ? (size_t)stars[i].pixels.n : 0;
    }
    problem.nresiduals = task.prior + RX_MOFFAT_SHAPE;
    const rx_status status = rx_lsq_fit(&problem, fit->shape, fit->error, NULL, err);
    free(task.first);
    return status;
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

/* Light that a fit by the Moffat `used` finds of a star whose shape is another, less 1: sum(P Q) / sum(P P), both of sum 1. */
static double flux_off(const double used[RX_MOFFAT_SHAPE], const double other[RX_MOFFAT_SHAPE])
{
    const double *const shapes[2] = {used, other};
    rx_moffat profile[2];
    double sum[2] = {0.0}, square = 0.0, product = 0.0;
    for (int k = 0; k < 2; k++)
        rx_moffat_set(&profile[k], shapes[k]);
    const int reach = (int)ceil(fmax(8.0 * fmax(profile[0].hwhm, profile[1].hwhm), 4.0));
    for (int j = -reach; j <= reach; j++)
        for (int i = -reach; i <= reach; i++) {
            const double p = rx_moffat_pixel(&profile[0], i, j, NULL),
                         q = rx_moffat_pixel(&profile[1], i, j, NULL);
            sum[0] += p;
            sum[1] += q;
            square += p * p;
            product += p * q;
        }
    return product / square * sum[0] / sum[1] - 1.0;
}

/* 1 sigma of fluxes, relative, from that of the shape: how they change without each of eight groups of stars, or each star
 * where there are fewer (Kott 2001, J. Official Stat. 17, 521); 0 of many stars, where it is small beside NOT_MOFFAT. */
static rx_status jackknife(fitted_star *stars, int n, int nthreads, const joint_fit *all, double *error,
                           rx_error *err)
{
    enum { GROUPS = 8, MANY = 16, STEPS = 2 }; /* from the shape of all, which is near */
    const int kept = count_kept(stars, n), groups = kept < GROUPS ? kept : GROUPS;
    double sum = 0.0, squares = 0.0;
    rx_status status = RX_OK;
    *error = 0.0;
    if (kept > MANY)
        return RX_OK;
    for (int group = 0; group < groups && status == RX_OK; group++) {
        joint_fit part = *all;
        for (int pass = 0; pass < 2; pass++) { /* out, and in again */
            for (int i = 0, k = 0; i < n; i++)
                if (stars[i].kept != 0 && k++ % groups == group)
                    stars[i].kept = -stars[i].kept;
            if (pass == 0)
                status = fit_joint(stars, n, nthreads, STEPS, &part, err);
        }
        const double off = flux_off(all->shape, part.shape);
        sum += off;
        squares += off * off;
    }
    *error = sqrt(fmax(squares - sum * sum / groups, 0.0) * (groups - 1) / groups);
    return status;
}

/* What SEEING_FWHM needs in pixels. */
static const char *scale_too(const rx_image *image)
{
    return image->wcs == NULL ? " with PIXEL_SCALE" : "";
}

static rx_status too_few(const rx_psf_params *par, const rx_image *image, int found, int needed,
                         rx_error *err)
{
    return rx_error_at(
        err, RX_INPUT, image->name != NULL ? image->name : "", image->hdu, 0,
        "PSF_TYPE AUTO found %d usable star%s of S/N above %g%s and needs %d; give PSF_FWHM in pixels, "
        "SEEING_FWHM in arcsec%s, or a lower PSF_MINSNR",
        found, found == 1 ? "" : "s", par->min_snr,
        par->stars_file != NULL && par->stars_file[0] != '\0' ? " among those of PSF_STARS_NAME" : "", needed,
        scale_too(image));
}

/* Of the mean of single widths, relative, by their scatter: robust of five or more, else the standard deviation, with the 68 %
 * quantile of Student's t; 0 of one. */
static rx_status width_error(const fitted_star *stars, int n, double *error, rx_error *err)
{
    static const double student[] = {0, 0, 1.84, 1.32, 1.20};
    size_t m = 0;
    double *values = RX_NEW(double, n), sum = 0.0, squares = 0.0;
    if (values == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < n; i++)
        if (stars[i].kept) {
            const double value = log(stars[i].fwhm / stars[0].fwhm);
            values[m++] = value;
            sum += value;
            squares += value * value;
        }
    if (m >= FULL)
        *error = rx_sigma_mad(values, m, NULL) / sqrt((double)m);
    else
        *error = m > 1 ? student[m] * sqrt(fmax(squares - sum * sum / m, 0.0) / (double)(m * (m - 1))) : 0.0;
    free(values);
    return RX_OK;
}

static void log_stars(const fitted_star *stars, int n, rx_log *log)
{
    for (int i = 0; i < n; i++)
        rx_log_detail(log, "PSF star at (%.2f,%.2f): FWHM %.3f px, ellipticity %.3f, chi2 %.2f: %s",
                      stars[i].source->x + 1.0, stars[i].source->y + 1.0, stars[i].fwhm,
                      rx_moffat_fit_ellipticity(&stars[i].fit), stars[i].chi2,
                      stars[i].kept ? "used" : "left out");
}

/* One try: the candidates of one half-light radius, fitted and cleaned. */
typedef struct attempt {
    rx_star_list list;
    fitted_star *stars; /* [list.n] */
    int candidates, kept;
    double radius; /* half-light, pixels */
    joint_fit fit;
    double scatter; /* how much the stars differ from each other */
    double bright;  /* flux of the third brightest */
} attempt;

static void free_attempt(attempt *a)
{
    for (int i = 0; a->stars != NULL && i < a->list.n; i++) {
        rx_moffat_pixels_free(&a->stars[i].pixels);
        free(a->stars[i].noise);
    }
    free(a->stars);
    rx_star_list_free(&a->list);
    *a = (attempt){.kept = 0};
}

static rx_status fit_attempt(const rx_star_search *search, attempt *a, rx_error *err)
{
    scene sc = {.image = search->image, .sources = search->sources, .radius = fmax(6.0 * a->radius, 5.0)};
    rx_status status = RX_OK;
    a->stars = RX_NEW(fitted_star, (size_t)a->list.n + 1);
    if (a->stars == NULL)
        return rx_error_memory(err, 0);
    rx_moffat_shape(1.9 * a->radius, 4.0, 1.0, 0.0, a->fit.shape);
#pragma omp parallel for schedule(dynamic, 1)                                                                \
    num_threads(search->par->nthreads > 1 ? search->par->nthreads : 1)
    for (int i = 0; i < a->list.n; i++) {
        rx_error trouble = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
        rx_status one = cut_out(&sc, &sc.sources->list[a->list.list[i].source], &a->stars[i], &trouble);
        if (one == RX_OK)
            one = fit_star(&sc, a->fit.shape, &a->stars[i], &trouble);
        if (one != RX_OK) {
#pragma omp critical(rx_psf_estimate)
            {
                status = one;
                rx_error_take(err, &trouble);
            }
        }
    }
    if (status == RX_OK)
        status = reject_outliers(a->stars, a->list.n, err);
    if (status == RX_OK)
        status = summarise(a->stars, a->list.n, a->fit.shape, &a->scatter, err);
    a->kept = count_kept(a->stars, a->list.n);
    for (int i = 0, k = 0; i < a->list.n && k < 3; i++) /* the list falls in S/N */
        if (a->stars[i].kept && ++k <= 3)
            a->bright = a->stars[i].source->flux_auto;
    return status;
}

/* FWHM of hits of particles, pixels; scatter of stars in width and shape; times the light of specks that stars have. */
static const double NARROW = 1.2, ALIKE_SCATTER = 0.15, OUTSHINES = 10.0;

static double fwhm_of(const attempt *a)
{
    return 2.0 * exp(a->fit.shape[0]);
}

/* Specks and no stars: narrower than 1.2 pixels, few or unlike each other, and wider sources outshine them. */
static int are_specks(const rx_star_search *search, const rx_star_list *candidates, const attempt *a)
{
    int outshone = 0;
    if (fwhm_of(a) >= NARROW)
        return 0;
    for (int i = 0; i < candidates->n; i++)
        outshone |= candidates->list[i].radius > 1.5 * a->radius &&
                    search->sources->list[candidates->list[i].source].flux_auto > OUTSHINES * a->bright;
    return a->kept < ALIKE || (outshone && (a->kept < FULL || a->scatter > ALIKE_SCATTER));
}

/* How far the width is from PSF_FWHM, in its errors: what is called so is 10 % off. 0 where it is not given. */
static double off_stated(const rx_psf_params *par, const attempt *a)
{
    static const double ERROR = 0.1;
    return par->fwhm > 0.0 ? fabs(log(fwhm_of(a) / par->fwhm)) / ERROR : 0.0;
}

/* Stars are alike, galaxies are not: the lower the better. Differences below 1.5 % are noise; few stars count less.
 * Specks (grains, hits of particles, what is left of them) may be as alike as stars and many more, but the brightest
 * sources are stars: whose brightest are fainter is less credible, by the square root of it. PSF_FWHM is a prior. */
static double badness(const rx_psf_params *par, const attempt *a, int enough)
{
    return fmax(a->scatter, 0.015) * exp(0.5 * fmin(pow(off_stated(par, a), 2), 100.0)) *
           sqrt(fmax(1.0, (double)enough / fmax(a->kept, 1.0)) / fmax(a->bright, 1e-300));
}

/* That what was found is galaxies: of one 0.1 (6 of the 60 single ones of simulated tiles with 20 to 500 stars and 200 galaxies
 * per Mpixel are), of two that the other is one as well and as like the first in radius as stars must be, within 10 % of a factor
 * e or so (0.2). */
static double chance_of_galaxies(const attempt *a)
{
    return a->kept >= ALIKE ? 0.0 : a->kept == 2 ? 0.1 * 0.2 : 0.1;
}

/* What fewer than three like objects leave open, relative to their width w (1 sigma). One may be a galaxy on a PSF of any width
 * from a pixel's to w, evenly: rms from w, which is what is stated, (w - 1.2) / sqrt(3). Of two the variance is less by the
 * chance of it. */
static double spread_of(const attempt *a)
{
    const double chance = a->kept == 1 ? 1.0 : chance_of_galaxies(a);
    return fmax(1.0 - NARROW / fwhm_of(a), 0.0) * sqrt(chance / 3.0);
}

/* Whether galaxies are likelier than stars to have the exponent: by 1 / exponent galaxies lie evenly from 0 to its limit, stars as
 * the prior says. It was part of the fit, so faint ones are near to it. */
static int are_galaxies(const attempt *a)
{
    const double chance = chance_of_galaxies(a), most = 2.0 / (sqrt(2.0 * M_PI) * (WINGS + SMOOTH));
    rx_moffat profile;
    rx_moffat_set(&profile, a->fit.shape);
    const double off = (profile.u - a->fit.prior[EXPONENT]) / exponent_width(&a->fit, profile.u);
    return (1.0 - chance) * most * exp(-0.5 * off * off) < chance / RX_MOFFAT_U_MAX;
}

/* Try each place where candidates crowd in radius; *best (to be freed) is the one whose members are most
 * alike. */
static rx_status search_stars(rx_star_search *search, int needed, int enough, attempt *best, int *found,
                              rx_error *err)
{
    rx_status status = RX_OK;
    for (search->level = 0; search->level < 2 && best->kept < enough && status == RX_OK; search->level++) {
        rx_star_list candidates;
        double radii[RX_LOCI_MAX];
        int nloci = 0;
        status = rx_stars_candidates(search, &candidates, err);
        if (status == RX_OK)
            status = rx_stars_loci(search, &candidates, radii, &nloci, err);
        for (int k = 0; k < nloci && status == RX_OK; k++) {
            attempt a = {.candidates = candidates.n, .radius = radii[k]};
            status = rx_stars_near(search, &candidates, &a.radius, &a.list, err);
            if (status == RX_OK)
                status = fit_attempt(search, &a, err);
            *found = a.kept > *found ? a.kept : *found;
            if (status == RX_OK && a.kept >= needed && !are_specks(search, &candidates, &a) &&
                (best->kept == 0 || badness(search->par, &a, enough) < badness(search->par, best, enough))) {
                attempt swap = *best;
                *best = a;
                a = swap;
            }
            free_attempt(&a);
        }
        rx_star_list_free(&candidates);
    }
    return status;
}

/* The tile's PSF from the shape, with what is known of its making. */
static rx_status build(const rx_psf_params *par, const rx_image *image, const attempt *best, rx_psf **dst,
                       rx_error *err)
{
    double scatter = 0.0;
    const fitted_star *stars = best->stars;
    const int n = best->list.n;
    rx_moffat profile;
    rx_moffat_set(&profile, best->fit.shape);
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
        status = width_error(stars, n, &scatter, err);
    if (status != RX_OK)
        goto exit;
    psf->fwhm_error = fwhm * hypot(hypot(best->fit.error[0], scatter), spread_of(best));
    psf->type = par->type;
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

/* With fewer stars than a profile needs: those of any radius, the narrowest of which is taken where several have as many
 * (stars are narrower than galaxies), unless fainter sources are narrower than it. *sizes: how many there were. */
static rx_status search_few(rx_star_search *search, attempt *best, int *sizes, rx_error *err)
{
    rx_star_list candidates = {.n = 0};
    const double bound = rx_psf_bound(search->par, search->image, search->sources);
    double last = 0.0;
    *sizes = 0;
    search->level = 1;
    RX_TRY(rx_stars_candidates(search, &candidates, err));
    rx_status status = RX_OK;
    for (int tries = 0; tries < candidates.n && *sizes < RX_LOCI_MAX && status == RX_OK; tries++) {
        attempt a = {.candidates = candidates.n, .radius = HUGE_VAL};
        for (int i = 0; i < candidates.n; i++)
            if (candidates.list[i].radius > 1.1 * last)
                a.radius = fmin(a.radius, candidates.list[i].radius);
        if (!isfinite(a.radius))
            break;
        last = a.radius;
        if (bound > 0.0 && 2.0 * a.radius > 1.2 * bound) /* half the light of wings lies farther out */
            break;
        status = rx_stars_near(search, &candidates, &a.radius, &a.list, err);
        if (status == RX_OK)
            status = fit_attempt(search, &a, err);
        if (status == RX_OK && are_specks(search, &candidates, &a))
            a.kept = 0;
        *sizes += a.kept > 0;
        if (status == RX_OK && a.kept > best->kept) {
            attempt swap = *best;
            *best = a;
            a = swap;
        }
        free_attempt(&a);
    }
    rx_star_list_free(&candidates);
    return status;
}

/* From which level of the pixels on (ADU) stars, of that half-light radius, are flattened, and how many there are; as it
 * was where none are. */
static rx_status find_limit(const rx_star_search *search, double radius, double *limit, int *flattened,
                            rx_error *err)
{
    const rx_star_search all = {.par = search->par, .image = search->image, .sources = search->sources};
    rx_star_list candidates = {.n = 0};
    RX_TRY(rx_stars_candidates(&all, &candidates, err));
    rx_status status = rx_stars_flattened(&all, radius, &candidates, err);
    if (status == RX_OK && candidates.flattened > 0) {
        *limit = candidates.limit;
        *flattened = candidates.flattened;
    }
    rx_star_list_free(&candidates);
    return status;
}

/* Again without those that reach the limit. Below it stars are flattened, too, the less the fainter: half as bright ones
 * are taken, as long as they are narrower by more than the error of their width. */
static rx_status search_below(rx_star_search *search, int needed, int enough, attempt *best, int *without,
                              rx_error *err)
{
    rx_status status = RX_OK;
    int narrower = 1, most = 0;
    double error = 0.0;
    *without = 0;
    for (search->share = 1.0; narrower && status == RX_OK; search->share *= 0.5) {
        attempt a = {.kept = 0};
        status = search_stars(search, needed, enough, &a, &most, err);
        if (status == RX_OK)
            status = width_error(a.stars, a.list.n, &error, err);
        narrower = a.kept > 0 && (!*without || a.fit.shape[0] < best->fit.shape[0] - error);
        if (status == RX_OK && narrower) {
            attempt swap = *best;
            *best = a;
            a = swap;
            *without = 1;
        }
        free_attempt(&a);
    }
    return status;
}

/* Of soft saturation; *limit in ADU, 0: none. */
static rx_status leave_out_flattened(rx_star_search *search, int needed, int enough, attempt *best,
                                     rx_log *log, double *limit, rx_error *err)
{
    int flattened = 0, without = 1;
    RX_TRY(find_limit(search, best->radius, limit, &flattened, err));
    if (flattened == 0)
        return RX_OK;
    search->limit = *limit;
    if (needed > 0)
        RX_TRY(search_below(search, needed, enough, best, &without, err));
    RX_TRY(find_limit(search, best->radius, limit, &flattened, err));
    const double level = *limit * (search->par->unit > 0.0 ? search->par->unit : 1.0);
    rx_log_warning(
        log,
        "PSF_TYPE AUTO: %d sources with peaks above %.4g ADU are flattened (soft saturation, a photographic "
        "plate) and their fluxes too low: "
        "the PSF %s; give SATUR_LEVEL %.4g, and a SATUR_KEY that the header lacks, to have them flagged",
        flattened, level,
        without ? "leaves them out" : "may be too wide: without them there are too few stars for it", level);
    return RX_OK;
}

rx_status rx_psf_fit_moffat(const rx_psf_params *par, const rx_image *image, const rx_sources *sources,
                            rx_log *log, rx_moffat_tile *found, rx_psf **dst, rx_error *err)
{
    static const double ROUND = 0.1; /* of one object's ellipse */
    rx_star_search search = {.par = par, .image = image, .sources = sources};
    attempt best = {.kept = 0};
    const int ladder = par->min_stars < FULL;
    int needed = ladder ? FULL : par->min_stars, most = 0, sizes = 0;
    rx_psf_how how = RX_PSF_BY_MOFFAT;
    double limit = 0.0;
    *dst = NULL;
    const int enough = needed > 10 ? needed : 10;
    rx_status status = search_stars(&search, needed, enough, &best, &most, err);
    const int few = status == RX_OK && best.kept == 0 && ladder;
    if (few) {
        status = search_few(&search, &best, &sizes, err);
        if (status == RX_OK && best.kept == 1 && sizes > 1) {
            status = rx_error_at(
                err, RX_INPUT, image->name != NULL ? image->name : "", image->hdu, 0,
                "PSF_TYPE AUTO found sources of %d sizes that may be stars, and no two alike; give "
                "PSF_FWHM in pixels, SEEING_FWHM in arcsec%s, or PSF_STARS_NAME, a list of stars",
                sizes, scale_too(image));
            goto exit;
        }
        if (status == RX_OK && best.kept < par->min_stars)
            free_attempt(&best);
        how = best.kept > 1 ? RX_PSF_BY_MOFFAT_BETA : RX_PSF_BY_WIDTH;
        rx_moffat_shape(2.0, fmax(par->beta, 1.2), 1.0, 0.0, best.fit.prior);
        memcpy(best.fit.shape + 1, best.fit.prior + 1, 3 * sizeof(double));
        best.fit.prior[EXPONENT] = 1.0 / fmax(par->beta, 1.2);
        best.fit.width[EXPONENT] = WINGS;
        best.fit.less = SMOOTH;
        if (best.kept == 1)
            best.fit.width[1] = best.fit.width[2] = ROUND;
    }
    if (status == RX_OK && best.kept == 0)
        status = too_few(par, image, most, ladder ? par->min_stars : needed, err);
    if (status == RX_OK)
        status = leave_out_flattened(&search, few ? 0 : needed, enough, &best, log, &limit, err);
    int sharper = 0;
    double sharpness = 1.0;
    if (status == RX_OK)
        status = rx_stars_sharper(&search, best.radius, &sharper, &sharpness, err);
    if (status == RX_OK) {
        log_stars(best.stars, best.list.n, log);
        if (best.scatter > ALIKE_SCATTER)
            rx_log_warning(
                log,
                "PSF_TYPE AUTO: the %d stars differ by %.0f %% in width and shape; the PSF varies, or "
                "some are no stars",
                best.kept, 100.0 * best.scatter);
        if (off_stated(par, &best) > 3.0)
            rx_log_warning(log, "PSF_TYPE AUTO: PSF_FWHM is %.3g pixels, but %d %s %.3g%s", par->fwhm,
                           best.kept, best.kept == 1 ? "star has" : "like stars have", fwhm_of(&best),
                           few ? ": is it this tile's?" /* few stars are believed less, by the caller */
                               : ", which is taken; give PSF_TYPE MOFFAT to have PSF_FWHM");
        status = fit_joint(best.stars, best.list.n, par->nthreads, 30, &best.fit, err);
    }
    const int listed = par->stars_file != NULL && par->stars_file[0] != '\0';
    if (status == RX_OK && few && !listed && are_galaxies(&best)) {
        rx_moffat fitted;
        rx_moffat_set(&fitted, best.fit.shape);
        status = rx_error_at(
            err, RX_INPUT, image->name != NULL ? image->name : "", image->hdu, 0,
            "PSF_TYPE AUTO found %d source%s that may be %s, but a Moffat's exponent of %.3g there is no "
            "star's (PSF_BETA %.4g); give PSF_FWHM in pixels, SEEING_FWHM in arcsec%s, or "
            "PSF_STARS_NAME, a list of stars",
            best.kept, best.kept == 1 ? "" : "s", best.kept == 1 ? "a star" : "stars",
            fmin(fitted.beta, 100.0), par->beta, scale_too(image));
    }
    if (status == RX_OK)
        status = build(par, image, &best, dst, err);
    if (status == RX_OK && few && !(par->fwhm > 0.0)) /* which is believed more */
        rx_log_warning(log,
                       "PSF_TYPE AUTO: the PSF is from %d star%s only: a Moffat of exponent %.3g was fitted; "
                       "%s; give PSF_FWHM or a PSF file where it is known better",
                       best.kept, best.kept == 1 ? "" : "s", (*dst)->beta,
                       best.kept == 1 ? "it may be a galaxy" : "they may be galaxies");
    if (status == RX_OK)
        (*dst)->quality.limit = limit;
    if (status == RX_OK)
        (*dst)->quality.how = how;
    if (status == RX_OK && few) { /* an exponent that no star says, and a width that may be another */
        double narrower[RX_MOFFAT_SHAPE];
        memcpy(narrower, best.fit.shape, sizeof narrower);
        narrower[0] -= spread_of(&best);
        (*dst)->quality.flux_error = hypot(FEW_STARS, flux_off(best.fit.shape, narrower));
    } else if (status == RX_OK) {
        status =
            jackknife(best.stars, best.list.n, par->nthreads, &best.fit, &(*dst)->quality.flux_error, err);
        (*dst)->quality.flux_error = hypot((*dst)->quality.flux_error, NOT_MOFFAT);
    }
    if (status == RX_OK && sharper > 0)
        rx_stars_set_sharper(sharper, sharpness / best.radius, &(*dst)->quality, log);
    if (status == RX_OK && found != NULL) {
        memcpy(found->shape, best.fit.shape, sizeof found->shape);
        found->radius = best.radius;
    }
exit:
    free_attempt(&best);
    return status;
}
