/* Stars of a tile against a PSF model: subtracting all of them, fitting each, solving for the model.
 *
 *   pixel = sky + sum_i flux_i P(u - u_i) + noise
 *   weight = 1 / (sigma^2 + flux P / gain + (E flux P)^2)
 *
 * All sources take a step against the same residual (as a Jacobi iteration does), so neighbours are subtracted and the
 * order does not matter. For the model, with fluxes and positions held,
 *   chi2 = sum weight (data - flux P)^2
 * is minimised over c = prior + sum_q a_q D_q + tau G y by preconditioned conjugate gradients: D_q, the profile's
 * derivatives by its size and ellipse; G, a Gaussian half as wide as the PSF (what differs from the profile is no finer);
 * tau, how much a coefficient may depart from the profile, follows it and falls to 0 at the edge of the core. The prior
 * of a and y is |a / MODE|^2 + |y|^2. */
#include "psf/psf_fit.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/simd.h"
#include "num/normal.h"
#include "num/special.h"
#include "num/stats.h"

enum { STARS_A_BLOCK = 16, POINTS_A_BLOCK = 256 };
/* Of a pixel of the model, relative, where a saturated star is fitted: its core is steep there. */
static const double SATURATED_ERROR = 0.05;

static size_t nodes_of(const rx_psf_model *model)
{
    return (size_t)model->side * (size_t)model->side;
}

static size_t stamp_size(const rx_psf_model *model)
{
    return (size_t)(2 * model->half + 1) * (size_t)(2 * model->half + 1);
}

/* Nodes of a star, its stamp with two derivatives, work. */
static size_t room_of(const rx_psf_model *model)
{
    return nodes_of(model) + 3 * stamp_size(model) + rx_psf_model_work(model);
}

float *rx_psf_job_room(const rx_psf_job *job)
{
    return job->stamps + (size_t)omp_get_thread_num() * room_of(&job->model);
}

/* Nodes of the PSF at a place: where it does not vary those of the model. */
static const float *nodes_at(const rx_psf_model *model, double x, double y, float *room)
{
    double terms[RX_PSF_TERMS];
    if (model->nterms == 1)
        return model->c;
    rx_psf_model_terms(model, x, y, terms);
    rx_psf_model_mix(model, model->c, terms, model->nterms, room);
    return room;
}

/* ---- all points off the image ---- */

int rx_psf_job_reach(const rx_psf_job *job, const rx_psf_point *p)
{
    const rx_psf_model *model = &job->model;
    const double least = 0.05 * fmax(job->image->global_noise, 1e-30);
    int low = (int)fmin(model->half, ceil(2.0 * job->fwhm)), high = (int)(model->nwing * RX_PSF_WING_STEP);
    if (!(p->flux * (double)rx_psf_model_wing(model, low) > least))
        return low;
    while (high - low > 1) {
        const int mid = (low + high) / 2;
        *(p->flux * (double)rx_psf_model_wing(model, mid) > least ? &low : &high) = mid;
    }
    return high;
}

static void draw(const rx_psf_job *job, const rx_psf_point *p, float *stamp, float *room)
{
    const rx_psf_model *model = &job->model;
    const int half = p->reach < model->half ? p->reach : model->half, n = 2 * p->reach + 1,
              core = 2 * half + 1;
    float *inner = room + nodes_of(model);
    const double dx = p->x - p->cx, dy = p->y - p->cy;
    rx_psf_model_stamp(model, nodes_at(model, p->x, p->y, room), dx, dy, half,
                       &(rx_psf_stamp){inner, NULL, NULL, inner + 3 * stamp_size(model)});
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
            const int x = i - p->reach, y = j - p->reach;
            const float value =
                abs(x) <= half && abs(y) <= half
                    ? inner[(size_t)(y + half) * (size_t)core + (size_t)(x + half)]
                    : rx_psf_model_wing(model, sqrt((x - dx) * (x - dx) + (y - dy) * (y - dy)));
            stamp[(size_t)j * (size_t)n + (size_t)i] = (float)p->flux * value;
        }
}

typedef struct box {
    int x0, y0, x1, y1;
} box;

/* The part of a point's stamp that is on the image and in rows from..to. */
static box on_image(const rx_psf_job *job, const rx_psf_point *p, int from, int to)
{
    return (box){p->cx - p->reach > 0 ? p->cx - p->reach : 0,
                 p->cy - p->reach > from ? p->cy - p->reach : from,
                 p->cx + p->reach < job->image->width ? p->cx + p->reach + 1 : job->image->width,
                 p->cy + p->reach < to ? p->cy + p->reach + 1 : to};
}

/* The stamps of points [n], one after the other, off the rows from..to. */
static void take_off(const rx_psf_job *job, const rx_psf_point *points, int n, const float *const *stamps,
                     int from, int to)
{
    for (int i = 0; i < n; i++) {
        const rx_psf_point *p = &points[i];
        const box on = on_image(job, p, from, to);
        const int side = 2 * p->reach + 1;
        for (int y = on.y0; y < on.y1; y++) {
            float *row = job->rest + (size_t)y * (size_t)job->image->width;
            const float *stamp = stamps[i] + (size_t)(y - p->cy + p->reach) * (size_t)side;
            for (int x = on.x0; x < on.x1; x++)
                row[x] -= stamp[x - p->cx + p->reach];
        }
    }
}

/* The rows from..to as the image has them: all, or, where points hide the lesser part of it, what is below their stamps. */
static void put_back(const rx_psf_job *job, int all, int from, int to)
{
    const size_t width = (size_t)job->image->width;
    const float *pixels = job->image->pixels;
    if (all)
        memcpy(job->rest + (size_t)from * width, pixels + (size_t)from * width,
               (size_t)(to - from) * width * sizeof(float));
    for (int i = 0; !all && i < job->n; i++) {
        const box on = on_image(job, &job->points[i], from, to);
        for (int y = on.y0; y < on.y1 && on.x1 > on.x0; y++)
            memcpy(job->rest + (size_t)y * width + on.x0, pixels + (size_t)y * width + on.x0,
                   (size_t)(on.x1 - on.x0) * sizeof(float));
    }
}

rx_status rx_psf_job_subtract(rx_psf_job *job, rx_error *err)
{
    enum { BAND = 64 }; /* rows */
    const int height = job->image->height;
    const float *stamps[POINTS_A_BLOCK];
    double hidden = 0;
    for (int i = 0; i < job->n; i++)
        hidden += (2.0 * job->points[i].reach + 1) * (2.0 * job->points[i].reach + 1);
    const int none_yet = job->n == 0 || job->points[0].reach == 0,
              all = none_yet || 2.0 * hidden > (double)job->image->width * height;
#pragma omp parallel for schedule(dynamic, 1) num_threads(job->nthreads)
    for (int y = 0; y < height; y += BAND)
        put_back(job, all, y, y + BAND < height ? y + BAND : height);
    for (int first = 0; first < job->n; first += POINTS_A_BLOCK) {
        rx_psf_point *points = job->points + first;
        const int count = job->n - first < POINTS_A_BLOCK ? job->n - first : POINTS_A_BLOCK;
        size_t size = 0, at[POINTS_A_BLOCK];
        for (int i = 0; i < count; i++) {
            points[i].cx = (int)lround(points[i].x);
            points[i].cy = (int)lround(points[i].y);
            points[i].reach = rx_psf_job_reach(job, &points[i]);
            at[i] = size;
            size += (size_t)(2 * points[i].reach + 1) * (size_t)(2 * points[i].reach + 1);
        }
        float *room = RX_NEW(float, size);
        if (room == NULL)
            return rx_error_memory(err, size * sizeof(float));
#pragma omp parallel for schedule(dynamic, 8) num_threads(job->nthreads)
        for (int i = 0; i < count; i++) {
            stamps[i] = room + at[i];
            draw(job, &points[i], room + at[i], rx_psf_job_room(job));
        }
#pragma omp parallel for schedule(dynamic, 1) num_threads(job->nthreads)
        for (int y = 0; y < height; y += BAND)
            take_off(job, points, count, stamps, y, y + BAND < height ? y + BAND : height);
        free(room);
    }
    return RX_OK;
}

double rx_psf_job_radius(const rx_psf_job *job, double x, double y)
{
    const rx_moffat *m = &job->profile;
    const double r = sqrt(x * x + y * y), t = fmin(fmax((r / job->model.half - 0.7) / 0.3, 0.0), 1.0);
    if (t >= 1.0)
        return r;
    const double round = t * t * (3.0 - 2.0 * t), q = m->xx * x * x + m->yy * y * y + 2.0 * m->xy * x * y;
    return r * round + m->hwhm * sqrt(fmax(q, 0.0)) * (1.0 - round);
}

/* ---- one star ---- */

/* A row of a star's stamp. */
typedef struct stamp_row {
    int n;
    double v, dx;                 /* of the row's centres from the star; of the star from the middle pixel */
    const float *value, *gx, *gy; /* [n] */
    float sigma[2 * RX_PSF_HALF + 1]; /* noise; 0: not used, -1: outside of the tile */
    double weight[2 * RX_PSF_HALF + 1], off[2 * RX_PSF_HALF + 1]; /* off: data less sky and model */
} stamp_row;

/* What a star's pixels say of its flux, place and sky. */
typedef struct star_sums {
    double a[4][4], b[4], chi2; /* a: lower triangle */
    int count, masked, clipped;
} star_sums;

/* The noise of the row's pixels from (x0, y) on, and what is left there less the sky. */
static void read_row(const rx_psf_job *job, const rx_psf_point *p, int x0, int y, stamp_row *row)
{
    const rx_image *image = job->image;
    const int from = x0 > 0 ? x0 : 0, to = x0 + row->n < image->width ? x0 + row->n : image->width;
    float sigmas[2 * RX_PSF_HALF + 1];
    for (int i = 0; i < row->n; i++) {
        row->sigma[i] = -1.0F;
        row->off[i] = 0.0;
    }
    if (y < 0 || y >= image->height || to <= from)
        return;
    const size_t at = (size_t)y * (size_t)image->width;
    const float *noise =
        rx_map_given(&image->noise) ? rx_map_row(&image->noise, y, from, to - from, sigmas) : NULL;
    for (int x = from; x < to; x++)
        if (!rx_psf_job_uses(job, p, at + (size_t)x)) {
            row->sigma[x - x0] = 0.0F;
        } else {
            row->sigma[x - x0] = noise != NULL ? noise[x - from] : 1.0F;
            row->off[x - x0] = (double)job->rest[at + (size_t)x] - p->sky;
        }
}

/* Weights, and their sums. Away from the core what is five sigmas off is of something else. */
RX_SIMD static void add_row(const rx_psf_job *job, const rx_psf_point *p, int half, stamp_row *row,
                            star_sums *dst)
{
    const double gain = job->image->gain, grain = gain > 0.0 ? 1.0 / gain : 0.0, core = job->fwhm * job->fwhm,
                 hole = p->saturated * p->saturated, edge = (half + 0.5) * (half + 0.5), flux = p->flux;
    const double error = p->saturated > 0.0 ? fmax(SATURATED_ERROR, job->model_error) : job->model_error;
    const double error2 = error * error, v2 = row->v * row->v, first = -half - row->dx;
    int count = 0, masked = 0, clipped = 0;
#pragma omp simd reduction(+ : count, masked, clipped)
    for (int i = 0; i < row->n; i++) {
        const double u = first + i, away = u * u + v2, sigma = (double)row->sigma[i], off = row->off[i],
                     light = flux * (double)row->value[i], bright = light > 0.0 ? light : 0.0;
        const double variance = sigma * sigma + bright * grain + error2 * bright * bright;
        const int inside = away <= edge && away >= hole, used = inside && sigma > 0.0,
                  far = used && off * off > 25.0 * variance && away > core;
        masked += inside && sigma == 0.0 && away < core;
        clipped += far;
        count += used && !far;
        row->weight[i] = used && !far ? 1.0 / variance : 0.0;
    }
    double a00 = 0.0, a10 = 0.0, a11 = 0.0, a20 = 0.0, a21 = 0.0, a22 = 0.0, a30 = 0.0, a31 = 0.0, a32 = 0.0,
           a33 = 0.0, b0 = 0.0, b1 = 0.0, b2 = 0.0, b3 = 0.0, chi2 = 0.0;
#pragma omp simd reduction(+ : a00, a10, a11, a20, a21, a22, a30, a31, a32, a33, b0, b1, b2, b3, chi2)
    for (int i = 0; i < row->n; i++) {
        const double w = row->weight[i], wo = w * row->off[i], g0 = (double)row->value[i],
                     g1 = (double)row->gx[i], g2 = (double)row->gy[i], w0 = w * g0, w1 = w * g1, w2 = w * g2;
        a00 += w0 * g0;
        a10 += w1 * g0;
        a11 += w1 * g1;
        a20 += w2 * g0;
        a21 += w2 * g1;
        a22 += w2 * g2;
        a30 += w0;
        a31 += w1;
        a32 += w2;
        a33 += w;
        b0 += wo * g0;
        b1 += wo * g1;
        b2 += wo * g2;
        b3 += wo;
        chi2 += wo * row->off[i];
    }
    const double more[4][4] = {{a00}, {a10, a11}, {a20, a21, a22}, {a30, a31, a32, a33}},
                 right[4] = {b0, b1, b2, b3};
    for (int k = 0; k < 4; k++) {
        dst->b[k] += right[k];
        for (int l = 0; l <= k; l++)
            dst->a[k][l] += more[k][l];
    }
    dst->chi2 += chi2;
    dst->count += count;
    dst->masked += masked;
    dst->clipped += clipped;
}

static void step(const rx_psf_job *job, rx_psf_point *p, int with_positions, float *room)
{
    if (p->saturated > 0.0 && !(p->flux > 0.0)) /* until rings give it one */
        return;
    const rx_psf_model *model = &job->model;
    const int cx = (int)lround(p->x), cy = (int)lround(p->y), small = (int)ceil(1.5 * job->fwhm) + 1;
    const int half = p->star || p->saturated > 0.0 || small > model->half ? model->half : small,
              n = 2 * half + 1;
    const double dx = p->x - cx, dy = p->y - cy;
    float *value = room + nodes_of(model), *gx = value + stamp_size(model), *gy = gx + stamp_size(model);
    rx_psf_model_stamp(model, nodes_at(model, p->x, p->y, room), dx, dy, half,
                       &(rx_psf_stamp){value, gx, gy, gy + stamp_size(model)});
    star_sums sums = {.count = 0};
    stamp_row row = {.n = n, .dx = dx};
    for (int j = 0; j < n; j++) {
        const size_t at = (size_t)j * (size_t)n;
        row.v = j - half - dy;
        row.value = value + at;
        row.gx = gx + at;
        row.gy = gy + at;
        read_row(job, p, cx - half, cy - half + j, &row);
        add_row(job, p, half, &row, &sums);
        for (int i = 0; i < n && p->star; i++) {
            p->data[at + (size_t)i] =
                row.weight[i] > 0.0 ? (float)(row.off[i] + p->flux * (double)row.value[i]) : 0.0F;
            p->weight[at + (size_t)i] = (float)row.weight[i];
        }
    }
    double(*a)[4] = sums.a, *b = sums.b;
    p->chi2 = sums.count > 4 && sums.masked == 0 ? sums.chi2 / (sums.count - 4) : HUGE_VAL;
    p->unlike = p->saturated > 0.0 ? sums.clipped / (sums.clipped + sums.count + 1e-9) : 0.0;
    if (!(a[0][0] > 0.0))
        return;
    const double prior = 1.0 / (p->sky_error * p->sky_error);
    p->snr = p->flux * sqrt(a[0][0]);
    a[3][3] += prior;
    b[3] += prior * (p->sky_guess - p->sky);
    const int places = with_positions && p->snr > 8.0;
    if (!places) { /* flux and sky */
        a[1][0] = a[3][0];
        a[1][1] = a[3][3];
        b[1] = b[3];
    }
    const int unknowns = places ? 4 : 2;
    if (!rx_cholesky(a[0], unknowns, 4))
        return;
    rx_cholesky_solve(a[0], unknowns, 4, b);
    const double most = 0.3;
    p->sky += b[places ? 3 : 1];
    if (places && p->flux > 0.0) {
        p->x += fmax(fmin(p->damping * b[1] / p->flux, most), -most);
        p->y += fmax(fmin(p->damping * b[2] / p->flux, most), -most);
    }
    p->flux += p->damping * b[0];
    if (!(p->flux > 0.0))
        p->flux = 0.0;
}

rx_status rx_psf_job_step(rx_psf_job *job, int with_positions, rx_error *err)
{
#pragma omp parallel for schedule(dynamic, 16) num_threads(job->nthreads)
    for (int i = 0; i < job->n; i++)
        step(job, &job->points[i], with_positions, rx_psf_job_room(job));
    return rx_psf_job_subtract(job, err);
}

/* ---- the model ---- */

/* Normal equations of the stars [n] for all terms. `by`: what the stars' stamps are made from: MATRIX, the model
 * `planes` ([nterms][side][side]) through weights; RIGHT, data minus the model; ROWS, sums of the rows of the matrix
 * (cubic B-splines sum to 1). */
enum { MATRIX, RIGHT, ROWS };

typedef struct system_of {
    const rx_psf_job *job;
    const rx_psf_model *model;
    const int *stars;
    int n, nblocks, nterms; /* nterms: of the first ones, which are solved for */
    float *blocks;          /* [nblocks][nterms][side][side] */
    float *room;            /* of the threads */
    size_t room_size;
} system_of;

RX_SIMD static void add_scaled(const float *src, float factor, size_t n, float *dst)
{
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        dst[i] += factor * src[i];
}

static void add_star(const system_of *s, const rx_psf_point *p, const float *planes, int what, float *to,
                     float *room)
{
    const rx_psf_model *model = s->model;
    const size_t n = nodes_of(model), pixels = stamp_size(model);
    double terms[RX_PSF_TERMS];
    float *stamp = room + n, *spread = stamp + pixels, *work = spread + n;
    const double dx = p->x - lround(p->x), dy = p->y - lround(p->y);
    const float flux = (float)p->flux;
    rx_psf_model_terms(model, p->x, p->y, terms);
    if (what != ROWS) {
        const int all = what == RIGHT ? model->nterms : s->nterms;
        rx_psf_model_mix(model, planes, terms, all, room);
        rx_psf_model_stamp(model, room, dx, dy, model->half, &(rx_psf_stamp){stamp, NULL, NULL, work});
    }
    for (size_t i = 0; i < pixels; i++) {
        const float w = p->weight[i] * flux;
        stamp[i] = what == MATRIX  ? w * flux * stamp[i]
                   : what == RIGHT ? w * (p->data[i] - flux * stamp[i])
                                   : w * flux;
    }
    memset(spread, 0, n * sizeof *spread);
    rx_psf_model_spread(model, stamp, dx, dy, spread, work);
    for (int k = 0; k < s->nterms; k++)
        add_scaled(spread, (float)(what == ROWS ? terms[k] * terms[k] : terms[k]), n, to + (size_t)k * n);
}

/* dst [nterms][side][side]: fixed blocks of stars, summed in their order. */
static void add_stars(const system_of *s, const float *planes, int what, double *dst)
{
    const size_t all = nodes_of(s->model) * (size_t)s->nterms;
    memset(s->blocks, 0, (size_t)s->nblocks * all * sizeof(float));
#pragma omp parallel for schedule(dynamic, 1) num_threads(s->job->nthreads)
    for (int b = 0; b < s->nblocks; b++)
        for (int i = b * STARS_A_BLOCK; i < s->n && i < (b + 1) * STARS_A_BLOCK; i++)
            add_star(s, &s->job->points[s->stars[i]], planes, what, s->blocks + (size_t)b * all,
                     s->room + (size_t)omp_get_thread_num() * s->room_size);
#pragma omp parallel for schedule(static) num_threads(s->job->nthreads)
    for (size_t i = 0; i < all; i++) {
        double sum = 0.0;
        for (int b = 0; b < s->nblocks; b++)
            sum += (double)s->blocks[(size_t)b * all + i];
        dst[i] = sum;
    }
}

/* What the stars' fluxes and positions could take up is taken out of the departures of a term [side][side]: its sum, and
 * its component along the shifts of the profile. */
static void remove_shift(const rx_psf_job *job, const rx_psf_model *model, double *plane)
{
    const int side = model->side;
    double along[2] = {0}, norm[2] = {0}, sum = 0.0, whole = 0.0;
    for (int j = 1; j < side - 1; j++)
        for (int i = 1; i < side - 1; i++) {
            const size_t k = (size_t)j * (size_t)side + (size_t)i;
            const float *p = job->prior + k;
            const double g[2] = {(double)(p[1] - p[-1]), (double)(p[side] - p[-side])};
            for (int d = 0; d < 2; d++) {
                along[d] += g[d] * plane[k];
                norm[d] += g[d] * g[d];
            }
            sum += plane[k];
            whole += (double)p[0];
        }
    for (int j = 1; j < side - 1; j++)
        for (int i = 1; i < side - 1; i++) {
            const size_t k = (size_t)j * (size_t)side + (size_t)i;
            const float *p = job->prior + k;
            plane[k] -= along[0] / norm[0] * (double)(p[1] - p[-1]) +
                        along[1] / norm[1] * (double)(p[side] - p[-side]) + sum / whole * (double)p[0];
        }
}

static rx_status open_system(const rx_psf_job *job, const rx_psf_model *model, const int *stars, int n,
                             system_of *s, rx_error *err)
{
    const size_t all = nodes_of(model) * (size_t)job->variation.nterms;
    *s = (system_of){.job = job, .model = model, .stars = stars, .n = n, .nterms = job->variation.nterms};
    s->nblocks = (n + STARS_A_BLOCK - 1) / STARS_A_BLOCK;
    s->room_size = 2 * nodes_of(model) + stamp_size(model) + rx_psf_model_work(model);
    s->blocks = RX_NEW(float, (size_t)s->nblocks *all);
    s->room = RX_NEW(float, (size_t)job->nthreads * s->room_size);
    return s->blocks != NULL && s->room != NULL
               ? RX_OK
               : rx_error_memory(err, (size_t)s->nblocks * all * sizeof(float));
}

static double dot(const double *a, const double *b, size_t n)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

enum { ITERATIONS = 14, MODES = 3, BLUR = 64 };
static const double MODE = 0.3; /* relative size, ellipticity */

/* From what is solved for to coefficients: for each term MODES numbers, then nodes. */
typedef struct basis {
    int side, nterms, blur; /* blur: taps of the Gaussian on either side */
    size_t plane, length;   /* of a term: nodes; unknowns */
    double *modes;          /* [MODES][side][side] */
    double *taper;          /* [side][side] 1 in the core, 0 at its edge */
    double *tau[2];         /* of the constant term, of the others */
    double weights[BLUR + 1];
    double *line; /* work [side][side] */
} basis;

static void free_basis(basis *b)
{
    free(b->modes);
    *b = (basis){.side = 0};
}

static rx_status open_basis(const rx_psf_job *job, const rx_psf_model *model, int pixels, basis *b,
                            rx_error *err)
{
    static const double constant[RX_PSF_FREEDOMS] = {0.0, 0.25, 1.0, 1.0},
                        others[RX_PSF_FREEDOMS] = {0.0, 0.0, 0.0, 0.3};
    const int side = model->side, middle = model->middle;
    const size_t n = nodes_of(model);
    *b = (basis){.side = side, .nterms = job->variation.nterms, .plane = n, .length = n + MODES};
    b->modes = RX_NEW(double, (MODES + 4) * n);
    if (b->modes == NULL)
        return rx_error_memory(err, (MODES + 4) * n * sizeof(double));
    b->taper = b->modes + MODES * n;
    b->tau[0] = b->taper + n;
    b->tau[1] = b->tau[0] + n;
    b->line = b->tau[1] + n;
    double peak = 0.0, squares = 0.0;
    for (size_t k = 0; k < n; k++)
        peak = fmax(peak, job->values[k]);
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++) {
            const size_t k = (size_t)j * (size_t)side + (size_t)i;
            const int x = i - middle, y = j - middle;
            const double r = hypot(x, y) / model->m / model->half, t = fmin(fmax((1.0 - r) / 0.2, 0.0), 1.0);
            const double taper = t * t * (3.0 - 2.0 * t), own = (double)job->prior[k];
            b->taper[k] = taper;
            b->tau[0][k] = constant[pixels] * taper * (0.2 * fmax(own, 0.0) + 0.0005 * peak);
            b->tau[1][k] = others[pixels] * taper * (0.2 * fmax(own, 0.0) + 0.0005 * peak);
            if (i == 0 || j == 0 || i == side - 1 || j == side - 1)
                continue;
            const double px = 0.5 * (double)(job->prior[k + 1] - job->prior[k - 1]),
                         py = 0.5 * (double)(job->prior[k + (size_t)side] - job->prior[k - (size_t)side]);
            b->modes[k] = -MODE * taper * (x * px + y * py + 2.0 * own);
            b->modes[n + k] = -MODE * taper * 0.5 * (x * px - y * py);
            b->modes[2 * n + k] = -MODE * taper * 0.5 * (x * py + y * px);
        }
    const double sigma = 0.5 * job->fwhm * model->m / 2.3548;
    b->blur = (int)fmin(ceil(3.0 * sigma), BLUR);
    for (int i = 0; i <= b->blur; i++) {
        b->weights[i] = exp(-0.5 * i * i / (sigma * sigma));
        squares += (i > 0 ? 2.0 : 1.0) * b->weights[i] * b->weights[i];
    }
    for (int i = 0; i <= b->blur; i++)
        b->weights[i] /= sqrt(squares);
    return RX_OK;
}

/* plane = G plane; G is its own adjoint. */
static void blur(const basis *b, double *plane)
{
    const int n = b->side;
    for (int axis = 0; axis < 2; axis++) {
        const int along = axis == 0 ? 1 : n;
        memset(b->line, 0, b->plane * sizeof(double));
        for (int t = -b->blur; t <= b->blur; t++) {
            const double w = b->weights[abs(t)];
            for (int j = 0; j < n; j++) {
                const int i0 = axis == 0 && t < 0 ? -t : 0, i1 = axis == 0 && t > 0 ? n - t : n;
                if (axis == 1 && (j + t < 0 || j + t >= n))
                    continue;
                double *to = b->line + (size_t)j * (size_t)n;
                const double *from = plane + (ptrdiff_t)j * n + (ptrdiff_t)t * along;
#pragma omp simd
                for (int i = i0; i < i1; i++)
                    to[i] += w * from[i];
            }
        }
        memcpy(plane, b->line, b->plane * sizeof(double));
    }
}

/* planes [nterms][side][side] of the unknowns. */
static void to_planes(const basis *b, const double *unknowns, double *planes)
{
    for (int k = 0; k < b->nterms; k++) {
        const double *u = unknowns + (size_t)k * b->length, *tau = b->tau[k > 0];
        double *plane = planes + (size_t)k * b->plane;
        memcpy(plane, u + MODES, b->plane * sizeof(double));
        blur(b, plane);
        for (size_t i = 0; i < b->plane; i++)
            plane[i] *= tau[i];
        for (int q = 0; q < MODES; q++)
            for (size_t i = 0; i < b->plane; i++)
                plane[i] += u[q] * b->modes[(size_t)q * b->plane + i];
    }
}

/* The adjoint; planes are lost. */
static void to_unknowns(const basis *b, double *planes, double *unknowns)
{
    for (int k = 0; k < b->nterms; k++) {
        double *u = unknowns + (size_t)k * b->length, *plane = planes + (size_t)k * b->plane;
        const double *tau = b->tau[k > 0];
        for (int q = 0; q < MODES; q++)
            u[q] = dot(plane, b->modes + (size_t)q * b->plane, b->plane);
        for (size_t i = 0; i < b->plane; i++)
            plane[i] *= tau[i];
        blur(b, plane);
        memcpy(u + MODES, plane, b->plane * sizeof(double));
    }
}

/* 1 + how much the stars know of each unknown, roughly. */
static void condition(const basis *b, const double *rows, double *dst)
{
    for (int k = 0; k < b->nterms; k++) {
        const double *row = rows + (size_t)k * b->plane, *tau = b->tau[k > 0];
        double *d = dst + (size_t)k * b->length;
        for (int q = 0; q < MODES; q++) {
            const double *mode = b->modes + (size_t)q * b->plane;
            d[q] = 1.0;
            for (size_t i = 0; i < b->plane; i++)
                d[q] += row[i] * mode[i] * mode[i];
        }
        for (size_t i = 0; i < b->plane; i++)
            d[MODES + i] = 1.0 + tau[i] * tau[i] * row[i];
    }
}

/* The model becomes the profile as the stars' variation stretches it, projected on the polynomials of twice its degree (up to
 * RX_PSF_DEGREE): at the places of Gauss and Legendre's rule for such polynomials. Towards the core's edge the stretch ends. */
static rx_status stretch(const rx_psf_job *job, const double *taper, rx_psf_model *model, rx_error *err)
{
    enum { MOST = 9 };
    double at[MOST], weight[MOST];
    const rx_psf_variation *v = &job->variation;
    const int side = model->side, middle = model->middle;
    const size_t n = nodes_of(model);
    model->degree = 2 * v->degree < RX_PSF_DEGREE ? 2 * v->degree : RX_PSF_DEGREE;
    model->nterms = (model->degree + 1) * (model->degree + 2) / 2;
    const int rule = 2 * v->degree + 1 < MOST ? 2 * v->degree + 1 : MOST;
    RX_TRY(rx_gauss_legendre(rule, at, weight, err));
    double *planes = RX_NEW(double, (size_t)(model->nterms + 1) * n),
           *own = planes + (size_t)model->nterms * n;
    if (planes == NULL)
        return rx_error_memory(err, (size_t)(model->nterms + 1) * n * sizeof(double));
    int px[RX_PSF_TERMS], py[RX_PSF_TERMS];
    rx_psf_model_powers(model->degree, px, py);
    for (int place = 0; place < rule * rule; place++) {
        const int column = place % rule, row = place / rule;
        double terms[RX_PSF_TERMS], a[RX_PSF_STRETCH] = {0};
        rx_psf_model_terms(model, model->x0 + at[column] * model->xs, model->y0 + at[row] * model->ys, terms);
        for (int q = 0; q < RX_PSF_STRETCH; q++) {
            for (int k = 0; k < v->nterms; k++)
                a[q] += terms[k] * v->c[q][k];
            a[q] = fmax(fmin(a[q], 0.6), -0.6);
        }
#pragma omp parallel for schedule(static) num_threads(job->nthreads)
        for (int j = 0; j < side; j++)
            for (int i = 0; i < side; i++) {
                const size_t k = (size_t)j * (size_t)side + (size_t)i;
                const double own_a[RX_PSF_STRETCH] = {taper[k] * a[0], taper[k] * a[1], taper[k] * a[2]};
                own[k] = rx_psf_stretched(job->prior, side, i - middle, j - middle, own_a, NULL);
            }
        for (int t = 0; t < model->nterms; t++) {
            const double factor =
                0.25 * (2 * px[t] + 1) * (2 * py[t] + 1) * weight[column] * weight[row] * terms[t];
#pragma omp simd
            for (size_t k = 0; k < n; k++)
                planes[(size_t)t * n + k] += factor * own[k];
        }
    }
    for (int t = 0; t < model->nterms; t++) {
        double *plane = planes + (size_t)t * n;
        rx_psf_model_interpolate(model, plane);
        for (size_t k = 0; k < n && t == 0; k++)
            plane[k] -= (double)job->prior[k];
        remove_shift(job, model, plane);
        for (size_t k = 0; k < n; k++)
            model->c[(size_t)t * n + k] = (float)(plane[k] + (t == 0 ? (double)job->prior[k] : 0.0));
    }
    free(planes);
    return RX_OK;
}

/* y [terms solved for][length]: what the stars want added to the model. planes, coefficients: [..][side][side] work. */
static rx_status descend(const system_of *s, const basis *b, double *y, double *planes, float *coefficients,
                         rx_error *err)
{
    const size_t all = b->plane * (size_t)s->nterms, m = b->length * (size_t)s->nterms;
    double *v = RX_NEW(double, 5 * m), *r = v, *z = v + m, *p = v + 2 * m, *ap = v + 3 * m, *d = v + 4 * m;
    if (v == NULL)
        return rx_error_memory(err, 5 * m * sizeof(double));
    memset(y, 0, m * sizeof *y);
    add_stars(s, NULL, ROWS, planes);
    condition(b, planes, d);
    add_stars(s, s->model->c, RIGHT, planes);
    to_unknowns(b, planes, r);
    for (size_t i = 0; i < m; i++)
        p[i] = z[i] = r[i] / d[i];
    double rho = dot(r, z, m);
    const double enough = 1e-5 * rho;
    for (int it = 0; it < ITERATIONS && rho > enough; it++) {
        to_planes(b, p, planes);
        for (size_t i = 0; i < all; i++)
            coefficients[i] = (float)planes[i];
        add_stars(s, coefficients, MATRIX, planes);
        to_unknowns(b, planes, ap);
        for (size_t i = 0; i < m; i++)
            ap[i] += p[i];
        const double alpha = rho / dot(p, ap, m), before = rho;
        for (size_t i = 0; i < m; i++) {
            y[i] += alpha * p[i];
            r[i] -= alpha * ap[i];
            z[i] = r[i] / d[i];
        }
        rho = dot(r, z, m);
        for (size_t i = 0; i < m; i++)
            p[i] = z[i] + rho / before * p[i];
    }
    free(v);
    return RX_OK;
}

rx_status rx_psf_job_solve(const rx_psf_job *job, const int *stars, int n, int pixels, rx_psf_model *model,
                           rx_error *err)
{
    const size_t plane = nodes_of(model), all = plane * (size_t)job->variation.nterms;
    model->degree = 0;
    model->nterms = 1;
    memset(model->c, 0, RX_PSF_TERMS * plane * sizeof(float));
    memcpy(model->c, job->prior, plane * sizeof(float));
    if (n == 0)
        return RX_OK;
    system_of s = {.n = 0};
    basis b = {.side = 0};
    float *coefficients = RX_NEW(float, all);
    double *planes = RX_NEW(double, all), *y = NULL;
    rx_status status =
        coefficients == NULL || planes == NULL ? rx_error_memory(err, all * sizeof(double)) : RX_OK;
    if (status == RX_OK)
        status = open_basis(job, model, pixels, &b, err);
    if (status == RX_OK)
        status = stretch(job, b.taper, model, err);
    if (status == RX_OK)
        status = open_system(job, model, stars, n, &s, err);
    if (status == RX_OK && (y = RX_NEW(double, b.length *(size_t)s.nterms)) == NULL)
        status = rx_error_memory(err, all * sizeof(double));
    if (status == RX_OK)
        status = descend(&s, &b, y, planes, coefficients, err);
    if (status == RX_OK) {
        to_planes(&b, y, planes);
        for (int k = 0; k < s.nterms; k++)
            remove_shift(job, model, planes + (size_t)k * plane);
        for (size_t i = 0; i < all; i++)
            model->c[i] += (float)planes[i];
    }
    free(s.blocks);
    free(s.room);
    free_basis(&b);
    free(coefficients);
    free(planes);
    free(y);
    return status;
}

/* ---- how well it does ---- */

/* E of a star: the most likely one, of residuals within the FWHM that are Gaussian with variance V + (E light)^2. */
static double error_of(const rx_psf_job *job, const rx_psf_point *p, float *room)
{
    enum { STEPS = 15 };
    const double low = 5e-4; /* E^2 doubles from step to step */
    const rx_psf_model *model = &job->model;
    const int half = model->half, side = 2 * half + 1, reach = (int)fmin(half, ceil(job->fwhm));
    float *value = room + nodes_of(model);
    double score[STEPS] = {0};
    int e = 0;
    rx_psf_model_stamp(model, nodes_at(model, p->x, p->y, room), p->x - lround(p->x), p->y - lround(p->y),
                       half, &(rx_psf_stamp){value, NULL, NULL, value + 3 * stamp_size(model)});
    for (int j = -reach; j <= reach; j++)
        for (int i = -reach; i <= reach; i++) {
            const size_t k = (size_t)(j + half) * (size_t)side + (size_t)(i + half);
            const double light = p->flux * (double)value[k], off = (double)p->data[k] - light,
                         old = job->model_error * light, squared = light * light;
            if (!(p->weight[k] > 0.0F) || i * i + j * j > reach * reach)
                continue;
            const double noise = fmax(1.0 / (double)p->weight[k] - old * old, 0.0);
            for (e = 0; e < STEPS; e++) {
                const double v = noise + ldexp(low * low, e) * squared;
                score[e] += squared * (off * off - v) / (v * v);
            }
        }
    for (e = 0; e < STEPS - 1 && score[e] > 0.0;)
        e++;
    return sqrt(ldexp(low * low, e));
}

static int by_flux(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return (x[0] < y[0]) - (x[0] > y[0]);
}

rx_status rx_psf_job_measure_error(rx_psf_job *job, rx_error *err)
{
    enum { LEAST = 12 };
    double(*stars)[2] = rx_alloc((size_t)job->n + 1, sizeof *stars), errors[LEAST + 600];
    int n = 0, m = 0;
    if (stars == NULL)
        return rx_error_memory(err, (size_t)job->n * sizeof *stars);
    for (int i = 0; i < job->n; i++)
        if (job->points[i].kept) {
            stars[n][0] = job->points[i].flux;
            stars[n++][1] = i;
        }
    qsort(stars, (size_t)n, sizeof *stars, by_flux);
    while (m < n && (m < LEAST || m < n / 8) && m < (int)(sizeof errors / sizeof *errors))
        m++;
#pragma omp parallel for schedule(dynamic, 1) num_threads(job->nthreads)
    for (int k = 0; k < m; k++)
        errors[k] = error_of(job, &job->points[(int)stars[k][1]], rx_psf_job_room(job));
    if (m > 0)
        job->model_error = rx_median(errors, (size_t)m);
    free(stars);
    return RX_OK;
}

static double chi2_of(const rx_psf_model *model, const rx_psf_point *p, float *room)
{
    const size_t pixels = stamp_size(model);
    float *value = room + nodes_of(model), *gx = value + pixels, *gy = gx + pixels;
    double a[4][4] = {{0}}, b[4] = {0}, chi2 = 0.0, along = 0.0;
    rx_psf_model_stamp(model, nodes_at(model, p->x, p->y, room), p->x - lround(p->x), p->y - lround(p->y),
                       model->half, &(rx_psf_stamp){value, gx, gy, gy + pixels});
    for (size_t k = 0; k < pixels; k++) {
        const double w = (double)p->weight[k], off = (double)p->data[k] - p->flux * (double)value[k];
        const double g[3] = {(double)value[k], (double)gx[k], (double)gy[k]};
        for (int u = 0; u < 3; u++) {
            b[u] += w * off * g[u];
            for (int v = 0; v <= u; v++)
                a[u][v] += w * g[u] * g[v];
        }
        chi2 += w * off * off;
    }
    const double right[3] = {b[0], b[1], b[2]};
    if (rx_cholesky(a[0], 3, 4)) {
        rx_cholesky_solve(a[0], 3, 4, b);
        for (int u = 0; u < 3; u++)
            along += b[u] * right[u];
    }
    return chi2 - along;
}

rx_status rx_psf_job_chi2(const rx_psf_job *job, const rx_psf_model *model, const int *stars, int n,
                          double *chi2, rx_error *err)
{
    (void)err;
#pragma omp parallel for schedule(dynamic, 8) num_threads(job->nthreads)
    for (int i = 0; i < n; i++)
        chi2[i] = chi2_of(model, &job->points[stars[i]], rx_psf_job_room(job));
    return RX_OK;
}
