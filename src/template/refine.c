/* Point or profile, where and how large. */
#include "template/refine.h"

#include <math.h>

#include "base/min_max.h"
#include "template/fit.h"
#include "template/patch.h"
#include "template/substructure.h"

/* Priors and limits, as refine.h has them. */
static const double EXPONENTIAL = 0.5, G_WIDTH = 0.25, G_MOST = 0.8;
static const double FAR = 4.0; /* half-light radii that the domain holds around a profile */
static const double WORTH =
    1.0; /* chi2 that a round size gains before profiles are fitted: below, noise makes it of most points */
static const double SURE = 0.02;  /* a probability below that is none */
static const double MUCH = 100.0; /* chi2 */
/* Of a pair where it is not crowded: S/N of both together and of the fainter one, chi2 by which a profile must be worse,
 * errors of chi2 within which that of the pair must be what noise leaves. */
static const double PAIR_SNR = 50.0, PAIR_FAINTER = 5.0, PAIR_BETTER = 20.0, PAIR_FITS = 5.0;
static const double WIDEST_GUESS = 2.0;
enum { ITERATIONS = 12 };

/* One source in its surroundings. */
typedef struct job {
    const rx_refine_params *par;
    const rx_refine_view *view;
    const rx_fit_source *before;
    int cx, cy; /* whole pixel in the middle of the domain */
    rx_template_domain *size;
    rx_patch patch;
} job;

double rx_refine_reach(double fwhm)
{
    return 0.25 + 0.1 * fwhm;
}

/* room: how much farther than a point's it may be from the given one, pixels. */
static void set_position(const job *j, double room, rx_fit *fit)
{
    const double given[2] = {j->before->x0 - j->cx, j->before->y0 - j->cy};
    const double most = 0.75 + 0.3 * j->view->fwhm + room;
    for (int d = 0; d < 2; d++) {
        fit->prior[RX_FIT_X + d] = given[d];
        fit->width[RX_FIT_X + d] = rx_refine_reach(j->view->fwhm) + 0.5 * room;
        fit->low[RX_FIT_X + d] = given[d] - most;
        fit->high[RX_FIT_X + d] = given[d] + most;
    }
    fit->p[RX_FIT_X] = j->before->x - j->cx;
    fit->p[RX_FIT_Y] = j->before->y - j->cy;
    fit->iterations = ITERATIONS;
}

static int at_end(const rx_fit *fit)
{
    return (fit->at_limit & (1 << RX_FIT_X | 1 << RX_FIT_Y)) != 0;
}

/* Has the position run away? */
static int lost(const rx_fit *fit)
{
    return at_end(fit) || !isfinite(fit->p[RX_FIT_FLUX]) || !isfinite(fit->chi2);
}

/* A profile is worth having even where its position has come to its limit, when it explains so much more: of
 * two merged galaxies, say, which one profile cannot describe and a point still less. */
static int usable(const rx_fit *profile, const rx_fit *point)
{
    return profile->p[RX_FIT_FLUX] > 0 && isfinite(profile->p[RX_FIT_FLUX]) && isfinite(profile->chi2) &&
           (!at_end(profile) || point->chi2 - profile->chi2 > MUCH);
}

/* Returns whether the position has run away; the point is where it was given then. */
static int fit_point(const job *j, rx_fit *fit)
{
    *fit = (rx_fit){.n = RX_FIT_POINT};
    set_position(j, 0, fit);
    rx_fit_run(fit, j->size, &j->patch);
    if (!lost(fit) && fit->p[RX_FIT_FLUX] > 0)
        return 0;
    fit->p[RX_FIT_X] = fit->prior[RX_FIT_X];
    fit->p[RX_FIT_Y] = fit->prior[RX_FIT_Y];
    fit->iterations = 0;
    rx_fit_run(fit, j->size, &j->patch);
    return 1;
}

/* A profile much wider than what the restored image shows is not of the source: faint ones would take the
 * halo of a bright star, or what the sky level lacks, for their outskirts, at twenty times their flux. */
static double widest(const job *j)
{
    const rx_fit_source *s = j->before;
    const double seen = 0.5 * sqrt((s->xmax - s->xmin + 1.0) * (s->ymax - s->ymin + 1.0));
    return fmax(WIDEST_GUESS * s->guess, seen + 0.5 * j->view->fwhm);
}

/* flux: of the point. */
static void fit_profile(const job *j, double flux, rx_fit *fit)
{
    const rx_spergel *last = &j->before->profile;
    const rx_tile_prior *tile_prior = j->par->tile_prior;
    *fit = (rx_fit){.n = RX_FIT_ALL};
    set_position(j, 0.5 * j->before->guess, fit);
    fit->p[RX_FIT_RADIUS] = last->radius > 0 ? log(last->radius) : log(fmax(j->before->guess, 0.3));
    fit->p[RX_FIT_G1] = last->g1;
    fit->p[RX_FIT_G2] = last->g2;
    fit->p[RX_FIT_NU] = log1p(last->radius > 0 ? last->nu : EXPONENTIAL);
    fit->prior[RX_FIT_RADIUS] = rx_prior_scaling_mean(tile_prior, &tile_prior->radius, flux);
    fit->width[RX_FIT_RADIUS] = tile_prior->radius.width;
    fit->low[RX_FIT_RADIUS] = log(RX_REFINE_RADIUS);
    fit->high[RX_FIT_RADIUS] = log(fmin(widest(j), 0.25 * j->size->n));
    fit->width[RX_FIT_G1] = fit->width[RX_FIT_G2] = G_WIDTH;
    fit->high[RX_FIT_G1] = G_MOST;
    fit->low[RX_FIT_G1] = fit->low[RX_FIT_G2] = -G_MOST;
    fit->high[RX_FIT_G2] = G_MOST;
    fit->prior[RX_FIT_NU] = tile_prior->nu.mean;
    fit->width[RX_FIT_NU] = tile_prior->nu.width;
    fit->low[RX_FIT_NU] = log1p(RX_SPERGEL_MIN);
    fit->high[RX_FIT_NU] = log1p(RX_SPERGEL_MAX);
    rx_fit_run(fit, j->size, &j->patch);
}

/* How much of the two positions the data decide. */
static double position_gain(const rx_fit *fit)
{
    double sum = 0;
    for (int d = RX_FIT_X; d <= RX_FIT_Y; d++) {
        const double share = rx_fit_variance(fit, d) / (fit->width[d] * fit->width[d]);
        sum += share < 1 ? 1 - share : 0;
    }
    return sum;
}

static void take_point(const job *j, const rx_fit *fit, int ran_away, rx_fit_source *after)
{
    after->kind = RX_TPHOT_POINT;
    after->point = after->star = after->lift = 1;
    after->chi2_gain = after->variance = after->misfit = 0;
    after->evidence = NAN;
    after->agreement = 0;
    after->size = after->slope = (rx_likelihood){0, 0};
    after->profile = (rx_spergel){.nu = EXPONENTIAL};
    after->x = fit->p[RX_FIT_X] + j->cx;
    after->y = fit->p[RX_FIT_Y] + j->cy;
    after->position_gain = ran_away ? 0 : position_gain(fit);
    after->flags |= ran_away ? RX_TPHOT_POSITION : 0;
    if (isfinite(fit->p[RX_FIT_FLUX]))
        after->flux = fit->p[RX_FIT_FLUX];
    after->as_point = after->flux;
    after->point_error = sqrt(rx_fit_variance(fit, RX_FIT_FLUX));
}

/* What a profile must gain in chi2 for its freedom: -2 ln of the share of its prior that the data leave, by
 * Laplace's approximation of the evidence (MacKay 2003, Information Theory, Inference, and Learning
 * Algorithms, ch. 28). Small where the data say little of the shape. */
static double occam(const rx_fit *point, const rx_fit *profile)
{
    double prior = 0;
    for (int k = RX_FIT_POINT; k < RX_FIT_ALL; k++)
        prior += 2 * log(profile->width[k]);
    return rx_fit_log_determinant(profile) - rx_fit_log_determinant(point) + prior;
}

static rx_likelihood say(const rx_fit *fit, int j)
{
    return rx_likelihood_of(fit->p[j], rx_fit_variance(fit, j), fit->prior[j], fit->width[j]);
}

/* Relative error of the flux of a profile for being Spergel's: found on simulated galaxies of Sersic's
 * profiles (n 0.5 to 6) and bulges with disks, S/N above 100: 0.8 %, and for steep ones, whose wings go on
 * beyond what can be seen, up to 5 % at nu = -0.65. */
static double misfit(double nu)
{
    return 0.008 + 0.065 * fmax(-nu, 0);
}

double rx_refine_amid_structure(const rx_refine_view *view, int cx, int cy, double gain, double radius)
{
    const rx_fit_image *c = view->image;
    const double wider = 1 + 4 * radius * radius / (view->fwhm * view->fwhm);
    if (view->structure == NULL)
        return gain;
    const int x = rx_min_int(rx_max_int(cx, 0), c->width - 1),
              y = rx_min_int(rx_max_int(cy, 0), c->height - 1);
    return gain / (1 + rx_sky_mesh_at(view->structure, x, y) * wider);
}

/* What is known of a source if it is extended. */
typedef struct extended {
    double evidence; /* 2 ln of that over the point's */
    double x, y, flux;
    rx_spergel profile;
    rx_fit_mean mean;
    double position_gain;
    rx_likelihood size, slope;
} extended;

/* The profile with its probability, besides the point that has been taken. Its variance holds what the
 * freedom of its shape costs and that the truth may be the one or the other. */
static void take_profile(const job *j, const rx_fit *point, const extended *e, rx_fit_source *after)
{
    if (!isfinite(e->evidence))
        return;
    after->evidence = e->evidence;
    after->size = e->size;
    after->slope = e->slope;
    after->agreement = rx_prior_agreement(j->par->tile_prior, &e->size, after->as_point);
    after->star = rx_prior_point(j->par->tile_prior, after->as_point, e->evidence);
    if (after->star > 1 - SURE)
        return;
    const double p = after->star < SURE ? 0 : after->star, q = 1 - p;
    const double f = point->p[RX_FIT_FLUX], spread = f - e->mean.flux;
    after->kind = RX_TPHOT_PROFILE;
    after->flags &= ~RX_TPHOT_POSITION;
    after->profile = e->profile;
    after->flux = p * f + q * e->flux;
    after->point = p * f / after->flux;
    after->lift = (p * f + q * e->mean.flux) / after->flux;
    after->x = p * after->x + q * e->x;
    after->y = p * after->y + q * e->y;
    after->position_gain = p * after->position_gain + q * e->position_gain;
    after->variance =
        p * rx_fit_variance(point, RX_FIT_FLUX) + q * e->mean.variance + p * q * spread * spread;
    after->misfit = q * e->mean.flux * misfit(e->profile.nu);
}

static void take_fit(const job *j, const rx_fit *point, const rx_fit *profile, rx_fit_source *after)
{
    extended e = {.x = j->cx + profile->p[RX_FIT_X],
                  .y = j->cy + profile->p[RX_FIT_Y],
                  .flux = profile->p[RX_FIT_FLUX],
                  .profile = rx_fit_profile(profile),
                  .mean = rx_fit_average(profile, j->size, &j->patch),
                  .position_gain = position_gain(profile),
                  .size = say(profile, RX_FIT_RADIUS),
                  .slope = say(profile, RX_FIT_NU)};
    after->chi2_gain = point->chi2 - profile->chi2;
    e.evidence = rx_refine_amid_structure(j->view, j->cx, j->cy, after->chi2_gain, e.profile.radius) -
                 occam(point, profile) + e.mean.evidence;
    take_profile(j, point, &e, after);
    if (after->kind == RX_TPHOT_PROFILE && at_end(profile))
        after->flags |= RX_TPHOT_POSITION;
    if (after->kind == RX_TPHOT_PROFILE && (profile->at_limit & (1 << RX_FIT_RADIUS | 1 << RX_FIT_G1)) != 0)
        after->flags |= RX_TPHOT_BOUND;
}

/* A round exponential disk at the place of the point, which plane 1 holds: its best flux, the variance of that, 2 ln of its evidence
 * over the point's, and the chi2 that a little of that size gains, to first order: F T + A (T' - T). */
typedef struct disk {
    double flux, variance, evidence, gain;
} disk;

static disk try_disk(const job *j, const rx_fit *point, double radius)
{
    const size_t stride = (size_t)rx_fft_stride_real(j->size->fft), side = (size_t)j->patch.side;
    const rx_spergel round = {.radius = radius, .nu = EXPONENTIAL};
    double tt = 0, tp = 0, pp = 0, td = 0, pd = 0, xx = 0, yy = 0;
    rx_template_domain_render(j->size, &round, point->p[RX_FIT_X], point->p[RX_FIT_Y], NULL, 1);
    for (size_t v = 0; v < side; v++) {
        const size_t k = (v + (size_t)j->patch.corner) * stride + (size_t)j->patch.corner;
        const float *p = j->size->plane[0] + k, *star = j->size->plane[1] + k, *up = p + stride,
                    *down = p - stride;
        const double *weight = j->patch.weight + v * side, *data = j->patch.data + v * side;
#pragma omp simd reduction(+ : tt, tp, pp, td, pd, xx, yy)
        for (size_t u = 0; u < side; u++) {
            const double w = weight[u], t = star[u], d = p[u], x = 0.5 * (p[u + 1] - p[u - 1]),
                         y = 0.5 * (up[u] - down[u]);
            tt += w * t * t;
            tp += w * t * d;
            pp += w * d * d;
            td += w * t * data[u];
            pd += w * d * data[u];
            xx += w * x * x;
            yy += w * y * y;
        }
    }
    const double flux = pd / pp, slope = pd - td / tt * tp, free = pp - tp * tp / tt;
    const double prior = 1 / (point->width[RX_FIT_X] * point->width[RX_FIT_X]);
    const double *a = point->a;
    const double places = (prior + flux * flux * xx) * (prior + flux * flux * yy) /
                          (a[RX_FIT_X * (RX_FIT_POINT + 1)] * a[RX_FIT_Y * (RX_FIT_POINT + 1)]);
    return (disk){flux, 1 / pp, pd * pd / pp - td * td / tt - log(pp / tt * places),
                  tt > 0 && free > 0 && slope > 0 ? slope * slope / free : 0};
}

/* Where the pixels say next to nothing of a shape: disks of the radius that the prior expects, and sqrt(3) widths of it smaller and larger, the
 * nodes of Gauss-Hermite's rule of degree 5. In a crowd what gains no more than the odds of pairs is one (is_pair()): of 592 such fits
 * of 8000-4 and 361 of 20000-4G (validation/crowded.py, seed 301) 98 % ended so. 0: the fit of a profile is worth its time. */
static int take_disks(const job *j, const rx_fit *point, rx_fit_source *after)
{
    static const double shares[3] = {1.0 / 6, 2.0 / 3, 1.0 / 6}, apart = 1.7320508075688772;
    const rx_tile_prior *tile_prior = j->par->tile_prior;
    const double f = point->p[RX_FIT_FLUX], width = tile_prior->radius.width;
    const double centre = rx_prior_scaling_mean(tile_prior, &tile_prior->radius, f);
    const double most = log(fmin(widest(j), 0.25 * j->size->n));
    disk at[3];
    double weight[3], sum = 0, mean = 0, square = 0;
    float *swap = j->size->plane[0]; /* the point, which has been fitted, moves to plane 1 */
    j->size->plane[0] = j->size->plane[1];
    j->size->plane[1] = swap;
    at[1] = try_disk(j, point, exp(fmin(centre, most)));
    if (at[1].gain >= WORTH) {
        const int paired = rx_crowding_at(j->view->crowd, j->cx, j->cy) &&
                           at[1].gain < WORTH + rx_crowding_pair_odds(j->view->crowd, j->cx, j->cy);
        after->evidence = paired ? -HUGE_VAL : after->evidence;
        return paired;
    }
    at[0] = try_disk(j, point, exp(fmin(centre - apart * width, most)));
    at[2] = try_disk(j, point, exp(fmin(centre + apart * width, most)));
    for (int k = 0; k < 3; k++)
        sum += weight[k] = at[k].flux > 0 ? shares[k] * exp(0.5 * at[k].evidence) : 0;
    if (!(2 * log(sum) < WORTH))
        return 0;
    if (!(sum > 0))
        return 1;
    extended e = {
        .evidence = 2 * log(sum), .x = after->x, .y = after->y, .position_gain = after->position_gain};
    for (int k = 0; k < 3; k++) {
        weight[k] /= sum;
        mean += weight[k] * (k - 1);
        square += weight[k] * (k - 1) * (k - 1);
        e.mean.flux += weight[k] * at[k].flux;
    }
    for (int k = 0; k < 3; k++)
        e.mean.variance += weight[k] * (at[k].variance + pow(at[k].flux - e.mean.flux, 2));
    e.flux = at[1].flux + 0.5 * mean * (at[2].flux - at[0].flux) +
             0.5 * mean * mean * (at[2].flux + at[0].flux - 2 * at[1].flux);
    e.profile = (rx_spergel){.radius = exp(fmin(centre + mean * apart * width, most)), .nu = EXPONENTIAL};
    e.size = rx_likelihood_of(centre + mean * apart * width,
                              3 * width * width * fmax(square - mean * mean, 1.0 / 12), centre, width);
    take_profile(j, point, &e, after);
    return 1;
}

/* What fits look at is the patch and one pixel around it. */
static void render_patch_only(const job *j)
{
    j->size->first = j->patch.corner - 1;
    j->size->last = j->patch.corner + j->patch.side + 1;
}

/* Two points where nearly all pairs are chance: they have to be much better than the profile, and to leave nothing. */
static int is_clear_pair(const job *j, const rx_fit *point, const rx_fit *profile, double chi2,
                         double pair[2][3])
{
    const size_t pixels = (size_t)j->patch.side * (size_t)j->patch.side;
    const double grain = j->before->grain, error = sqrt(rx_fit_variance(point, RX_FIT_FLUX));
    double used = 0;
    for (size_t k = 0; k < pixels; k++)
        used += j->patch.weight[k] > 0;
    if (pair[0][0] < pair[1][0])
        for (int k = 0; k < 3; k++) {
            const double swap = pair[0][k];
            pair[0][k] = pair[1][k];
            pair[1][k] = swap;
        }
    return pair[1][0] > PAIR_FAINTER * error && chi2 + PAIR_BETTER < profile->chi2 &&
           chi2 * grain * grain < used + PAIR_FITS * sqrt(2 * used);
}

/* Do two points describe it as well as that profile? In a crowd what looks extended is most often two stars; the second
 * one then shows in what the point of the first leaves. Elsewhere it stays what it is until look() splits it. */
static int is_pair(const job *j, const rx_fit *point, const rx_fit *profile, rx_fit_source *after)
{
    const rx_spergel shape = rx_fit_profile(profile);
    const double angle = 0.5 * atan2(shape.g2, shape.g1), fwhm = j->view->fwhm;
    const double apart = fmin(fmax(shape.radius, 0.25 * fwhm), fwhm);
    const int crowded = rx_crowding_at(j->view->crowd, j->cx, j->cy);
    const double flux = point->p[RX_FIT_FLUX], variance = rx_fit_variance(point, RX_FIT_FLUX);
    if (!crowded &&
        (point->chi2 - profile->chi2 < PAIR_BETTER || flux * flux < PAIR_SNR * PAIR_SNR * variance))
        return 0;
    double pair[2][3];
    const double enough =
        crowded ? profile->chi2 + rx_crowding_pair_odds(j->view->crowd, j->cx, j->cy) : -HUGE_VAL;
    const double chi2 = rx_fit_pair(point, (double[2]){apart * cos(angle), apart * sin(angle)}, 1.5 * fwhm,
                                    enough, j->size, &j->patch, pair);
    rx_template_domain_render(j->size, &shape, profile->p[RX_FIT_X], profile->p[RX_FIT_Y], NULL,
                              1); /* plane 0 as it was */
    if (crowded)
        return chi2 < enough;
    after->paired = is_clear_pair(j, point, profile, chi2, pair);
    for (int i = 0; i < 2 && after->paired; i++) {
        after->pair[i][0] = pair[i][0];
        after->pair[i][1] = pair[i][1] + j->cx;
        after->pair[i][2] = pair[i][2] + j->cy;
    }
    return 0;
}

/* Point against profile on the same pixels. */
static void choose(const job *j, rx_fit_source *after)
{
    rx_fit point, profile;
    after->paired = 0;
    render_patch_only(j);
    const int ran_away = fit_point(j, &point);
    take_point(j, &point, ran_away, after);
    if (!j->par->extended || j->before->segment == 0 || !(point.p[RX_FIT_FLUX] > 0))
        return;
    if (take_disks(j, &point, after))
        return;
    fit_profile(j, point.p[RX_FIT_FLUX], &profile);
    if (!usable(&profile, &point))
        return;
    if (is_pair(j, &point, &profile, after))
        after->evidence = -HUGE_VAL;
    else
        take_fit(j, &point, &profile, after);
}

/* Side of the domain of a source, of which half pixels to all sides are looked at, all for 0. Light below a tenth of what its footprint will be cropped at needs no part of the PSF; where restored
 * pixels are blurred to the tile's PSF, all of that is needed. */
static int side_of(const rx_refine_params *par, const rx_refine_view *view, const rx_template_otf *otf,
                   const rx_fit_source *s, double reach, int half)
{
    const rx_fit_image *image = view->image;
    const int x = s->x < 0 ? 0 : s->x > image->width - 1 ? image->width - 1 : (int)s->x;
    const int y = s->y < 0 ? 0 : s->y > image->height - 1 ? image->height - 1 : (int)s->y;
    const double noise = RX_REFINE_FAINT * sqrt(rx_fit_image_variance(image, x, y));
    return rx_template_otf_side(otf, reach, par->substructure || !(s->flux > 0) ? 0 : 0.1 * noise / s->flux,
                                half);
}

/* Light below that is not worth a pixel. */
static double crop_level(const job *j, const rx_fit_source *after, const rx_template_plane *plane)
{
    const rx_fit_image *image = j->view->image;
    float highest = 0;
    for (size_t v = 0; v < (size_t)plane->n; v++) {
        const float *row = plane->values + v * plane->stride;
#pragma omp simd reduction(max : highest)
        for (int u = 0; u < plane->n; u++)
            highest = row[u] > highest ? row[u] : highest;
    }
    const double peak = highest;
    const int x = after->x < 0 ? 0 : after->x > image->width - 1 ? image->width - 1 : (int)after->x;
    const int y = after->y < 0 ? 0 : after->y > image->height - 1 ? image->height - 1 : (int)after->y;
    const double noise = RX_REFINE_FAINT * sqrt(rx_fit_image_variance(image, x, y));
    const double level = after->flux > 0 && noise > 0 ? noise / after->flux : 0.01 * peak;
    return fmin(fmax(level, 1e-5 * peak), 0.01 * peak);
}

/* Plane 0: the point and the profile in their shares. */
static void render(const job *j, const rx_fit_source *after)
{
    const double dx = after->x - j->cx, dy = after->y - j->cy;
    const size_t cells = (size_t)j->size->n * (size_t)rx_fft_stride_real(j->size->fft);
    const float share = (float)after->point;
    if (after->kind == RX_TPHOT_POINT || after->point > 0) {
        rx_template_domain_render(j->size, NULL, dx, dy, NULL, 1);
        if (after->kind == RX_TPHOT_POINT)
            return;
        float *swap = j->size->plane[0];
        j->size->plane[0] = j->size->plane[1];
        j->size->plane[1] = swap;
    }
    rx_template_domain_render(j->size, &after->profile, dx, dy, NULL, 1);
    if (after->point > 0)
        for (size_t k = 0; k < cells; k++)
            j->size->plane[0][k] += share * (j->size->plane[1][k] - j->size->plane[0][k]);
}

/* Inverse variance of the flux of plane 0 as a fixed template. */
static double fixed_power(const job *j)
{
    const size_t stride = (size_t)rx_fft_stride_real(j->size->fft), side = (size_t)j->patch.side;
    double power = 0;
    for (size_t v = 0; v < side; v++) {
        const float *t = j->size->plane[0] + (v + (size_t)j->patch.corner) * stride + j->patch.corner;
        const double *weight = j->patch.weight + v * side;
#pragma omp simd reduction(+ : power)
        for (size_t u = 0; u < side; u++)
            power += weight[u] * t[u] * t[u];
    }
    return power;
}

/* Error of a flux of that variance over that of a fixed template. */
static double shape_error(double power, double variance)
{
    return power * variance > 1 && isfinite(power * variance) ? sqrt(power * variance) : 1;
}

static rx_status finish(job *j, rx_fit_source *after, rx_error *err)
{
    j->size->first = 0;
    j->size->last = j->size->n;
    render(j, after);
    double own = 1;
    if (!j->par->frozen) {
        const double power = fixed_power(j);
        own = shape_error(power, after->variance);
        after->shape_error = shape_error(power, after->variance + after->misfit * after->misfit);
    }
    if (after->kind != RX_TPHOT_POINT && after->point <= 0 && j->par->substructure) {
        double flux = after->flux;
        const int used = rx_substructure_add(j->view, after, j->cx, j->cy, j->size, &j->patch, &flux);
        after->kind = used ? RX_TPHOT_PIXELS : RX_TPHOT_PROFILE;
        if (used) { /* its pixels say what its shape is */
            after->lift = 1;
            after->shape_error = j->par->frozen ? after->shape_error : own;
        }
        after->flux = flux;
    }
    const rx_template_plane plane = {.values = j->size->plane[0],
                                     .n = j->size->n,
                                     .stride = (size_t)rx_fft_stride_real(j->size->fft),
                                     .cx = j->cx,
                                     .cy = j->cy};
    RX_TRY(rx_footprint_crop(&plane, crop_level(j, after, &plane), j->view->image->width,
                             j->view->image->height, &after->footprint, err));
    const rx_footprint *f = &after->footprint;
    after->grain = rx_noise_factor(j->view->image->correlation, f->values, f->width, f->height);
    return RX_OK;
}

/* Whether the pixels are looked at, or only a footprint is made. */
static int looks(const rx_refine_params *par)
{
    return !par->frozen || par->substructure;
}

/* Half-light radius that room is made for. */
static double radius_of(const rx_refine_params *par, const rx_fit_source *source)
{
    return !par->extended && source->profile.radius <= 0 ? 0 : fmax(source->guess, source->profile.radius);
}

/* Half the side of the patch around a source of that radius. */
static int half_of(const rx_refine_view *view, double radius)
{
    return (int)ceil(2.0 * view->fwhm + 3.0 * radius) + 2;
}

static int half_alone(const rx_refine_view *view, const rx_fit_source *source, const rx_fit_source *other)
{
    const double radius = fmax(source->guess, source->profile.radius);
    const double away = hypot(other->x - source->x, other->y - source->y);
    return (int)ceil(fmax(2.0 * view->fwhm + 3.0 * radius, away + 1.5 * view->fwhm)) + 2;
}

/* So many pixels to all sides of the one that the source is on, where there are any. */
static rx_window window_around(const rx_fit_image *image, const rx_fit_source *source, int half)
{
    const int x = (int)lround(source->x), y = (int)lround(source->y);
    return (rx_window){x > half ? x - half : 0, y > half ? y - half : 0,
                       x + half < image->width ? x + half + 1 : image->width,
                       y + half < image->height ? y + half + 1 : image->height};
}

rx_window rx_refine_window(const rx_refine_params *par, const rx_refine_view *view,
                           const rx_template_otf *otf, const rx_fit_source *source)
{
    const double radius = radius_of(par, source);
    const int half = half_of(view, radius), domain = side_of(par, view, otf, source, FAR * radius, 0) / 2;
    if (!looks(par))
        return (rx_window){0, 0, 0, 0};
    return window_around(view->image, source, par->substructure && domain > half ? domain : half);
}

rx_window rx_refine_alone_window(const rx_refine_view *view, const rx_fit_source *source,
                                 const rx_fit_source *other)
{
    return window_around(view->image, source, half_alone(view, source, other));
}

/* What all others leave of the pixels around the source. Priors, evidence and errors all take chi2 for that of
 * independent pixels: it is made one in the noise of what is asked about, the flux of a source with that grain. */
static rx_status cut_patch(job *j, int half, double grain, rx_error *err)
{
    RX_TRY(rx_patch_cut(j->view->image, j->cx, j->cy, half, j->size->n, &j->patch, err));
    rx_patch_add(&j->patch, &j->before->footprint, j->before->flux);
    if (grain != 1.0)
        rx_patch_dim(&j->patch, grain);
    return RX_OK;
}

rx_status rx_refine(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *otf,
                    const rx_fit_source *source, rx_fit_source *after, rx_error *err)
{
    job j = {.par = par, .view = view, .before = source};
    j.cx = (int)lround(source->x);
    j.cy = (int)lround(source->y);
    *after = *source;
    after->footprint = (rx_footprint){0};
    after->flags &= ~(RX_TPHOT_POSITION | RX_TPHOT_BOUND);
    const double radius = radius_of(par, source);
    const int half = half_of(view, radius), all = side_of(par, view, otf, source, FAR * radius, 0),
              part = side_of(par, view, otf, source, FAR * radius, half);
    rx_status status = rx_template_otf_at(otf, par->frozen ? all : part, source->x, source->y, &j.size, err);
    if (status == RX_OK && looks(par))
        status = cut_patch(&j, half, source->grain, err);
    if (status == RX_OK && !par->frozen) {
        choose(&j, after);
        j.patch.corner += all / 2 - part / 2;
        status = rx_template_otf_at(otf, all, source->x, source->y, &j.size, err);
    }
    if (status == RX_OK)
        status = finish(&j, after, err);
    rx_patch_clear(&j.patch);
    return status;
}

/* Chi2 of the better of point and profile; in a crowd of stars a point stays one: what looks extended is two of them. */
static double best_chi2(const job *j)
{
    rx_fit point, profile;
    render_patch_only(j);
    fit_point(j, &point);
    if (!j->par->extended || j->before->segment == 0 || !(point.p[RX_FIT_FLUX] > 0) ||
        (j->before->kind == RX_TPHOT_POINT && rx_crowding_at(j->view->crowd, j->cx, j->cy) &&
         rx_crowding_pair_odds(j->view->crowd, j->cx, j->cy) > 0))
        return point.chi2;
    fit_profile(j, point.p[RX_FIT_FLUX], &profile);
    return usable(&profile, &point) ? fmin(point.chi2, profile.chi2) : point.chi2;
}

rx_status rx_refine_alone(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *otf,
                          const rx_fit_source *source, const rx_fit_source *other, double *rise,
                          rx_error *err)
{
    job j = {.par = par, .view = view, .before = source};
    j.cx = (int)lround(source->x);
    j.cy = (int)lround(source->y);
    const double radius = fmax(source->guess, source->profile.radius);
    const int half = half_alone(view, source, other);
    *rise = 0;
    rx_status status = rx_template_otf_at(
        otf, side_of(par, view, otf, source->flux > other->flux ? source : other, FAR * radius, half),
        source->x, source->y, &j.size, err);
    if (status == RX_OK)
        status = cut_patch(&j, half, other->grain, err);
    if (status != RX_OK)
        return status;
    const double with = best_chi2(&j);
    rx_patch_add(&j.patch, &other->footprint, other->flux);
    *rise = best_chi2(&j) - with;
    rx_patch_clear(&j.patch);
    return RX_OK;
}
