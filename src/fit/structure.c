/* Structure of the sky: what is around a place says what is there. */
#include "fit/structure.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "num/stats.h"

static const double CELL = 10.0;           /* widths */
static const double STEP = 1.0 / 3.0;      /* widths: z beside a point has fallen to 0.7 there */
static const double NEAR = 1.2, FAR = 2.5; /* widths: what a point covers has fallen from 90 to 1 at NEAR */
static const double SIGMA_BELOW = 0.15865525393145707; /* share of a Gaussian below -1 */
static const double LEAST =
    8.0; /* independent places of a cell that says anything: four for each of its two numbers */
static const double SEEN =
    0.5; /* share of a template's power, or of the ring around, on pixels that are used */
static const double CUT = 3.0; /* sigmas */

/* What values up to a place add up to. */
typedef struct running {
    double z;
    int n;
} running;

typedef struct work {
    const rx_structure_view *view;
    int nx, ny;          /* places */
    double light, power; /* sum T, sum T^2 */
    float *z, *p;        /* [ny][nx] z NAN: not known; p 0 */
    running *sums;       /* [ny][nx + 1] of z */
    double *unit;        /* [ny][nx] level that z 1 would come of, ADU */
    rx_sky_mesh a;
    rx_structure *found;
} work;

/* Over n pixels of a row: sum w t d, sum w t t, sum w t, and sum t t where w is above 0. */
RX_SIMD static void add_row(const float *t, const float *w, const float *d, int n, double sums[4])
{
    float product = 0.0f, power = 0.0f, light = 0.0f, seen = 0.0f;
#pragma omp simd reduction(+ : product, power, light, seen)
    for (int i = 0; i < n; i++) {
        const float weighted = w[i] * t[i];
        product += weighted * d[i];
        power += weighted * t[i];
        light += weighted;
        seen += w[i] > 0.0f ? t[i] * t[i] : 0.0f;
    }
    sums[0] += (double)product;
    sums[1] += (double)power;
    sums[2] += (double)light;
    sums[3] += (double)seen;
}

/* z with T in the middle of pixel (x, y), and the level that is worth a z of 1. */
static void look_at(const work *w, int x, int y, float *z, double *unit)
{
    const rx_structure_view *v = w->view;
    const int side = 2 * v->half + 1, left = rx_max_int(v->half - x, 0),
              right = rx_min_int(side, v->width - x + v->half), low = rx_max_int(v->half - y, 0),
              high = rx_min_int(side, v->height - y + v->half);
    double sums[4] = {0.0, 0.0, 0.0, 0.0};
    for (int j = low; j < high; j++) {
        const size_t at = (size_t)(y + j - v->half) * (size_t)v->width + (size_t)(x + left - v->half);
        add_row(v->values + j * side + left, v->weight + at, v->rest + at, right - left, sums);
    }
    const int known = sums[1] > 0.0 && sums[3] >= SEEN * w->power;
    *z = known ? (float)(sums[0] / sqrt(sums[1]) / v->noise) : NAN;
    *unit = known ? sqrt(sums[1]) / sums[2] * v->noise : 0.0;
}

/* Places of a cell, first to last. */
typedef struct span {
    int x0, x1, y0, y1;
} span;

static span places_of(const work *w, int cell)
{
    const int nx = w->a.nx, ny = w->a.ny, cx = cell % nx, cy = cell / nx;
    return (span){cx * w->nx / nx, (cx + 1) * w->nx / nx, cy * w->ny / ny, (cy + 1) * w->ny / ny};
}

/* z - a p of a cell's places where both are known, or z; how many. */
static size_t gather(const work *w, const span *s, const float *p, double a, double *dst)
{
    size_t n = 0;
    for (int y = s->y0; y < s->y1; y++)
        for (int x = s->x0; x < s->x1; x++) {
            const size_t k = (size_t)y * (size_t)w->nx + (size_t)x;
            const double value = p != NULL ? (double)w->z[k] - a * (double)p[k] : (double)w->z[k];
            if (isfinite(value))
                dst[n++] = value;
        }
    return n;
}

/* The median and the square of the distance to the quantile of one sigma below, at least 1. */
static double width_below(double *values, size_t n, double *middle)
{
    *middle = rx_median(values, n);
    const double below = rx_quantile(values, n, SIGMA_BELOW);
    return fmax((*middle - below) * (*middle - below), 1.0);
}

static double independent(const work *w, size_t n)
{
    const double place = (double)w->view->width / w->nx * w->view->height / w->ny;
    return (double)n * place * w->power / (w->light * w->light);
}

/* The share of structure of every cell, for now in the place of its variance; z is cut. */
static void find_share(const work *w, int cell, double *room)
{
    const span s = places_of(w, cell);
    const size_t count = gather(w, &s, NULL, 0.0, room);
    const double n = independent(w, count);
    if (!(n >= LEAST))
        return;
    double middle;
    const double width = width_below(room, count, &middle), most = CUT * sqrt(width);
    const double gain = 0.5 * n * (width - 1.0 + middle * middle - log(width)) - log(n);
    w->found->variance.value[cell] = 1.0 / (1.0 + exp(-fmin(fmax(gain, -80.0), 80.0)));
    for (int y = s.y0; y < s.y1; y++)
        for (int x = s.x0; x < s.x1; x++) {
            float *z = &w->z[(size_t)y * (size_t)w->nx + (size_t)x];
            if (isfinite(*z))
                *z = (float)fmin(fmax((double)*z, middle - most), middle + most);
        }
}

/* Of row y: what the known z before each column add up to, and how many they are. */
static void add_up(const work *w, int y)
{
    const float *z = w->z + (size_t)y * (size_t)w->nx;
    running *sums = w->sums + (size_t)y * ((size_t)w->nx + 1);
    for (int x = 0; x < w->nx; x++) {
        const int known = isfinite(z[x]) != 0;
        sums[x + 1] = (running){sums[x].z + (known ? (double)z[x] : 0.0), sums[x].n + known};
    }
}

/* Of the places x0 to x1 of a row. */
static void add_span(const work *w, const running *sums, int x0, int x1, running *to)
{
    const int first = rx_max_int(x0, 0), end = rx_min_int(x1 + 1, w->nx);
    if (end <= first)
        return;
    to->z += sums[end].z - sums[first].z;
    to->n += sums[end].n - sums[first].n;
}

/* The ring around a place: in the row at a distance of j from it, the columns from near[j] to far[j] away on both sides. */
enum { REACH = 16 }; /* STEP and FAR make it 8, more where a width is not much more than a pixel */

typedef struct ring {
    int reach, near[REACH + 1], far[REACH + 1], places;
} ring;

static ring make_ring(const work *w)
{
    const double width = w->light / sqrt(w->power) * w->nx / w->view->width, far = FAR * width,
                 near = NEAR * width;
    ring r = {.reach = rx_min_int((int)far, REACH)};
    for (int j = 0; j <= r.reach; j++) {
        r.far[j] = (int)sqrt(far * far - j * j);
        r.near[j] = j < near ? (int)ceil(sqrt(near * near - j * j)) : 0;
        r.places += (j > 0 ? 2 : 1) * (2 * (r.far[j] - r.near[j] + 1) - (r.near[j] == 0));
    }
    return r;
}

/* The mean of z on the ring around each place of row y. */
static void look_around(const work *w, const ring *r, int y)
{
    for (int x = 0; x < w->nx; x++) {
        running sum = {0.0, 0};
        for (int j = rx_max_int(-r->reach, -y); j <= r->reach && y + j < w->ny; j++) {
            const running *sums = w->sums + (size_t)(y + j) * ((size_t)w->nx + 1);
            const int far = r->far[abs(j)], near = r->near[abs(j)];
            add_span(w, sums, x - far, near > 0 ? x - near : x + far, &sum);
            if (near > 0)
                add_span(w, sums, x + near, x + far, &sum);
        }
        w->p[(size_t)y * (size_t)w->nx + (size_t)x] =
            sum.n > 0 && sum.n >= SEEN * r->places ? (float)(sum.z / sum.n) : 0.0f;
    }
}

/* share a and share S^2. */
static void find_rest(const work *w, int cell, double *room)
{
    const span s = places_of(w, cell);
    const double share = w->found->variance.value[cell];
    double product = 0.0, square = 0.0, middle;
    for (int y = s.y0; y < s.y1; y++)
        for (int x = s.x0; x < s.x1; x++) {
            const size_t k = (size_t)y * (size_t)w->nx + (size_t)x;
            if (!isfinite(w->z[k]))
                continue;
            product += (double)w->z[k] * (double)w->p[k];
            square += (double)w->p[k] * (double)w->p[k];
        }
    const double a = square > 0.0 ? fmin(fmax(product / square, 0.0), 1.0) : 0.0;
    const size_t count = gather(w, &s, w->p, a, room);
    if (!(independent(w, count) >= LEAST))
        return;
    w->a.value[cell] = share * a;
    w->found->variance.value[cell] = share * (width_below(room, count, &middle) - 1.0);
}

/* Every place has its z, and in `unit` the level that is worth a z of 1. */
static void look_everywhere(const work *w)
{
    const rx_structure_view *v = w->view;
#pragma omp parallel for schedule(dynamic) num_threads(v->nthreads)
    for (int j = 0; j < w->ny; j++)
        for (int i = 0; i < w->nx; i++) {
            const size_t k = (size_t)j * (size_t)w->nx + (size_t)i;
            look_at(w, (int)((i + 0.5) * v->width / w->nx), (int)((j + 0.5) * v->height / w->ny), &w->z[k],
                    &w->unit[k]);
        }
}

static void predict(const work *w)
{
    const rx_structure_view *v = w->view;
#pragma omp parallel for schedule(static) num_threads(v->nthreads)
    for (int j = 0; j < w->ny; j++)
        for (int i = 0; i < w->nx; i++) {
            const size_t k = (size_t)j * (size_t)w->nx + (size_t)i;
            w->unit[k] *= (double)w->p[k] * rx_sky_mesh_at(&w->a, (int)((i + 0.5) * v->width / w->nx),
                                                           (int)((j + 0.5) * v->height / w->ny));
        }
}

rx_status rx_structure_point(const rx_psf *psf, rx_structure_view *view, float **values, rx_error *err)
{
    const int side = psf->size, wanted = (int)ceil(RX_PSF_RADIUS * psf->fwhm);
    view->half = rx_min_int(wanted, side / 2);
    RX_TRY(RX_MAKE(*values, (size_t)side * (size_t)side, err));
    rx_psf_at(psf, 0.5 * view->width, 0.5 * view->height, *values);
    const int kept = 2 * view->half + 1, off = side / 2 - view->half;
    for (int y = 0; y < kept; y++)
        memmove(*values + y * kept, *values + (y + off) * side + off, (size_t)kept * sizeof **values);
    view->values = *values;
    return RX_OK;
}

rx_status rx_structure_measure(const rx_structure_view *view, rx_structure *dst, rx_error *err)
{
    const int side = 2 * view->half + 1;
    work w = {.view = view, .found = dst};
    double *values = NULL;
    rx_status status = RX_OK;
    *dst = (rx_structure){0};
    for (int i = 0; i < side * side; i++) {
        w.light += (double)view->values[i];
        w.power += (double)view->values[i] * (double)view->values[i];
    }
    const double width = w.light / sqrt(w.power);
    const int step = rx_max_int((int)lround(STEP * width), 1),
              cell = rx_max_int((int)lround(CELL * width), 1);
    RX_TRY_EXIT(rx_sky_mesh_open(view->width, view->height, step, &dst->level, err));
    RX_TRY_EXIT(rx_sky_mesh_open(view->width, view->height, cell, &dst->variance, err));
    RX_TRY_EXIT(rx_sky_mesh_open(view->width, view->height, cell, &w.a, err));
    w.nx = dst->level.nx;
    w.ny = dst->level.ny;
    w.unit = dst->level.value;
    const size_t places = (size_t)w.nx * (size_t)w.ny,
                 room = ((size_t)(w.nx / w.a.nx) + 2) * ((size_t)(w.ny / w.a.ny) + 2);
    RX_TRY_EXIT(RX_MAKE(w.z, places, err));
    RX_TRY_EXIT(RX_MAKE(w.p, places, err));
    RX_TRY_EXIT(RX_MAKE(w.sums, places + (size_t)w.ny, err));
    RX_TRY_EXIT(RX_MAKE(values, room * (size_t)view->nthreads, err));
    const ring around = make_ring(&w);
    look_everywhere(&w);
#pragma omp parallel for schedule(dynamic) num_threads(view->nthreads)
    for (int i = 0; i < w.a.nx * w.a.ny; i++)
        find_share(&w, i, values + room * (size_t)omp_get_thread_num());
#pragma omp parallel for schedule(dynamic) num_threads(view->nthreads)
    for (int y = 0; y < w.ny; y++)
        add_up(&w, y);
#pragma omp parallel for schedule(dynamic) num_threads(view->nthreads)
    for (int y = 0; y < w.ny; y++)
        look_around(&w, &around, y);
#pragma omp parallel for schedule(dynamic) num_threads(view->nthreads)
    for (int i = 0; i < w.a.nx * w.a.ny; i++)
        find_rest(&w, i, values + room * (size_t)omp_get_thread_num());
    predict(&w);
exit:
    rx_sky_mesh_clear(&w.a);
    free(w.z);
    free(w.p);
    free(w.sums);
    free(values);
    if (status != RX_OK)
        rx_structure_clear(dst);
    return status;
}

void rx_structure_clear(rx_structure *structure)
{
    rx_sky_mesh_clear(&structure->level);
    rx_sky_mesh_clear(&structure->variance);
}
