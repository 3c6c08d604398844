/* Stars of a tile against a PSF model: subtracting all of them, fitting each, solving for the model.
 *
 *   pixel = sky + sum_i flux_i P(u - u_i) + noise
 *   weight = 1 / (sigma^2 + flux P / gain + (E flux P)^2)
 *
 * All sources take a step against the same residual (as a Jacobi iteration does), so neighbours are subtracted and the
 * order does not matter. The model is the profile, stretched as the stars' variation says, plus departures: Gaussians over the core times
 * Legendre polynomials of the place, whose coefficients are N(0, lambda^2). With flux, place and sky of each star marginalised the
 * stars are linear in them, so that posterior and evidence are closed; lambda and degree are those of the largest evidence.
 */
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

enum { POINTS_A_BLOCK = 256 };
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

/* ---- departures from the profile ---- */

/* A Gaussian of the core at (x, y) pixels off the middle, narrow = 1 / (2 sigma^2), of height tau times its coefficient. */
typedef struct blob {
    double x, y, narrow, reach2, tau;
} blob;

enum { MOST_BLOBS = 240, PIXEL_TERMS = 6, BLOCKS = 8, STAR = 4 };
/* Distances of blobs: in FWHM, and as a share of their distance from the middle: what differs from a profile is no finer than the
 * light that makes it. In the SDSS frame ln evidence is 4249 at 0.45 FWHM, 6375 at 0.3 and 6410 at 0.22. */
static const double FINEST = 0.3, COARSER = 0.3, WIDTH = 0.6;
/* 1 sigma of a departure with lambda 1: a share of the profile, and of its peak. */
static const double DEPARTS = 0.2, EVERYWHERE = 5e-4;

static double taper_at(const rx_psf_model *model, double r)
{
    const double t = fmin(fmax((1.0 - r / model->half) / 0.2, 0.0), 1.0);
    return t * t * (3.0 - 2.0 * t);
}

static int place_blobs(const rx_psf_job *job, blob *dst)
{
    const rx_psf_model *model = &job->model;
    int n = 0;
    double next = 0.0,
           peak = job->values[(size_t)model->middle * (size_t)model->side + (size_t)model->middle];
    for (double r = 0.0, apart; r < 0.95 * model->half; r += next) {
        apart = fmax(FINEST * job->fwhm, COARSER * r);
        const int m = r > 0.0 ? (int)ceil(2.0 * M_PI * r / apart) : 1;
        next = apart;
        for (int k = 0; k < m && n < MOST_BLOBS; k++) {
            const double angle = 2.0 * M_PI * (k + 0.5 * (n % 2)) / m, x = r * cos(angle), y = r * sin(angle),
                         sigma = WIDTH * apart;
            const int i = model->middle + (int)lround(x * model->m),
                      j = model->middle + (int)lround(y * model->m);
            const double own = fmax(job->values[(size_t)j * (size_t)model->side + (size_t)i], 0.0);
            dst[n++] = (blob){x, y, 0.5 / (sigma * sigma), 12.25 * sigma * sigma,
                              taper_at(model, r) * (DEPARTS * own + EVERYWHERE * peak)};
        }
    }
    return n;
}

static double blob_at(const blob *b, double x, double y)
{
    const double r2 = (x - b->x) * (x - b->x) + (y - b->y) * (y - b->y);
    return r2 < b->reach2 ? b->tau * exp(-b->narrow * r2) : 0.0;
}

/* Normal equations of departures, fluxes, places and skies of stars marginalised: a [K T][K T] (lower triangle), b [K T], K blobs
 * of T terms, all blobs of a term together. */
typedef struct departures {
    int nblobs, nterms;
    blob list[MOST_BLOBS];
    double *a, *b;
    double by_flux[MOST_BLOBS]; /* d ln flux of a point source that the profile is fitted to */
} departures;

/* One star's part of the equations, for one term: g [K][K], r [K]; c [K][STAR]: work. */
static void look_at_star(const rx_psf_model *model, const departures *d, const rx_psf_point *p, double *g,
                         double *r, double (*c)[STAR], float *room)
{
    const int half = model->half, side = 2 * half + 1, n = d->nblobs;
    const double dx = p->x - lround(p->x), dy = p->y - lround(p->y);
    const size_t pixels = stamp_size(model);
    float *value = room + nodes_of(model), *gx = value + pixels, *gy = gx + pixels;
    double nn[STAR][STAR] = {{0}}, nr[STAR] = {0}, fit[STAR];
    rx_psf_model_stamp(model, nodes_at(model, p->x, p->y, room), dx, dy, half,
                       &(rx_psf_stamp){value, gx, gy, gy + pixels});
    memset(g, 0, sizeof(double) * (size_t)n * (size_t)n);
    memset(r, 0, sizeof(double) * (size_t)n);
    memset(c, 0, sizeof *c * (size_t)n);
    for (int j = -half; j <= half; j++)
        for (int i = -half; i <= half; i++) {
            const size_t k = (size_t)(j + half) * (size_t)side + (size_t)(i + half);
            const double w = p->member * (double)p->weight[k],
                         off = (double)p->data[k] - p->flux * (double)value[k],
                         own[STAR] = {(double)value[k], p->flux * (double)gx[k], p->flux * (double)gy[k],
                                      1.0};
            double at[MOST_BLOBS];
            int which[MOST_BLOBS], m = 0;
            if (!(w > 0.0))
                continue;
            for (int q = 0; q < n; q++) {
                const double b = blob_at(&d->list[q], i - dx, j - dy);
                which[m] = q;
                at[m] = p->flux * b;
                m += b > 0.0;
            }
            for (int u = 0; u < STAR; u++) {
                nr[u] += w * off * own[u];
                for (int v = 0; v <= u; v++)
                    nn[u][v] += w * own[u] * own[v];
            }
            for (int u = 0; u < m; u++) {
                const double wu = w * at[u];
                r[which[u]] += wu * off;
                for (int v = 0; v < STAR; v++)
                    c[which[u]][v] += wu * own[v];
                for (int v = 0; v <= u; v++)
                    g[which[u] * n + which[v]] += wu * at[v];
            }
        }
    nn[3][3] += 1.0 / (p->sky_error * p->sky_error);
    if (!rx_cholesky(nn[0], STAR, STAR)) {
        memset(g, 0, sizeof(double) * (size_t)n * (size_t)n);
        memset(r, 0, sizeof(double) * (size_t)n);
        return;
    }
    for (int u = 0; u < n; u++) {
        memcpy(fit, c[u], sizeof fit);
        rx_cholesky_solve(nn[0], STAR, STAR, fit);
        for (int v = 0; v < STAR; v++)
            r[u] -= fit[v] * nr[v];
        for (int l = 0; l <= u; l++)
            g[u * n + l] -= fit[0] * c[l][0] + fit[1] * c[l][1] + fit[2] * c[l][2] + fit[3] * c[l][3];
    }
}

static rx_status open_departures(const rx_psf_job *job, const rx_psf_model *model, const int *stars, int n,
                                 departures *d, rx_error *err)
{
    d->nblobs = place_blobs(job, d->list);
    d->nterms = job->variation.nterms < PIXEL_TERMS ? job->variation.nterms : PIXEL_TERMS;
    const int k = d->nblobs, all = k * d->nterms;
    const size_t square = (size_t)all * (size_t)all, one = (size_t)all + square;
    const size_t work = (size_t)k * (size_t)k + (size_t)k * (1 + STAR);
    double *blocks = d->a = RX_NEW(double, BLOCKS *(one + work));
    if (blocks == NULL)
        return rx_error_memory(err, BLOCKS * one * sizeof(double));
    d->b = d->a + square;
#pragma omp parallel for schedule(dynamic, 1) num_threads(job->nthreads)
    for (int block = 0; block < BLOCKS; block++) { /* in an order that threads do not change */
        double *a = blocks + (size_t)block * one, *b = a + square,
               *g = blocks + BLOCKS * one + (size_t)block * work, *r = g + (size_t)k * (size_t)k,
               terms[RX_PSF_TERMS];
        for (int i = block; i < n; i += BLOCKS) {
            const rx_psf_point *p = &job->points[stars[i]];
            look_at_star(model, d, p, g, r, (double(*)[STAR])(r + k), rx_psf_job_room(job));
            rx_psf_model_terms(model, p->x, p->y, terms);
            for (int s = 0; s < d->nterms; s++)
                for (int t = 0; t <= s; t++)
                    for (int u = 0; u < k; u++) {
                        double *row = a + (size_t)(s * k + u) * (size_t)all + (size_t)(t * k);
                        const double factor = terms[s] * terms[t];
                        for (int v = 0; v <= u; v++)
                            row[v] += factor * g[u * k + v];
                        for (int v = u + 1; v < k && t < s; v++)
                            row[v] += factor * g[v * k + u];
                    }
            for (int s = 0; s < d->nterms; s++)
                for (int u = 0; u < k; u++)
                    b[s * k + u] += terms[s] * r[u];
        }
    }
    for (int block = 1; block < BLOCKS; block++)
        for (size_t i = 0; i < one; i++)
            blocks[i] += blocks[(size_t)block * one + i];
    double square_of = 0.0;
    const rx_psf_model *m = model;
    for (int j = -m->half; j <= m->half; j++)
        for (int i = -m->half; i <= m->half; i++) {
            const double own = job->values[(size_t)(m->middle + j * m->m) * (size_t)m->side +
                                           (size_t)(m->middle + i * m->m)];
            square_of += own * own;
        }
    for (int q = 0; q < k; q++) {
        double sum = 0.0, product = 0.0;
        for (int j = -m->half; j <= m->half; j++)
            for (int i = -m->half; i <= m->half; i++) {
                const double at = blob_at(&d->list[q], i, j);
                sum += at;
                product += at * job->values[(size_t)(m->middle + j * m->m) * (size_t)m->side +
                                            (size_t)(m->middle + i * m->m)];
            }
        d->by_flux[q] = product / square_of - sum;
    }
    return RX_OK;
}

/* Coefficients y [nterms K] are N(0, lambda^2), those that vary with the place N(0, (VARIES lambda)^2): their mean, the logarithm of the
 * evidence, the relative variance of fluxes. factor [nterms K]^2: work. */
static double try_departures(const departures *d, int nterms, double lambda, double *factor, double *y,
                             double *variance)
{
    static const double VARIES = 0.3;
    const int n = d->nblobs * nterms, all = d->nblobs * d->nterms;
    double evidence = 0.0, *h = y + n;
    for (int i = 0; i < n; i++) {
        const double own = i < d->nblobs ? lambda : VARIES * lambda;
        for (int j = 0; j <= i; j++)
            factor[(size_t)i * (size_t)n + (size_t)j] = own * (j < d->nblobs ? lambda : VARIES * lambda) *
                                                        d->a[(size_t)i * (size_t)all + (size_t)j];
        factor[(size_t)i * (size_t)n + (size_t)i] += 1.0;
        y[i] = own * d->b[i];
        h[i] = i < d->nblobs ? d->by_flux[i] * lambda : 0.0;
    }
    if (!rx_cholesky(factor, n, n))
        return -HUGE_VAL;
    rx_cholesky_solve(factor, n, n, y);
    rx_cholesky_solve(factor, n, n, h);
    *variance = 0.0;
    for (int i = 0; i < n; i++) {
        const double own = i < d->nblobs ? lambda : VARIES * lambda;
        evidence += 0.5 * y[i] * own * d->b[i] - log(factor[(size_t)i * (size_t)n + (size_t)i]);
        *variance += i < d->nblobs ? h[i] * d->by_flux[i] * lambda : 0.0;
        y[i] *= own;
    }
    return evidence;
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

/* The model becomes the profile as the stars' variation stretches it, projected on the polynomials of twice its degree and two more (up to
 * RX_PSF_DEGREE): at the places of Gauss and Legendre's rule for such polynomials. Towards the core's edge the stretch ends. */
static rx_status stretch(const rx_psf_job *job, const double *taper, rx_psf_model *model, rx_error *err)
{
    enum { MOST = 9 };
    double at[MOST], weight[MOST];
    const rx_psf_variation *v = &job->variation;
    const int side = model->side, middle = model->middle;
    const size_t n = nodes_of(model);
    const int twice = v->degree > 0 ? 2 * v->degree + 2 : 0;
    model->degree = twice < RX_PSF_DEGREE ? twice : RX_PSF_DEGREE;
    model->nterms = (model->degree + 1) * (model->degree + 2) / 2;
    const int rule = twice + 1 < MOST ? twice + 1 : MOST;
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

rx_status rx_psf_job_solve(rx_psf_job *job, const int *stars, int n, rx_log *log, rx_error *err)
{
    static const double lambdas[] = {0.03, 0.1, 0.3, 1.0, 3.0};
    rx_psf_model *model = &job->model;
    const size_t plane = nodes_of(model);
    departures d = {.nblobs = 0};
    double *taper = RX_NEW(double, 2 * plane), *own = taper + plane, *y = NULL, most = 0.0, variance = 0.0,
           mean = 0.0, chances = 1.0;
    int degree = -1, nterms = 0;
    rx_status status = RX_OK;
    model->degree = 0;
    model->nterms = 1;
    memset(model->c, 0, RX_PSF_TERMS * plane * sizeof(float));
    memcpy(model->c, job->prior, plane * sizeof(float));
    job->core_error = 0.0;
    if (taper == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 2 * plane * sizeof(double)));
    for (int k = 0; k < (int)plane; k++)
        taper[k] = taper_at(model, hypot(k % model->side - model->middle, k / model->side - model->middle) /
                                       model->m);
    if (n == 0)
        goto exit;
    RX_TRY_EXIT(stretch(job, taper, model, err));
    RX_TRY_EXIT(open_departures(job, model, stars, n, &d, err));
    const size_t all = (size_t)(d.nblobs * d.nterms);
    y = RX_NEW(double, 4 * all + all * all);
    if (y == NULL)
        RX_TRY_EXIT(rx_error_memory(err, all * all * sizeof(double)));
    for (int tried = 0; (tried + 1) * (tried + 2) / 2 <= d.nterms && tried <= degree + 1; tried++)
        for (size_t k = 0; k < sizeof lambdas / sizeof *lambdas; k++) {
            const int terms = (tried + 1) * (tried + 2) / 2;
            const double evidence = try_departures(&d, terms, lambdas[k], y + 4 * all, y, &variance) - tried;
            rx_log_detail(
                log, "PSF_TYPE AUTO: departures of degree %d, lambda %g: ln evidence %+.1f, fluxes +- %.5f",
                tried, lambdas[k], evidence, sqrt(fmax(variance, 0.0)));
            if (evidence > most) {
                mean *= exp(most - evidence);
                chances *= exp(most - evidence);
                most = evidence;
                degree = tried;
                nterms = terms;
                memcpy(y + 2 * all, y, (size_t)(d.nblobs * terms) * sizeof *y);
            }
            mean += exp(evidence - most) * variance;
            chances += exp(evidence - most);
        }
    job->core_error = sqrt(fmax(mean / chances, 0.0));
    for (int t = 0; t < nterms; t++) {
        const double *c = y + 2 * all + (size_t)t * (size_t)d.nblobs;
        for (int k = 0; k < (int)plane; k++) {
            const double x = (k % model->side - model->middle) / (double)model->m,
                         v = (k / model->side - model->middle) / (double)model->m;
            own[k] = 0.0;
            for (int q = 0; q < d.nblobs; q++)
                own[k] += c[q] * blob_at(&d.list[q], x, v);
            own[k] *= taper[k];
        }
        rx_psf_model_interpolate(model, own);
        remove_shift(job, model, own);
        for (size_t k = 0; k < plane; k++)
            model->c[(size_t)t * plane + k] += (float)own[k];
    }
exit:
    free(taper);
    free(d.a);
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
