/* A point and Sersic's profile at each source. */
#include "template/models.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/normal.h"
#include "template/fit.h"
#include "template/patch.h"
#include "template/refine.h"
#include "template/windows.h"

/* Mean and width of ln n of the 276 COSMOS galaxies that simulate/scene.h describes: without it, n of a galaxy at S/N 20, known to a
 * factor of two, would take flux and radius with it. */
static const double INDEX_MEAN = 0.32, INDEX_WIDTH = 0.62;
/* Of g1 and g2: twice the width among those galaxies, so that it takes 4 % of an ellipticity known to 0.1, and leaves what is not
 * resolved round. */
static const double G_WIDTH = 0.5, G_MOST = 0.9; /* b/a 0.05 */
/* Half-light radii that the domain holds around a profile; pixels up to which there is room for twice as many, which bring n = 4 at S/N 100
 * from 2 % too faint to 1.5 %, and cost little. */
static const double FAR = 4.0, ROOM = 32.0;
static const double FAINT = 0.003; /* of a pixel's noise: light below that is left out of the PSF */
/* Half-light radius of an exponential whose scale is a sixteenth of the FWHM, over that of the PSF, half the FWHM. */
static const double SPREAD = 1.678346990 / 8;
enum { ITERATIONS = 30 };

typedef struct run {
    const rx_models_view *view;
    rx_sersic_table *table;  /* NULL: not asked for */
    double fwhm, half_light; /* of the PSF, pixels */
    rx_tphot_source *list;
} run;

/* One source in its surroundings. */
typedef struct job {
    const run *all;
    const rx_fit_source *source;
    int cx, cy; /* whole pixel in the middle of the domain */
    rx_template_domain *size;
    rx_patch patch;
} job;

/* Half-light radius that room is made for. */
static double radius_of(const run *r, const rx_fit_source *s)
{
    return r->table == NULL ? 0 : fmax(fmax(s->guess, s->profile.radius), 0.5 * r->fwhm);
}

static int half_of(const run *r, double radius)
{
    return (int)ceil(2 * r->fwhm + 3 * radius) + 2;
}

static rx_status open_job(const run *r, rx_template_otf *otf, int i, double radius, job *j, rx_error *err)
{
    const rx_fit_image *image = r->view->image;
    const rx_fit_source *s = &r->view->sources[i];
    *j = (job){.all = r, .source = s, .cx = (int)lround(s->x), .cy = (int)lround(s->y)};
    const int x = (int)fmin(fmax(s->x, 0), image->width - 1), y = (int)fmin(fmax(s->y, 0), image->height - 1);
    const double noise = FAINT * sqrt((double)rx_fit_image_variance(image, x, y));
    const int n = rx_template_otf_side(otf, fmax(FAR * radius, fmin(2 * FAR * radius, ROOM)),
                                       s->flux > 0 ? noise / s->flux : 0, half_of(r, radius));
    RX_TRY(rx_template_otf_at(otf, n, s->x, s->y, &j->size, err));
    RX_TRY(rx_patch_cut(image, j->cx, j->cy, half_of(r, radius), n, &j->patch, err));
    rx_patch_add(&j->patch, &s->footprint, s->flux);
    rx_patch_dim(&j->patch, s->grain);
    j->size->first = j->patch.corner - 1;
    j->size->last = j->patch.corner + j->patch.side + 1;
    return RX_OK;
}

/* The position is free around the given one; width 0: without a prior. */
static void set_position(const job *j, double room, double width, rx_fit *fit)
{
    const double given[2] = {j->source->x0 - j->cx, j->source->y0 - j->cy};
    const double now[2] = {j->source->x - j->cx, j->source->y - j->cy};
    for (int d = 0; d < 2; d++) {
        fit->p[RX_FIT_X + d] = now[d];
        fit->prior[RX_FIT_X + d] = given[d];
        fit->width[RX_FIT_X + d] = width;
        fit->low[RX_FIT_X + d] = given[d] - room;
        fit->high[RX_FIT_X + d] = given[d] + room;
    }
    fit->iterations = ITERATIONS;
}

static double neighbours(const run *r, int i)
{
    const rx_joint_member *m = &r->view->members[i];
    return m->variance > m->alone && m->alone > 0 ? sqrt(m->variance / m->alone) : 1;
}

/* Error of a flux with that of the PSF, which counts for more where less of the light is seen. */
static double with_psf(const run *r, int i, double flux, double error)
{
    const rx_tphot_source *s = &r->list[i];
    const rx_psf *psf = r->view->image->input->image.psf;
    return hypot(error, rx_psf_flux_error(psf, s->x, s->y) * flux / fmax(s->inside - s->masked, 1e-3));
}

/* Of the PSF in the middle of the tile. */
static rx_status find_half_light(const rx_psf *psf, double *radius, rx_error *err)
{
    enum { PARTS = 8 }; /* of a pixel */
    const int side = psf->size, bins = side * PARTS;
    float *stamp = NULL;
    double *ring = NULL, sum = 0;
    int k = 0;
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(stamp, (size_t)side * (size_t)side, err));
    RX_TRY_EXIT(RX_MAKE(ring, (size_t)bins, err));
    rx_psf_at(psf, psf->x0, psf->y0, stamp);
    for (int y = 0; y < bins; y++)
        for (int x = 0; x < bins; x++)
            ring[(int)hypot(x + 0.5 - 0.5 * bins, y + 0.5 - 0.5 * bins)] +=
                (double)stamp[y / PARTS * side + x / PARTS] / (PARTS * PARTS);
    while (k < bins - 1 && sum + ring[k] < 0.5)
        sum += ring[k++];
    *radius = (k + (0.5 - sum) / ring[k]) / PARTS;
exit:
    free(stamp);
    free(ring);
    return status;
}

/* The spread of the light, at the point that has been fitted. */
static rx_status find_spread(const job *j, const rx_fit *fit, rx_source_point *dst, rx_error *err)
{
    const rx_spergel wider = {.radius = SPREAD * j->all->half_light, .nu = 0.5};
    const size_t stride = (size_t)rx_fft_stride_real(j->size->fft), side = (size_t)j->patch.side;
    rx_template_domain_render(j->size, NULL, fit->p[RX_FIT_X], fit->p[RX_FIT_Y], NULL, 1);
    float *swap = j->size->plane[0], *share;
    j->size->plane[0] = j->size->plane[1];
    j->size->plane[1] = swap;
    rx_template_domain_render(j->size, &wider, fit->p[RX_FIT_X], fit->p[RX_FIT_Y], NULL, 1);
    RX_TRY(RX_MAKE(share, side * side, err));
    double a = 0, b = 0, gp = 0, pp = 0, variance = 0;
    for (int pass = 0; pass < 2; pass++)
        for (size_t k = 0; k < side * side; k++) {
            const size_t at =
                (k / side + (size_t)j->patch.corner) * stride + k % side + (size_t)j->patch.corner;
            const double g = (double)j->size->plane[0][at], p = (double)j->size->plane[1][at];
            const double w = j->patch.weight[k], d = j->patch.data[k];
            if (!(w > 0))
                continue;
            if (pass == 0) {
                a += p * d;
                b += g * d;
                gp += g * p;
                pp += p * p;
                continue;
            }
            const double part = g / a - b * p / (a * a);
            variance += part * part / w;
            share[k] = (float)(part / sqrt(w));
        }
    /* the weights are those of noise `grain` times as wide already */
    const double noise =
        rx_noise_factor(j->all->view->image->correlation, share, j->patch.side, j->patch.side);
    dst->spread = a > 0 ? b / a - gp / pp : NAN;
    dst->spread_error = a > 0 ? noise / j->source->grain * sqrt(variance) : NAN;
    free(share);
    return RX_OK;
}

static rx_status fit_point(const job *j, int i, rx_source_point *dst, rx_error *err)
{
    const run *r = j->all;
    const rx_tphot_source *s = &r->list[i];
    const int is_point = s->kind == RX_TPHOT_POINT;
    rx_fit fit = {.n = RX_FIT_POINT};
    set_position(j, 0.75 + 0.3 * r->fwhm, rx_refine_reach(r->fwhm), &fit);
    if (is_point)
        fit.iterations = 0;
    rx_fit_run(&fit, j->size, &j->patch);
    if (fit.at_limit != 0 || !(fit.p[RX_FIT_FLUX] > 0)) { /* it has run away */
        fit.p[RX_FIT_X] = fit.prior[RX_FIT_X];
        fit.p[RX_FIT_Y] = fit.prior[RX_FIT_Y];
        fit.iterations = 0;
        rx_fit_run(&fit, j->size, &j->patch);
    }
    double used = -(double)fit.n, chi2 = fit.chi2;
    for (int k = 0; k < j->patch.side * j->patch.side; k++)
        used += j->patch.weight[k] > 0;
    for (int d = RX_FIT_X; d <= RX_FIT_Y; d++)
        chi2 -= pow((fit.p[d] - fit.prior[d]) / fit.width[d], 2);
    dst->chi2 = used > 0 ? chi2 * j->source->grain * j->source->grain / used : NAN;
    dst->x = is_point ? s->x : fit.p[RX_FIT_X] + j->cx;
    dst->y = is_point ? s->y : fit.p[RX_FIT_Y] + j->cy;
    dst->flux = is_point ? s->flux : fit.p[RX_FIT_FLUX];
    dst->fluxerr =
        is_point ? s->fluxerr
                 : with_psf(r, i, dst->flux, neighbours(r, i) * sqrt(rx_fit_variance(&fit, RX_FIT_FLUX)));
    return find_spread(j, &fit, dst, err);
}

/* 1 sigma of the sum of parameters times `direction`. */
static double error_along(const rx_fit *fit, const double *direction)
{
    double a[RX_FIT_ALL * RX_FIT_ALL], x[RX_FIT_ALL], sum = 0;
    memcpy(a, fit->a, sizeof a);
    memcpy(x, direction, sizeof x);
    if (!rx_cholesky(a, fit->n, fit->n))
        return NAN;
    rx_cholesky_solve(a, fit->n, fit->n, x);
    for (int k = 0; k < fit->n; k++)
        sum += direction[k] * x[k];
    return sqrt(sum);
}

/* The same, NAN where one of the parameters `which` ended at a limit. */
static double free_error(const rx_fit *fit, int which, const double *direction)
{
    return (fit->at_limit & which) != 0 ? NAN : error_along(fit, direction);
}

static void fit_sersic(const job *j, int i, rx_source_sersic *dst)
{
    const run *r = j->all;
    const rx_spergel *start = &j->source->profile;
    const int extended = start->radius > 0;
    rx_fit fit = {.n = RX_FIT_ALL, .sersic = r->table};
    set_position(j, 0.75 + 0.3 * r->fwhm + 0.5 * j->source->guess, 0, &fit);
    fit.p[RX_FIT_RADIUS] = log(extended ? start->radius : 0.3 * r->fwhm);
    fit.low[RX_FIT_RADIUS] = log(RX_REFINE_RADIUS);
    fit.high[RX_FIT_RADIUS] = log(0.25 * j->size->n);
    fit.p[RX_FIT_G1] = start->g1;
    fit.p[RX_FIT_G2] = start->g2;
    fit.width[RX_FIT_G1] = fit.width[RX_FIT_G2] = G_WIDTH;
    fit.low[RX_FIT_G1] = fit.low[RX_FIT_G2] = -G_MOST;
    fit.high[RX_FIT_G1] = fit.high[RX_FIT_G2] = G_MOST;
    /* Spergel's 0.5 is Sersic's 1, -0.6 about 4 */
    fit.p[RX_FIT_NU] = extended ? log(fmax(1.5 / (1 + start->nu), 0.5)) : 0;
    fit.prior[RX_FIT_NU] = INDEX_MEAN;
    fit.width[RX_FIT_NU] = INDEX_WIDTH;
    fit.low[RX_FIT_NU] = log(RX_SERSIC_LOW);
    fit.high[RX_FIT_NU] = log(RX_SERSIC_HIGH);
    rx_fit_run(&fit, j->size, &j->patch);
    if (!isfinite(fit.chi2) || !(fit.p[RX_FIT_FLUX] > 0))
        return;
    const rx_spergel found = rx_fit_profile(&fit);
    const double g = hypot(found.g1, found.g2), c = g > 0 ? found.g1 / g : 1, s = g > 0 ? found.g2 / g : 0;
    const double along[RX_FIT_ALL] = {[RX_FIT_G1] = c, [RX_FIT_G2] = s};
    const double across[RX_FIT_ALL] = {[RX_FIT_G1] = -s, [RX_FIT_G2] = c};
    /* R = radius sqrt((1 + g) / (1 - g)) */
    const double major[RX_FIT_ALL] = {
        [RX_FIT_RADIUS] = 1, [RX_FIT_G1] = c / (1 - g * g), [RX_FIT_G2] = s / (1 - g * g)};
    const int size = 1 << RX_FIT_RADIUS, shape = 1 << RX_FIT_G1, steepness = 1 << RX_FIT_NU;
    dst->flux = fit.p[RX_FIT_FLUX];
    dst->fluxerr = with_psf(r, i, dst->flux,
                            neighbours(r, i) * error_along(&fit, (double[RX_FIT_ALL]){[RX_FIT_FLUX] = 1}));
    dst->radius[0] = found.radius * sqrt((1 + g) / (1 - g));
    dst->radius[1] = dst->radius[0] * free_error(&fit, size | shape, major);
    dst->index[0] = found.nu;
    dst->index[1] = found.nu * free_error(&fit, steepness, (double[RX_FIT_ALL]){[RX_FIT_NU] = 1});
    dst->ratio[0] = (1 - g) / (1 + g);
    dst->ratio[1] = 2 / ((1 + g) * (1 + g)) * free_error(&fit, shape, along);
    dst->theta[0] = 0.5 * atan2(found.g2, found.g1);
    dst->theta[1] =
        fmin(0.5 / g * error_along(&fit, across), M_PI / sqrt(12)); /* at most that of any angle */
}

static rx_status fit_one(void *user, int i, int thread, rx_error *err)
{
    const run *r = user;
    rx_template_otf *otf = r->view->otfs[thread];
    job j;
    if ((r->list[i].flags & RX_TPHOT_NO_DATA) != 0)
        return RX_OK;
    rx_status status = open_job(r, otf, i, 0, &j, err);
    if (status == RX_OK)
        status = fit_point(&j, i, &r->list[i].point_fit, err);
    rx_patch_clear(&j.patch);
    if (status != RX_OK || r->table == NULL)
        return status;
    status = open_job(r, otf, i, radius_of(r, &r->view->sources[i]), &j, err);
    if (status == RX_OK)
        fit_sersic(&j, i, &r->list[i].sersic_fit);
    rx_patch_clear(&j.patch);
    return status;
}

rx_status rx_models_fit(const rx_models_view *view, int sersic, rx_tphot_source *list, rx_error *err)
{
    run r = {.view = view, .fwhm = fmax(view->image->input->image.psf->fwhm, 1.0), .list = list};
    rx_window *windows;
    rx_status status;
    RX_TRY(RX_MAKE(windows, (size_t)view->n, err));
    RX_TRY_EXIT(find_half_light(view->image->input->image.psf, &r.half_light, err));
    if (sersic)
        RX_TRY_EXIT(rx_sersic_table_new(&r.table, err));
    for (int i = 0; i < view->n; i++) {
        const rx_fit_source *s = &view->sources[i];
        const int half = half_of(&r, radius_of(&r, s)), x = (int)lround(s->x), y = (int)lround(s->y);
        windows[i] = (rx_window){x > half ? x - half : 0, y > half ? y - half : 0,
                                 x + half < view->image->width ? x + half + 1 : view->image->width,
                                 y + half < view->image->height ? y + half + 1 : view->image->height};
    }
    status = rx_windows_run(view->image, windows, view->n, 0, fit_one, &r, err);
exit:
    free(windows);
    free(r.table);
    return status;
}
