/* Two sources that are fitted as one. */
#include "template/two.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "template/evidence.h"
#include "template/fit.h"
#include "template/patch.h"

static const double CLEAR = 6.0; /* S/N: no noise is above */
static const double LEAST = 0.5; /* times the flux of the other */
static const double ROUGH =
    2.0; /* variance over that of the noise: unseen sources, and first order in the shift */
static const double CLEAR_GAIN =
    5.0; /* ln of a likelihood ratio: above, two points and a profile are compared by fits of both */
static const double FAR = 2.0;   /* half-light radii that the domain holds around a profile */
static const double NONE = 1e-6; /* of a template's power: what is left of it is rounding */
/* Places along a FWHM: a template half as far as that is the same within 1 %. */
enum { ALONG = 4, BASE = 6, BINS = 3 };

/* One template in its surroundings. */
typedef struct job {
    const rx_refine_view *view;
    const rx_two_counts *counts;
    rx_template_domain *size;
    rx_patch patch;
    double *base; /* [BASE][side][side] orthonormal columns */
} job;

static int descending(const void *one, const void *other)
{
    const double a = *(const double *)one, b = *(const double *)other;
    return (a < b) - (a > b);
}

rx_status rx_two_counts_make(const double *flux, const double *error, int n, double pixels,
                             rx_two_counts *counts, rx_error *err)
{
    *counts = (rx_two_counts){.pixels = fmax(pixels, 1.0)};
    RX_TRY(RX_MAKE(counts->flux, (size_t)n + 1, err));
    double sum = 0;
    for (int i = 0; i < n; i++)
        if (flux[i] > CLEAR * error[i] && isfinite(flux[i])) {
            counts->flux[counts->n++] = flux[i];
            sum += log(error[i]);
        }
    qsort(counts->flux, (size_t)counts->n, sizeof *counts->flux, descending);
    counts->least = CLEAR * exp(counts->n > 0 ? sum / counts->n : 0);
    return RX_OK;
}

void rx_two_counts_clear(rx_two_counts *counts)
{
    free(counts->flux);
    *counts = (rx_two_counts){0};
}

/* Sources a pixel brighter than that. */
static double density(const rx_two_counts *c, double flux)
{
    const double at = fmax(flux, c->least);
    int first = 0, end = c->n; /* the first that is not */
    while (first < end) {
        const int middle = first + (end - first) / 2;
        if (c->flux[middle] > at)
            first = middle + 1;
        else
            end = middle;
    }
    /* no sky is without sources: one more */
    return flux > 0 ? (first * at + c->least) / (c->pixels * flux) : 0;
}

static int reach(const rx_refine_view *view)
{
    return (int)floor(view->fwhm);
}

static int half_of(const rx_refine_view *view, const rx_fit_source *source)
{
    return (int)ceil(1.5 * view->fwhm + fmin(source->profile.radius, view->fwhm)) + 1;
}

rx_window rx_two_window(const rx_refine_view *view, const rx_fit_source *source)
{
    const int half = half_of(view, source), x = (int)lround(source->x), y = (int)lround(source->y);
    const rx_fit_image *c = view->image;
    return (rx_window){x > half ? x - half : 0, y > half ? y - half : 0,
                       x + half < c->width ? x + half + 1 : c->width,
                       y + half < c->height ? y + half + 1 : c->height};
}

RX_SIMD static double product(const job *j, const double *a, const double *b)
{
    const size_t pixels = (size_t)j->patch.side * (size_t)j->patch.side;
    double sum = 0;
#pragma omp simd reduction(+ : sum)
    for (size_t k = 0; k < pixels; k++)
        sum += j->patch.weight[k] * a[k] * b[k];
    return sum;
}

RX_SIMD static double dot(const double *a, const double *b, size_t n)
{
    double sum = 0;
#pragma omp simd reduction(+ : sum)
    for (size_t k = 0; k < n; k++)
        sum += a[k] * b[k];
    return sum;
}

/* column less what the first `count` have of it; its power before that. */
RX_SIMD static double orthogonal(const job *j, int count, double *column)
{
    const size_t pixels = (size_t)j->patch.side * (size_t)j->patch.side;
    const double power = product(j, column, column);
    for (int i = 0; i < count; i++) {
        const double *own = j->base + (size_t)i * pixels, part = product(j, own, column);
#pragma omp simd
        for (size_t k = 0; k < pixels; k++)
            column[k] -= part * own[k];
    }
    return power;
}

/* The template and its derivatives by position, and the second ones, as size and ellipticity change it. */
static void fill_base(const job *j)
{
    const size_t side = (size_t)j->patch.side, stride = (size_t)rx_fft_stride_real(j->size->fft);
    double *column[BASE];
    for (int i = 0; i < BASE; i++)
        column[i] = j->base + (size_t)i * side * side;
    for (size_t v = 0; v < side; v++) {
        const float *t = j->size->plane[0] + (v + (size_t)j->patch.corner) * stride + j->patch.corner;
        const float *up = t + stride, *down = t - stride;
        for (size_t u = 0; u < side; u++) {
            const size_t k = v * side + u;
            column[0][k] = t[u];
            column[1][k] = 0.5 * (t[u + 1] - t[u - 1]);
            column[2][k] = 0.5 * (up[u] - down[u]);
            column[3][k] = t[u + 1] + t[u - 1] - 2 * t[u];
            column[4][k] = up[u] + down[u] - 2 * t[u];
            column[5][k] = 0.25 * (up[u + 1] + down[u - 1] - up[u - 1] - down[u + 1]);
        }
    }
}

/* A sum of terms far apart: sum exp(scale). */
typedef struct scaled {
    double sum, scale;
} scaled;

static void add(scaled *s, double factor, double exponent)
{
    if (exponent > s->scale) {
        s->sum *= exp(s->scale - exponent);
        s->scale = exponent;
    }
    s->sum += factor * exp(exponent - s->scale);
}

/* number times the mean of exp((2 f f' - f^2) / (2 e^2)) over low < f < high, to a fifth. */
static void add_mean_ratio(scaled *s, double number, double found, double variance, double low, double high)
{
    const double width = high - low, at = fmin(fmax(found, low), high);
    const double steep = fabs(found - at) / variance * width, wide = sqrt(2 * M_PI * variance) / width;
    const double side = steep > 1e-3 ? -expm1(-steep) / steep : 1;
    add(s, number * fmin(side, fmin(found == at ? wide : 0.5 * wide, 1)),
        (at * found - 0.5 * at * at) / variance);
}

/* ln(exp(a) + exp(b)) */
static double log_sum(double a, double b)
{
    const double most = fmax(a, b);
    return isfinite(most) ? most + log1p(exp(fmin(a, b) - most)) : most;
}

/* Sources by chance on a pixel, `low` to `high` times as bright as the first, where a template has that share of its light under that of the
 * other. A fit of one template to both has the flux F = f1 + share f2 and is that much nearer to the second one; of fluxes near F there are
 * as 1 / f^2, so that more sources have f1 than have F. */
static double chance(const rx_two_counts *c, double total, double share, double low, double high)
{
    const double more = 1 + share * 0.5 * (low + high);
    return (density(c, low * total / more) - density(c, high * total / more)) * more * more;
}

/* ln; plane 0 is the template. */
static double odds_beside(const job *j, int nbase, double total, double lumps, double *room, double best[3])
{
    const rx_patch *p = &j->patch;
    const size_t side = (size_t)p->side, pixels = side * side,
                 stride = (size_t)rx_fft_stride_real(j->size->fft);
    const int most = reach(j->view), step = most > ALONG ? most / ALONG : 1;
    scaled sum = {0, 0};
    int count = 0;
    fill_base(j);
    const double size =
        sqrt(product(j, j->base, j->base)); /* of the template, the first of the orthonormal columns */
    for (int i = 0; i < nbase; i++) {
        double *own = j->base + (size_t)count * pixels, *from = j->base + (size_t)i * pixels;
        for (size_t k = 0; k < pixels && own != from; k++)
            own[k] = from[k];
        const double power = orthogonal(j, count, own), left = product(j, own, own);
        if (!(left > NONE * power))
            continue;
        for (size_t k = 0; k < pixels; k++)
            own[k] /= sqrt(left);
        count++;
    }
    if (count == 0)
        return -HUGE_VAL;
    for (size_t k = 0; k < pixels; k++)
        room[k] = p->data[k];
    double *rest = room, *other = room + pixels;
    orthogonal(j, count, rest);
    for (int i = 0; i < count; i++)
        for (size_t k = 0; k < pixels; k++)
            j->base[(size_t)i * pixels + k] *= p->weight[k];
    for (size_t k = 0; k < pixels; k++)
        rest[k] *= p->weight[k];
    for (int dy = -most / step * step; dy <= most; dy += step)
        for (int dx = -most / step * step; dx <= most; dx += step) {
            if (dx * dx + dy * dy > j->view->fwhm * j->view->fwhm)
                continue;
            for (size_t v = 0; v < side; v++) {
                const float *t = j->size->plane[0] + (v + (size_t)p->corner) * stride + p->corner -
                                 dy * (ptrdiff_t)stride - dx;
                for (size_t u = 0; u < side; u++)
                    other[v * side + u] = t[u];
            }
            const double power = product(j, other, other), first = dot(j->base, other, pixels);
            double left = power - first * first;
            for (int i = 1; i < count; i++)
                left -= pow(dot(j->base + (size_t)i * pixels, other, pixels), 2);
            const double share = fmax(first / size, 0),
                         found = left > NONE * power ? dot(rest, other, pixels) / left : 0,
                         variance = ROUGH / fmax(left, NONE * power) + lumps * lumps * total * total;
            const double at = fmin(fmax(found, LEAST * total), total),
                         gain = (at * found - 0.5 * at * at) / variance;
            if (gain > best[0]) {
                best[0] = gain;
                best[1] = dx;
                best[2] = dy;
            }
            for (int b = 0; b < BINS; b++) {
                const double low = LEAST + (1 - LEAST) * b / BINS,
                             high = LEAST + (1 - LEAST) * (b + 1) / BINS;
                const double number = chance(j->counts, total, share, low, high) * step * step;
                add_mean_ratio(&sum, number, found, variance, low * total, high * total);
            }
        }
    return log(sum.sum) + sum.scale;
}

/* Two points fitted to the pixels: half of the chi2 that they gain over one, 0 where they are none of that kind. */
static double gain_of_pair(const job *j, double dx, double dy, const double best[3])
{
    rx_fit point = {.n = RX_FIT_POINT, .p = {0, dx, dy}, .iterations = 12};
    double pair[2][3];
    rx_fit_run(&point, j->size, &j->patch);
    const double chi2 = rx_fit_pair(&point, (double[2]){0.5 * best[1], 0.5 * best[2]}, 1.5 * j->view->fwhm,
                                    -HUGE_VAL, j->size, &j->patch, pair);
    const double fainter = fmin(pair[0][0], pair[1][0]), brighter = fmax(pair[0][0], pair[1][0]);
    const double apart = hypot(pair[0][1] - pair[1][1], pair[0][2] - pair[1][2]);
    return isfinite(chi2) && fainter >= LEAST * brighter && apart <= j->view->fwhm
               ? fmax(0.5 * (point.chi2 - chi2), 0)
               : 0;
}

rx_status rx_two_odds(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *otf,
                      const rx_two_counts *counts, rx_fit_source *source, rx_error *err)
{
    job j = {.view = view, .counts = counts};
    const int cx = (int)lround(source->x), cy = (int)lround(source->y), half = half_of(view, source);
    const double dx = source->x - cx, dy = source->y - cy;
    const int profile = source->kind != RX_TPHOT_POINT;
    source->two = NAN;
    if (!(source->flux > 0))
        return RX_OK;
    const int x = rx_min_int(rx_max_int(cx, 0), view->image->width - 1),
              y = rx_min_int(rx_max_int(cy, 0), view->image->height - 1);
    const double faint =
        RX_REFINE_FAINT * sqrt((double)rx_fit_image_variance(view->image, x, y)) / source->flux;
    RX_TRY(rx_template_otf_at(
        otf, rx_template_otf_side(otf, fmax(FAR * source->profile.radius, reach(view)), faint, 0), source->x,
        source->y, &j.size, err));
    RX_TRY(rx_patch_cut(view->image, cx, cy, rx_min_int(half, j.size->n / 2 - reach(view) - 2), j.size->n,
                        &j.patch, err));
    j.size->first = j.patch.corner - reach(view) - 1;
    j.size->last = j.patch.corner + j.patch.side + reach(view) + 1;
    rx_patch_add(&j.patch, &source->footprint, source->flux);
    rx_patch_dim(&j.patch, source->grain);
    const size_t pixels = (size_t)j.patch.side * (size_t)j.patch.side;
    double *room = rx_alloc((BASE + 2) * pixels, sizeof *room), of_points = -HUGE_VAL,
           of_profiles = -HUGE_VAL;
    if (room == NULL) {
        rx_patch_clear(&j.patch);
        return rx_error_memory(err, (BASE + 2) * pixels * sizeof *room);
    }
    j.base = room + 2 * pixels;
    rx_template_domain_render(j.size, NULL, dx, dy, NULL, 1);
    double best[3] = {0};
    of_points = odds_beside(&j, 3, source->as_point > 0 ? source->as_point : source->flux, 0, room, best);
    if (profile && best[0] > CLEAR_GAIN) {
        of_points +=
            rx_refine_amid_structure(view, cx, cy, gain_of_pair(&j, dx, dy, best), source->profile.radius) -
            best[0];
    }
    if (profile) {
        rx_template_domain_render(j.size, &source->profile, dx, dy, NULL, 1);
        of_profiles = odds_beside(&j, BASE, source->lift * source->flux,
                                  rx_evidence_lumps(source, view->fwhm), room, (double[3]){0});
    }
    free(room);
    rx_patch_clear(&j.patch);
    /* ln of what each hypothesis has for it, in units of that for one point. Of what is added no profile is tried: as many are extended
     * as of others of that flux. */
    const double evidence =
        isnan(source->evidence) && source->added >= 0 && par->extended ? 0 : source->evidence;
    const double galaxy =
        isnan(evidence) ? -HUGE_VAL : -rx_prior_log_odds(par->tile_prior, source->as_point, evidence);
    const double twos = log_sum(of_points, of_profiles + galaxy), all = log_sum(log_sum(0, galaxy), twos);
    source->two = exp(twos - all);
    source->star = exp(log_sum(0, of_points) - all);
    return RX_OK;
}
