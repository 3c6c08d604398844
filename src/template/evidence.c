/* Sources against their brighter neighbours. */
#include "template/evidence.h"

#include <math.h>

#include "base/constants.h"
#include "base/min_max.h"
#include "num/normal.h"
#include "num/stats.h"
#include "template/patch.h"

static const double OVERLAP = 0.3, BLEND = 0.2;
static const double LUMPS = 0.3; /* of a large galaxy's light, on the scale of a source */

static const double CORE = 0.1; /* of a template's peak; its width is that of the pixels above */
/* Widths of a template, in steps of half of one. At edges of 1, 2 and 3 sigmas 26, 24 and 37 false sources keep P_REAL above 0.5 and
 * 16 real ones lose it; within 1.5 widths 35, 39 and 58, and 10 (validation/edges.py; results/edges, narrow.json). */
static const double AROUND = 2.5;
enum { STEPS = 5, PLACES = (2 * STEPS + 1) * (2 * STEPS + 1) };

/* Sigmas: 95 % of the efficiency of least squares where errors are normal. */
static const double HUBER = 1.345;
/* Widths by which z beside a point (a Gaussian), exp(-pi (r / width)^2), has fallen from 90 to 1. */
static const double POINT = 1.2;
enum { TURNS = 10 }; /* of weights */

/* The brighter member with most light under the template of i; -1: none. *light: in units of i's flux. */
static int brightest_over(const rx_fit_source *subjects, const int *member, int n, int i, double *light)
{
    const rx_fit_source *one = &subjects[member[i]];
    const double power = rx_footprint_product(&one->footprint, &one->footprint, NULL);
    int found = -1;
    *light = 0;
    for (int j = 0; j < n && power > 0; j++) {
        const rx_fit_source *other = &subjects[member[j]];
        if (j == i || !(other->flux > one->flux))
            continue;
        const double under =
            other->flux / one->flux * rx_footprint_product(&one->footprint, &other->footprint, NULL) / power;
        if (under > *light) {
            *light = under;
            found = j;
        }
    }
    return found;
}

rx_fit_neighbour rx_evidence_neighbour(const rx_fit_source *subjects, const rx_joint_member *members,
                                       const int *member, int n, int i)
{
    const double flux = subjects[member[i]].flux, variance = members[member[i]].variance;
    rx_fit_neighbour rival = {.one = member[i], .other = -1};
    rival.alone = flux > 0 && variance > 0 ? flux * flux / variance : 0;
    if (!(rival.alone > 0))
        return rival;
    const int j = brightest_over(subjects, member, n, i, &rival.light);
    if (j >= 0 && (rival.light >= OVERLAP || members[member[i]].blend >= BLEND))
        rival.other = member[j];
    return rival;
}

/* By what flux^2 / variance rises where the variance is that of a flux of 0: photons that a source itself claims do not hide it.
 * What they take of the weights under its template. */
static double without_own_photons(const rx_fit_image *c, const rx_fit_source *s)
{
    const rx_footprint *f = &s->footprint;
    double with = 0, without = 0;
    for (int v = 0; v < f->height; v++)
        for (int u = 0; u < f->width; u++) {
            const size_t k = rx_fit_image_row(c, f->y0 + v) + (size_t)(f->x0 + u);
            const double t = (double)f->values[(size_t)v * (size_t)f->width + (size_t)u],
                         power = t * t * (double)c->weight[k];
            with += power;
            without += power > 0 ? power * rx_fit_image_quiet(c, k, s->flux * t) : 0;
        }
    return with > 0 ? without / with : 1;
}

rx_status rx_evidence_of(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *lens,
                         const rx_fit_source *subjects, const rx_fit_neighbour *rival, double *evidence,
                         rx_error *err)
{
    double rise = 0;
    *evidence = rival->alone * without_own_photons(view->canvas, &subjects[rival->one]);
    if (rival->other < 0)
        return RX_OK;
    const rx_fit_source *other = &subjects[rival->other];
    rx_status status = rx_refine_alone(par, view, lens, other, &subjects[rival->one], &rise, err);
    if (status != RX_OK || !isfinite(rise))
        return status;
    /* arms and knots of a galaxy that is resolved */
    const double r2 = other->profile.radius * other->profile.radius, fwhm = view->fwhm;
    const double rough =
        other->kind == RX_TPHOT_POINT ? 0 : LUMPS * (1 - other->point) * r2 / (r2 + fwhm * fwhm);
    const double lumps = rough * rival->light;
    *evidence = 1 / (1 / fmin(*evidence, fmax(rise, 1e-3)) + lumps * lumps);
    return RX_OK;
}

/* Where a template is above CORE of its peak, and how wide it is: sqrt(N) of N pixels that it is worth. */
typedef struct core {
    rx_window box;
    double least, width;
} core;

static core core_of(const rx_footprint *f)
{
    core dst = {{f->width, f->height, 0, 0}, CORE * rx_footprint_peak(f), 0};
    double sum = 0, power = 0;
    for (int v = 0; v < f->height; v++)
        for (int u = 0; u < f->width; u++) {
            const double t = f->values[(size_t)v * (size_t)f->width + (size_t)u];
            if (!(t > dst.least))
                continue;
            dst.box = (rx_window){rx_min_int(dst.box.x0, u), rx_min_int(dst.box.y0, v),
                                  rx_max_int(dst.box.x1, u + 1), rx_max_int(dst.box.y1, v + 1)};
            sum += t;
            power += t * t;
        }
    dst.width = power > 0 ? sum / sqrt(power) : 0;
    return dst;
}

/* What the template, moved by (dx, dy), finds in what the models leave, in errors; 0 where less than half of it is seen. */
static int response(const rx_fit_image *c, const rx_fit_source *s, const core *of, int dx, int dy, double *z)
{
    const rx_footprint *f = &s->footprint;
    double value = 0, power = 0, seen = 0, all = 0;
    for (int v = of->box.y0; v < of->box.y1; v++)
        for (int u = of->box.x0; u < of->box.x1; u++) {
            const double t = f->values[(size_t)v * (size_t)f->width + (size_t)u];
            const int x = f->x0 + u + dx, y = f->y0 + v + dy;
            if (!(t > of->least))
                continue;
            all += t * t;
            if (x < 0 || x >= c->width || y < 0 || y >= c->height)
                continue;
            const size_t k = rx_fit_image_row(c, y) + (size_t)x;
            const double w = c->weight[k];
            value += w * t * ((double)c->data[k] - c->model[k]);
            power += w * t * t;
            seen += w > 0 ? t * t : 0;
        }
    *z = power > 0 ? value / sqrt(power) / s->grain : 0;
    return power > 0 && seen >= 0.5 * all;
}

rx_window rx_evidence_window(const rx_fit_image *image, const rx_fit_source *source)
{
    const rx_window own = rx_footprint_window(&source->footprint);
    const int reach = (int)ceil(AROUND * core_of(&source->footprint).width) + 1;
    if (own.x1 <= own.x0)
        return own;
    return (rx_window){rx_max_int(own.x0 - reach, 0), rx_max_int(own.y0 - reach, 0),
                       rx_min_int(own.x1 + reach, image->width), rx_min_int(own.y1 + reach, image->height)};
}

/* z around a source, and where. */
typedef struct samples {
    double x[PLACES], y[PLACES], z[PLACES];
    int n;
} samples;

static void sample(const rx_fit_image *c, const rx_fit_source *s, const core *of, samples *dst)
{
    const double step = AROUND / STEPS * of->width;
    dst->n = 0;
    for (int j = -STEPS; j <= STEPS; j++)
        for (int i = -STEPS; i <= STEPS; i++) {
            const int dx = (int)lround(i * step), dy = (int)lround(j * step);
            double z;
            if (i * i + j * j > STEPS * STEPS || !response(c, s, of, dx, dy, &z))
                continue;
            dst->x[dst->n] = dx;
            dst->y[dst->n] = dy;
            dst->z[dst->n++] = z;
        }
}

/* Huber's plane through them, by 1.4826 median |rest|, at least the noise's 1; rest: z - plane. */
static rx_status fit_plane(const samples *at, double plane[3], double *rest, rx_error *err)
{
    double weight[PLACES], away[PLACES];
    for (int i = 0; i < at->n; i++)
        weight[i] = 1;
    for (int turn = 0; turn < TURNS; turn++) {
        double a[9] = {0}, b[3] = {0};
        int singular;
        for (int i = 0; i < at->n; i++) {
            const double by[3] = {1, at->x[i], at->y[i]};
            for (int k = 0; k < 9; k++)
                a[k] += weight[i] * by[k / 3] * by[k % 3];
            for (int k = 0; k < 3; k++)
                b[k] += weight[i] * by[k] * at->z[i];
        }
        RX_TRY(rx_normal_solve(a, b, 3, plane, NULL, &singular, err));
        for (int i = 0; i < at->n; i++) {
            rest[i] = at->z[i] - plane[0] - plane[1] * at->x[i] - plane[2] * at->y[i];
            away[i] = fabs(rest[i]);
        }
        const double most = HUBER * fmax(RX_MAD_SIGMA * rx_median(away, (size_t)at->n), 1);
        for (int i = 0; i < at->n; i++)
            weight[i] = fabs(rest[i]) > most ? most / fabs(rest[i]) : 1;
    }
    return RX_OK;
}

/* Mean square of those below 0, at least the noise's 1, without what a point covers at the place farthest from it. */
static double square_below(const samples *at, const double *rest, double width)
{
    int most = 0, n = 0;
    double square = 0;
    for (int i = 1; i < at->n; i++)
        most = fabs(rest[i]) > fabs(rest[most]) ? i : most;
    for (int i = 0; i < at->n; i++)
        if (rest[i] < 0 && hypot(at->x[i] - at->x[most], at->y[i] - at->y[most]) > POINT * width) {
            square += rest[i] * rest[i];
            n++;
        }
    return n > 0 ? fmax(square / n, 1) : 1;
}

rx_status rx_evidence_amid_sky(const rx_fit_image *image, const rx_fit_source *source, double alone,
                               double *evidence, rx_error *err)
{
    const core of = core_of(&source->footprint);
    samples at;
    if (!(*evidence > 0) || !(alone > 0) || !(of.width >= 1))
        return RX_OK;
    sample(image, source, &of, &at);
    const double n = at.n * AROUND / STEPS * AROUND / STEPS; /* independent ones: a width apart */
    double plane[3], rest[PLACES];
    if (!(n > 4)) /* no more than is fitted */
        return RX_OK;
    RX_TRY(fit_plane(&at, plane, rest, err));
    const double level = plane[0], width = square_below(&at, rest, of.width);
    const double gain = 0.5 * n * (width + level * level - 1 - log(width)) - log(n);
    const double share = 1 / (1 + exp(-fmin(fmax(gain, -80), 80)));
    const double brighter = fmax(1 - share * level / sqrt(alone), 0);
    *evidence = fmin(*evidence, brighter * brighter / (1 / *evidence + share * (width - 1) / alone));
    return RX_OK;
}
