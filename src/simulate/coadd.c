/* Dithered frames of a scene, resampled and combined. */
#include "simulate/coadd.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/random.h"
#include "simulate/render.h"

/* The pattern of the frames has a stream of its own beside the noise's, and each frame's noise has one. */
#define PATTERN_STREAM (UINT64_C(0xE9) << 56)
#define FRAME_STREAM(k) ((uint64_t)((k) + 1) << 40)

enum {
    ORDER = 3, /* of Lanczos */
    TAPS = 2 * ORDER,
    PAD = ORDER + 1 /* pixels of a frame beyond the output */
};

/* --- resampling --- */

/* a_i along one axis for one output pixel: of the frame's pixels first, first + 1, ... */
typedef struct taps {
    int first;
    double weight[TAPS];
} taps;

/* Length in which a drop `pixfrac` wide covers an output pixel `scale` wide at that distance. */
static double overlap(double distance, double pixfrac, double scale)
{
    return fmax(0.0, fmin(fmin(pixfrac, scale), 0.5 * (pixfrac + scale) - fabs(distance)));
}

static double lanczos(double x)
{
    double t = M_PI * x;
    if (fabs(x) < 1e-9)
        return 1.0;
    return fabs(x) < ORDER ? ORDER * sin(t) * sin(t / ORDER) / (t * t) : 0.0;
}

static taps *make_taps(const rx_coadd_params *par, double start, int n)
{
    taps *t = RX_NEW(taps, (size_t)n);
    for (int x = 0; t != NULL && x < n; x++) {
        double u = start + par->scale * x, sum = 0.0;
        t[x].first = (int)floor(u) - (ORDER - 1);
        for (int i = 0; i < TAPS; i++) {
            double distance = t[x].first + i - u;
            t[x].weight[i] = par->type == RX_COADD_DRIZZLE ? overlap(distance, par->pixfrac, par->scale)
                                                           : lanczos(distance);
            sum += t[x].weight[i];
        }
        for (int i = 0; i < TAPS && par->type == RX_COADD_LANCZOS; i++)
            t[x].weight[i] /= sum;
    }
    return t;
}

/* What is put together. */
typedef struct making {
    const rx_coadd_params *par;
    const rx_scene *scene;
    const rx_optics *optics;
    const rx_noise_params *noise;
    int nthreads;
} making;

/* One frame. Position (x, y) of the output lies at (x0 + scale x, y0 + scale y) of its pixels. Of these only
 * left <= x < right, bottom <= y < top have seen the sky. */
typedef struct frame {
    int width, height;
    double x0, y0;
    double depth; /* exposure time: fluxes are calibrated, so that a longer one has more electrons per ADU */
    int left, right, bottom, top;
    rx_noise_params noise;
    double weight; /* inverse variance of the sky in one pixel */
    taps *x, *y;   /* of each output column, row */
} frame;

/* --- the frames --- */

enum { DRAW_X, DRAW_Y, DRAW_IN_X, DRAW_IN_Y, DRAW_DEPTH, DRAW_EDGE_X, DRAW_EDGE_Y, DRAWS };

static double draw(const making *m, int k, int what)
{
    return rx_random_uniform(m->noise->seed, m->noise->stream ^ PATTERN_STREAM, (uint64_t)(k * DRAWS + what));
}

/* Frame k's place among all that drew, plus a part of it: one frame in each part of the pixel. */
static double dither(const making *m, int k, int what, int within)
{
    int rank = 0;
    for (int other = 0; other < m->par->frames; other++)
        rank += draw(m, other, what) < draw(m, k, what);
    return (rank + draw(m, k, within)) / m->par->frames;
}

/* From one side of an axis a strip of 0.1 to 0.5 times `uneven` is cut off. */
static void cut(double uneven, double uniform, int *low, int *high)
{
    const double either = 2.0 * uniform - 1.0, strip = uneven * copysign(0.1 + 0.4 * fabs(either), either);
    const int n = *high;
    if (strip > 0.0)
        *low = (int)(strip * n);
    else
        *high = n + (int)(strip * n);
}

static void close_frame(frame *f)
{
    free(f->x);
    free(f->y);
}

/* close_frame() in any case. */
static rx_status open_frame(const making *m, int k, frame *f, rx_error *err)
{
    const rx_coadd_params *par = m->par;
    const int width = m->scene->width, height = m->scene->height;
    const double corner = PAD - 0.5 + 0.5 * par->scale; /* of the output's pixel (0, 0), before the dither */
    *f = (frame){.width = (int)ceil(width * par->scale) + 2 * PAD + 1,
                 .height = (int)ceil(height * par->scale) + 2 * PAD + 1,
                 .x0 = corner + dither(m, k, DRAW_X, DRAW_IN_X),
                 .y0 = corner + dither(m, k, DRAW_Y, DRAW_IN_Y),
                 .depth = 1.0,
                 .noise = *m->noise};
    f->right = f->width;
    f->top = f->height;
    if (k > 0 && par->uneven != 0.0) {
        f->depth = exp2(par->uneven * (2.0 * draw(m, k, DRAW_DEPTH) - 1.0));
        cut(par->uneven, draw(m, k, DRAW_EDGE_X), &f->left, &f->right);
        cut(par->uneven, draw(m, k, DRAW_EDGE_Y), &f->bottom, &f->top);
    }
    f->noise.sigma /= sqrt(f->depth);
    f->noise.gain *= f->depth;
    f->noise.stream ^= FRAME_STREAM(k);
    const double sigma = rx_noise_sigma(&f->noise);
    f->weight = sigma > 0.0 ? 1.0 / (sigma * sigma) : f->depth;
    f->x = make_taps(par, f->x0, width);
    f->y = make_taps(par, f->y0, height);
    return f->x == NULL || f->y == NULL ? rx_error_memory(err, (size_t)(width + height) * sizeof(taps))
                                        : RX_OK;
}

/* The scene in the frame's pixels; templates are shared. */
static rx_status frame_scene(const rx_scene *scene, double scale, const frame *frame, rx_scene **dst,
                             rx_error *err)
{
    RX_TRY(rx_scene_new(frame->width, frame->height, scene->n, dst, err));
    (*dst)->templates = scene->templates;
    for (long i = 0; i < scene->n; i++) {
        rx_object *o = &(*dst)->objects[i];
        *o = scene->objects[i];
        o->x = frame->x0 + scale * o->x;
        o->y = frame->y0 + scale * o->y;
        o->radius *= scale;
        o->bulge_radius *= scale;
        o->disk_radius *= scale;
        o->bar_radius *= scale;
        o->stretch *= scale;
    }
    return RX_OK;
}

/* --- one frame from the scene to the sums --- */

/* Sums over the frames for one output pixel. */
typedef struct sums {
    double light;    /* w a d */
    double weight;   /* w a */
    double variance; /* w a^2 = w^2 a^2 / w */
    uint8_t defects;
} sums;

enum { LOST = RX_DEFECT_COLUMN | RX_DEFECT_COSMIC };

static void add_pixel(const making *m, const frame *f, const float *pixels, const uint8_t *defects, int x,
                      int y, sums *dst)
{
    const taps *tx = &f->x[x], *ty = &f->y[y];
    sums own = {0};
    int lost = 0;
    for (int j = 0; j < TAPS; j++) {
        const int v = ty->first + j;
        for (int i = 0; i < TAPS; i++) {
            const int u = tx->first + i;
            const double a = tx->weight[i] * ty->weight[j];
            if (a == 0.0)
                continue;
            const size_t at = (size_t)v * (size_t)f->width + (size_t)u;
            if (u < f->left || u >= f->right || v < f->bottom || v >= f->top || defects[at] & LOST) {
                lost = 1;
                continue;
            }
            own.light += a * (double)pixels[at];
            own.weight += a;
            own.variance += a * a;
            own.defects |= defects[at];
        }
    }
    if (own.weight == 0.0 || (lost && m->par->type == RX_COADD_LANCZOS))
        return;
    dst->light += f->weight * own.light;
    dst->weight += f->weight * own.weight;
    dst->variance += f->weight * own.variance;
    dst->defects |= own.defects;
}

static rx_status expose(const making *m, int k, sums *dst, rx_error *err)
{
    const int width = m->scene->width, height = m->scene->height;
    rx_optics shifted = *m->optics;
    rx_scene *seen = NULL;
    float *pixels = NULL;
    uint8_t *defects = NULL;
    frame f;
    rx_status status;
    RX_TRY_EXIT(open_frame(m, k, &f, err));
    RX_TRY_EXIT(RX_MAKE(pixels, (size_t)f.width * (size_t)f.height, err));
    RX_TRY_EXIT(RX_MAKE(defects, (size_t)f.width * (size_t)f.height, err));
    shifted.x0 += f.x0 - 0.5 * (m->par->scale - 1.0);
    shifted.y0 += f.y0 - 0.5 * (m->par->scale - 1.0);
    RX_TRY_EXIT(frame_scene(m->scene, m->par->scale, &f, &seen, err));
    RX_TRY_EXIT(rx_render(seen, 1, &(const rx_optics *){&shifted}, &pixels, m->nthreads, err));
    rx_noise_expose(&f.noise, f.width, f.height, pixels, defects, m->nthreads);
#pragma omp parallel for schedule(static) num_threads(m->nthreads)
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            add_pixel(m, &f, pixels, defects, x, y, &dst[(size_t)y * (size_t)width + (size_t)x]);
exit:
    close_frame(&f);
    rx_scene_free(seen);
    free(pixels);
    free(defects);
    return status;
}

/* --- the coadd --- */

static void finish(const rx_coadd_params *par, const sums *src, size_t n, rx_coadd *dst)
{
    const double area = par->scale * par->scale, drop = par->pixfrac * par->pixfrac;
    double total = 0.0;
    long used = 0;
    for (size_t i = 0; i < n; i++) {
        const sums *s = &src[i];
        dst->defects[i] = s->defects;
        if (s->weight <= 0.0) {
            dst->image[i] = NAN;
            dst->weight[i] = 0.0f;
            dst->defects[i] = RX_DEFECT_COLUMN;
            continue;
        }
        const double variance = area * area * s->variance / (s->weight * s->weight);
        dst->image[i] = (float)(area * s->light / s->weight);
        dst->weight[i] =
            (float)(par->type == RX_COADD_DRIZZLE ? s->weight / (drop * area * area) : 1.0 / variance);
        total += variance;
        used++;
    }
    dst->sigma = used > 0 ? sqrt(total / (double)used) : 0.0;
}

/* seen [height][width] of the frame = what each of its pixels adds to the sum of all output pixels. */
static void count_seen(const frame *f, const sums *src, int width, int height, double *seen)
{
    for (int row = 0; row < height; row++)
        for (int column = 0; column < width; column++, src++)
            for (int t = 0; t < TAPS * TAPS && src->weight > 0.0; t++) {
                const double a = f->x[column].weight[t % TAPS] * f->y[row].weight[t / TAPS];
                const int u = f->x[column].first + t % TAPS, v = f->y[row].first + t / TAPS;
                if (a != 0.0 && u >= f->left && u < f->right && v >= f->bottom && v < f->top)
                    seen[(size_t)v * (size_t)f->width + (size_t)u] += a / src->weight;
            }
}

/* Noise of the whole. Light of a source is sum_k w_k f_k / sum_k w_k, and f_k has flux / gain_k of variance.
 * The sum of all output pixels is one of independent input pixels: its variance is exact, but for borders. */
static rx_status measure_noise(const making *m, const sums *src, rx_coadd *dst, rx_error *err)
{
    const double area = m->par->scale * m->par->scale;
    const size_t n = (size_t)m->scene->width * (size_t)m->scene->height;
    double weights = 0.0, shares = 0.0, power = 0.0;
    for (int k = 0; k < m->par->frames; k++) {
        frame f;
        double *seen = NULL, squares = 0.0;
        rx_status status = open_frame(m, k, &f, err);
        const size_t pixels = (size_t)f.width * (size_t)f.height;
        if (status == RX_OK)
            status = RX_MAKE(seen, pixels, err);
        if (status == RX_OK)
            count_seen(&f, src, m->scene->width, m->scene->height, seen);
        for (size_t i = 0; i < pixels && status == RX_OK; i++)
            squares += seen[i] * seen[i];
        power += area * area * f.weight * squares;
        weights += f.weight;
        shares += f.weight * f.weight / f.depth;
        close_frame(&f);
        free(seen);
        RX_TRY(status);
    }
    dst->noise = *m->noise;
    dst->noise.sky *= area;
    dst->noise.saturation *= area;
    dst->noise.gain *= weights * weights / shares;
    dst->wide = dst->sigma > 0.0 ? sqrt(power / (double)n) / dst->sigma : 1.0;
    if (rx_noise_sigma(m->noise) == 0.0)
        dst->sigma = 0.0;
    return RX_OK;
}

rx_status rx_coadd_make(const rx_coadd_params *par, const rx_scene *scene, const rx_optics *optics,
                        const rx_noise_params *noise, int nthreads, rx_coadd *dst, rx_error *err)
{
    const size_t n = (size_t)scene->width * (size_t)scene->height;
    const making m = {par, scene, optics, noise, nthreads < 1 ? 1 : nthreads};
    rx_status status;
    sums *all;
    RX_TRY(RX_MAKE(all, n, err));
    for (int k = 0; k < par->frames; k++) {
        RX_TRY_EXIT(rx_interrupt_check(err));
        RX_TRY_EXIT(expose(&m, k, all, err));
    }
    finish(par, all, n, dst);
    status = measure_noise(&m, all, dst, err);
exit:
    free(all);
    return status;
}

/* --- what it leaves of white noise --- */

/* Of a pixel `distance` away from the place, before their sum is made 1. */
static double tap(rx_resampler kind, double distance, double drop)
{
    const double d = fabs(distance);
    switch (kind) {
    case RX_RESAMPLER_LINEAR:
        return fmax(1.0 - d, 0.0);
    case RX_RESAMPLER_CUBIC:
        if (d >= 2.0)
            return 0.0;
        return d < 1.0 ? (1.5 * d - 2.5) * d * d + 1.0 : ((-0.5 * d + 2.5) * d - 4.0) * d + 2.0;
    case RX_RESAMPLER_LANCZOS:
        return lanczos(distance);
    default:
        return overlap(distance, drop, 1.0);
    }
}

/* lag[TAPS] of one direction: sums of products of weights. */
static void correlate_taps(rx_resampler kind, double size, double *lag)
{
    const int places = kind == RX_RESAMPLER_DRIZZLE ? 16 : 1;
    for (int d = 0; d < TAPS; d++)
        lag[d] = 0.0;
    for (int p = 0; p < places; p++) {
        const double shift = kind == RX_RESAMPLER_DRIZZLE ? (p + 0.5) / places : size;
        double weight[TAPS], sum = 0.0;
        for (int i = 0; i < TAPS; i++) {
            weight[i] = tap(kind, i - (ORDER - 1) - shift, size);
            sum += weight[i];
        }
        for (int d = 0; d < TAPS; d++)
            for (int i = 0; i + d < TAPS; i++)
                lag[d] += weight[i] * weight[i + d] / (sum * sum);
    }
}

rx_noise_correlation rx_resampled_noise(rx_resampler kind, const double size[2])
{
    rx_noise_correlation noise = rx_noise_white(RX_NOISE_GIVEN);
    double x[TAPS], y[TAPS];
    correlate_taps(kind, size[0], x);
    correlate_taps(kind, size[1], y);
    noise.correlated = 1;
    for (int dy = 1 - TAPS; dy < TAPS; dy++)
        for (int dx = 1 - TAPS; dx < TAPS; dx++)
            noise.at[dy + RX_NOISE_REACH][dx + RX_NOISE_REACH] = x[abs(dx)] * y[abs(dy)] / (x[0] * y[0]);
    return noise;
}

/* --- width --- */

enum { NODES = 4, MOST_POINTS = TAPS * NODES * NODES };

/* Places and weights of Gauss and Legendre's rule on [-1/2, 1/2]. */
static const double node_place[NODES] = {-0.4305681557970263, -0.1699905217924281, 0.1699905217924281,
                                         0.4305681557970263};
static const double node_weight[NODES] = {0.1739274225687269, 0.3260725774312731, 0.3260725774312731,
                                          0.1739274225687269};

/* What spreads light along one axis, as points. */
typedef struct spread {
    int n;
    double place[MOST_POINTS], weight[MOST_POINTS];
} spread;

/* Each point becomes `panels` boxes side by side, weighed by the kernel (NULL: evenly). */
static void convolve(spread *s, double box, int panels, double (*kernel)(double))
{
    const spread old = *s;
    s->n = 0;
    for (int i = 0; i < old.n; i++)
        for (int k = 0; k < panels * NODES; k++) {
            const double t = k / NODES - 0.5 * (panels - 1) + node_place[k % NODES];
            s->place[s->n] = old.place[i] + box * t;
            s->weight[s->n++] = old.weight[i] * node_weight[k % NODES] * (kernel != NULL ? kernel(t) : 1.0);
        }
}

/* A round Moffat of that half width, spread, at distance r from its centre. */
static double spread_at(const spread *s, double r, double hwhm, double beta)
{
    const double k = expm1(M_LN2 / beta) / (hwhm * hwhm);
    double sum = 0.0;
    for (int j = 0; j < s->n; j++)
        for (int i = 0; i < s->n; i++) {
            const double x = r + s->place[i], y = s->place[j];
            sum += s->weight[i] * s->weight[j] * pow(1.0 + k * (x * x + y * y), -beta);
        }
    return sum;
}

double rx_coadd_fwhm(const rx_coadd_params *par, double fwhm, double beta)
{
    spread s = {.n = 1, .weight = {1.0}};
    double low = 0.0, high = 2.0 * (fwhm + 1.0 / par->scale);
    convolve(&s, 1.0 / par->scale, 1, NULL);
    if (par->type == RX_COADD_DRIZZLE) {
        convolve(&s, par->pixfrac / par->scale, 1, NULL);
        convolve(&s, 1.0, 1, NULL);
    } else {
        convolve(&s, 1.0 / par->scale, TAPS, lanczos);
    }
    const double half = 0.5 * spread_at(&s, 0.0, 0.5 * fwhm, beta);
    for (int step = 0; step < 30; step++) {
        const double middle = 0.5 * (low + high);
        if (spread_at(&s, middle, 0.5 * fwhm, beta) > half)
            low = middle;
        else
            high = middle;
    }
    return low + high;
}
