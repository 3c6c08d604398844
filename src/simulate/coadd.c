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

/* --- the frames --- */

enum { DRAW_X, DRAW_Y, DRAW_IN_X, DRAW_IN_Y, DRAW_DEPTH, DRAW_EDGE_X, DRAW_EDGE_Y, DRAWS };

typedef struct pattern {
    uint64_t seed, stream;
    int frames;
} pattern;

static double draw(const pattern *p, int k, int what)
{
    return rx_random_uniform(p->seed, p->stream, (uint64_t)(k * DRAWS + what));
}

/* Frame k's place among all that drew, plus a part of it: one frame in each part of the pixel. */
static double dither(const pattern *p, int k, int what, int within)
{
    int rank = 0;
    for (int other = 0; other < p->frames; other++)
        rank += draw(p, other, what) < draw(p, k, what);
    return (rank + draw(p, k, within)) / p->frames;
}

/* Of a strip, negative ones on the other side, to what is left of an axis. */
static void cut(double strip, int *low, int *high)
{
    const int n = *high;
    if (strip > 0.0)
        *low = (int)(strip * n);
    else
        *high = n + (int)(strip * n);
}

/* A share of 0.1 to 0.5, on either side. */
static double strip(double uniform)
{
    double signed_part = 2.0 * uniform - 1.0;
    return copysign(0.1 + 0.4 * fabs(signed_part), signed_part);
}

void rx_coadd_frame_make(const rx_coadd_params *par, uint64_t seed, uint64_t stream, int width, int height,
                         int k, rx_coadd_frame *dst)
{
    const pattern p = {seed, stream ^ PATTERN_STREAM, par->frames};
    const double corner = PAD - 0.5 + 0.5 * par->scale; /* of the output's pixel (0, 0), before the dither */
    *dst = (rx_coadd_frame){.width = (int)ceil(width * par->scale) + 2 * PAD + 1,
                            .height = (int)ceil(height * par->scale) + 2 * PAD + 1,
                            .x0 = corner + dither(&p, k, DRAW_X, DRAW_IN_X),
                            .y0 = corner + dither(&p, k, DRAW_Y, DRAW_IN_Y),
                            .depth = 1.0};
    dst->right = dst->width;
    dst->top = dst->height;
    if (k == 0 || par->uneven == 0.0)
        return;
    dst->depth = exp2(par->uneven * (2.0 * draw(&p, k, DRAW_DEPTH) - 1.0));
    cut(par->uneven * strip(draw(&p, k, DRAW_EDGE_X)), &dst->left, &dst->right);
    cut(par->uneven * strip(draw(&p, k, DRAW_EDGE_Y)), &dst->bottom, &dst->top);
}

/* The scene in the frame's pixels; templates are shared. */
static rx_status frame_scene(const rx_scene *scene, double scale, const rx_coadd_frame *frame, rx_scene **dst,
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

/* Fluxes are calibrated, so that a longer exposure has more electrons per ADU. */
static rx_noise_params frame_noise(const rx_noise_params *noise, const rx_coadd_frame *frame, int k)
{
    rx_noise_params own = *noise;
    own.sigma /= sqrt(frame->depth);
    own.gain *= frame->depth;
    own.stream ^= FRAME_STREAM(k);
    return own;
}

/* Inverse variance of the sky in one pixel of the frame. */
static double frame_weight(const rx_noise_params *noise, const rx_coadd_frame *frame)
{
    double sigma = rx_noise_sigma(noise);
    return sigma > 0.0 ? 1.0 / (sigma * sigma) : frame->depth;
}

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

/* Sums over the frames for one output pixel. */
typedef struct sums {
    double light;    /* w a d */
    double weight;   /* w a */
    double variance; /* w a^2 = w^2 a^2 / w */
    uint8_t defects;
} sums;

typedef struct exposed {
    const rx_coadd_params *par;
    rx_coadd_frame frame;
    const float *pixels;
    const uint8_t *defects;
    double weight;
    taps *x, *y;
} exposed;

enum { LOST = RX_DEFECT_COLUMN | RX_DEFECT_COSMIC };

static void add_pixel(const exposed *e, const taps *tx, const taps *ty, sums *dst)
{
    const rx_coadd_frame *f = &e->frame;
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
            if (u < f->left || u >= f->right || v < f->bottom || v >= f->top || e->defects[at] & LOST) {
                lost = 1;
                continue;
            }
            own.light += a * (double)e->pixels[at];
            own.weight += a;
            own.variance += a * a;
            own.defects |= e->defects[at];
        }
    }
    if (own.weight == 0.0 || (lost && e->par->type == RX_COADD_LANCZOS))
        return;
    dst->light += e->weight * own.light;
    dst->weight += e->weight * own.weight;
    dst->variance += e->weight * own.variance;
    dst->defects |= own.defects;
}

static rx_status add_frame(exposed *e, int width, int height, int nthreads, sums *dst, rx_error *err)
{
    e->x = make_taps(e->par, e->frame.x0, width);
    e->y = make_taps(e->par, e->frame.y0, height);
    const int missing = e->x == NULL || e->y == NULL;
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < (missing ? 0 : height); y++)
        for (int x = 0; x < width; x++)
            add_pixel(e, &e->x[x], &e->y[y], &dst[(size_t)y * (size_t)width + (size_t)x]);
    free(e->x);
    free(e->y);
    return missing ? rx_error_memory(err, (size_t)(width + height) * sizeof(taps)) : RX_OK;
}

/* --- one frame from the scene to the sums --- */

/* What the frames see, and how. */
typedef struct sight {
    const rx_coadd_params *par;
    const rx_scene *scene;
    const rx_optics *optics;
    const rx_noise_params *noise;
    int nthreads;
} sight;

static rx_status expose(const sight *of, int k, sums *dst, rx_error *err)
{
    const rx_coadd_params *par = of->par;
    const rx_scene *scene = of->scene;
    const rx_noise_params *noise = of->noise;
    const int nthreads = of->nthreads;
    exposed e = {.par = par};
    rx_coadd_frame_make(par, noise->seed, noise->stream, scene->width, scene->height, k, &e.frame);
    const size_t n = (size_t)e.frame.width * (size_t)e.frame.height;
    const rx_noise_params own = frame_noise(noise, &e.frame, k);
    rx_optics shifted = *of->optics;
    const rx_optics *through = &shifted;
    rx_scene *seen = NULL;
    float *pixels = RX_NEW(float, n);
    uint8_t *defects = RX_NEW(uint8_t, n);
    shifted.x0 += e.frame.x0 - 0.5 * (par->scale - 1.0);
    shifted.y0 += e.frame.y0 - 0.5 * (par->scale - 1.0);
    rx_status status;
    RX_TRY_EXIT(pixels == NULL || defects == NULL ? rx_error_memory(err, n * sizeof(float)) : RX_OK);
    RX_TRY_EXIT(frame_scene(scene, par->scale, &e.frame, &seen, err));
    RX_TRY_EXIT(rx_render(seen, 1, &through, &pixels, nthreads, err));
    rx_noise_expose(&own, e.frame.width, e.frame.height, pixels, defects, nthreads);
    e.pixels = pixels;
    e.defects = defects;
    e.weight = frame_weight(&own, &e.frame);
    status = add_frame(&e, scene->width, scene->height, nthreads, dst, err);
exit:
    rx_scene_free(seen);
    free(pixels);
    free(defects);
    return status;
}

/* --- the coadd --- */

/* Light of a source is sum_k w_k f_k / sum_k w_k, and f_k has flux / gain_k of variance. */
static rx_noise_params noise_of_all(const rx_coadd_params *par, const rx_scene *scene,
                                    const rx_noise_params *noise)
{
    rx_noise_params all = *noise;
    double weights = 0.0, shares = 0.0;
    for (int k = 0; k < par->frames; k++) {
        rx_coadd_frame frame;
        rx_coadd_frame_make(par, noise->seed, noise->stream, scene->width, scene->height, k, &frame);
        const rx_noise_params own = frame_noise(noise, &frame, k);
        const double weight = frame_weight(&own, &frame);
        weights += weight;
        shares += weight * weight / frame.depth;
    }
    all.sky *= par->scale * par->scale;
    all.saturation *= par->scale * par->scale;
    all.gain *= weights * weights / shares;
    return all;
}

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
static void count_seen(const rx_coadd_frame *f, const taps *x, const taps *y, const sums *src, int width,
                       int height, double *seen)
{
    for (int row = 0; row < height; row++)
        for (int column = 0; column < width; column++, src++)
            for (int t = 0; t < TAPS * TAPS && src->weight > 0.0; t++) {
                const double a = x[column].weight[t % TAPS] * y[row].weight[t / TAPS];
                const int u = x[column].first + t % TAPS, v = y[row].first + t / TAPS;
                if (a != 0.0 && u >= f->left && u < f->right && v >= f->bottom && v < f->top)
                    seen[(size_t)v * (size_t)f->width + (size_t)u] += a / src->weight;
            }
}

/* The sum of all output pixels is one of independent input pixels: its variance is exact, but for borders. */
static rx_status measure_wide(const rx_coadd_params *par, const rx_scene *scene, const rx_noise_params *noise,
                              const sums *src, rx_coadd *dst, rx_error *err)
{
    const double area = par->scale * par->scale;
    const size_t n = (size_t)scene->width * (size_t)scene->height;
    double power = 0.0;
    for (int k = 0; k < par->frames; k++) {
        rx_coadd_frame f;
        rx_coadd_frame_make(par, noise->seed, noise->stream, scene->width, scene->height, k, &f);
        const rx_noise_params own = frame_noise(noise, &f, k);
        const size_t pixels = (size_t)f.width * (size_t)f.height;
        taps *x = make_taps(par, f.x0, scene->width), *y = make_taps(par, f.y0, scene->height);
        double *seen = RX_NEW(double, pixels), squares = 0.0;
        const int missing = x == NULL || y == NULL || seen == NULL;
        if (!missing)
            count_seen(&f, x, y, src, scene->width, scene->height, seen);
        for (size_t i = 0; i < pixels && !missing; i++)
            squares += seen[i] * seen[i];
        power += area * area * frame_weight(&own, &f) * squares;
        free(x);
        free(y);
        free(seen);
        if (missing)
            return rx_error_memory(err, pixels * sizeof *seen);
    }
    dst->wide = dst->sigma > 0.0 ? sqrt(power / (double)n) / dst->sigma : 1.0;
    if (rx_noise_sigma(noise) == 0.0)
        dst->sigma = 0.0;
    return RX_OK;
}

rx_status rx_coadd_make(const rx_coadd_params *par, const rx_scene *scene, const rx_optics *optics,
                        const rx_noise_params *noise, int nthreads, rx_coadd *dst, rx_error *err)
{
    const size_t n = (size_t)scene->width * (size_t)scene->height;
    rx_status status = RX_OK;
    sums *all;
    RX_TRY(RX_MAKE(all, n, err));
    const sight of = {par, scene, optics, noise, nthreads < 1 ? 1 : nthreads};
    for (int k = 0; k < par->frames && status == RX_OK; k++) {
        status = rx_interrupt_check(err);
        if (status == RX_OK)
            status = expose(&of, k, all, err);
    }
    if (status == RX_OK) {
        finish(par, all, n, dst);
        dst->noise = noise_of_all(par, scene, noise);
        status = measure_wide(par, scene, noise, all, dst, err);
    }
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
