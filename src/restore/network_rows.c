/* A block of the tile between transforms. */
#include "restore/network_rows.h"

#include <stddef.h>
#include <string.h>

#include "nn/rl_step.h"

/* What the ends of a transform are given. */
typedef struct ends {
    const rx_rows *rows;
    const float *src, *x, *f;
    const uint8_t *mask;
    float pedestal;
    long good; /* pixels */
    int weighted;
    float *dst;
} ends;

/* Columns of the domain that lie on the tile: from <= i < to; 0: row y does not. */
static int on_tile(const rx_rows *r, int y, int *from, int *to)
{
    const int w = rx_fft_width(r->fft);
    *from = r->x0 < 0 ? -r->x0 : 0;
    *to = r->x0 + w > r->width ? r->width - r->x0 : w;
    return r->y0 + y >= 0 && r->y0 + y < r->height && *from < *to;
}

/* Where pixel i of the domain's row y lies in a plane of the tile, and in one of the domain. */
static size_t in_tile(const rx_rows *r, int y, int i)
{
    return (size_t)(r->y0 + y) * (size_t)r->width + (size_t)(r->x0 + i);
}

static float *in_domain(const rx_rows *r, float *plane, int y, int i)
{
    return plane + (size_t)y * (size_t)rx_fft_stride_real(r->fft) + (size_t)i;
}

static void clear_beyond(const rx_rows *r, int from, int to, float *line)
{
    memset(line, 0, (size_t)from * sizeof *line);
    memset(line + to, 0, (size_t)(rx_fft_width(r->fft) - to) * sizeof *line);
}

/* ---- into the transform ---- */

static int read_tile(void *user, int y, float *line)
{
    const ends *e = user;
    int from = 0, to = 0;
    if (!on_tile(e->rows, y, &from, &to))
        return 0;
    clear_beyond(e->rows, from, to, line);
    memcpy(line + from, e->src + in_tile(e->rows, y, from), (size_t)(to - from) * sizeof *line);
    return 1;
}

static int read_light(void *user, int y, float *line)
{
    const ends *e = user;
    int from = 0, to = 0;
    if (!on_tile(e->rows, y, &from, &to))
        return 0;
    clear_beyond(e->rows, from, to, line);
    const float *f = e->f + in_tile(e->rows, y, from);
#pragma omp simd
    for (int i = from; i < to; i++)
        line[i] = rx_rl_light(f[i - from]);
    return 1;
}

static int read_good(void *user, int y, float *line)
{
    const ends *e = user;
    int from = 0, to = 0;
    if (!on_tile(e->rows, y, &from, &to))
        return 0;
    clear_beyond(e->rows, from, to, line);
    const uint8_t *mask = e->mask + in_tile(e->rows, y, from);
#pragma omp simd
    for (int i = from; i < to; i++)
        line[i] = mask[i - from] == 0 ? 1 : 0;
    return 1;
}

static int read_ratio(void *user, int y, float *line)
{
    const ends *e = user;
    int from = 0, to = 0;
    if (!on_tile(e->rows, y, &from, &to))
        return 0;
    memcpy(line, in_domain(e->rows, e->rows->a, y, 0), (size_t)rx_fft_width(e->rows->fft) * sizeof *line);
    return 1;
}

/* ---- out of it ---- */

/* r into a, and how many pixels are good. */
static void write_ratio(void *user, int y, float *line)
{
    ends *e = user;
    int from = 0, to = 0, good = 0;
    if (!on_tile(e->rows, y, &from, &to))
        return;
    float *restrict r = in_domain(e->rows, e->rows->a, y, 0);
    const float *x = e->x + in_tile(e->rows, y, from), pedestal = e->pedestal;
    const uint8_t *mask = e->mask + in_tile(e->rows, y, from);
    clear_beyond(e->rows, from, to, r);
#pragma omp simd reduction(+ : good)
    for (int i = from; i < to; i++) {
        const float ratio = rx_rl_ratio(x[i - from], line[i], 1, pedestal);
        r[i] = mask[i - from] == 0 ? ratio : 0;
        good += mask[i - from] == 0;
    }
    e->good += good;
}

static void write_update(void *user, int y, float *line)
{
    const ends *e = user;
    const rx_rows *r = e->rows;
    const int from = r->left - r->x0, n = r->right - r->left;
    const size_t k = in_tile(r, y, from);
    const float *f = e->f + k, *c = line + from, *q = in_domain(r, r->b, y, from);
    float *restrict next = e->dst + k;
    if (!e->weighted) { /* the stamp sums to 1: without masks so does K'^T W */
#pragma omp simd
        for (int i = 0; i < n; i++)
            next[i] = rx_rl_update(f[i], c[i], 1);
        return;
    }
#pragma omp simd
    for (int i = 0; i < n; i++)
        next[i] = rx_rl_update(f[i], c[i], q[i]);
}

static void write_tile(void *user, int y, float *line)
{
    const ends *e = user;
    const int from = e->rows->left - e->rows->x0;
    memcpy(e->dst + in_tile(e->rows, y, from), line + from,
           (size_t)(e->rows->right - e->rows->left) * sizeof *line);
}

static void write_domain(void *user, int y, float *line)
{
    const ends *e = user;
    const int from = e->rows->left - e->rows->x0;
    memcpy(in_domain(e->rows, e->rows->b, y, from), line + from,
           (size_t)(e->rows->right - e->rows->left) * sizeof *line);
}

/* ---- tasks ---- */

static void transform(const ends *e, rx_fft_read read, const float *kernel, bool conjugate,
                      rx_fft_write write)
{
    const rx_rows *r = e->rows;
    rx_fft_filter_rows(r->fft, read, kernel, conjugate, r->half, r->top - r->y0, r->bottom - r->y0, write,
                       (void *)(size_t)e);
}

void rx_rows_filter(const rx_rows *rows, const float *kernel, const float *src, float *dst)
{
    const ends e = {.rows = rows, .src = src, .dst = dst};
    transform(&e, read_tile, kernel, false, write_tile);
}

void rx_rows_blur(const rx_rows *rows, const float *kernel, const float *src)
{
    const ends e = {.rows = rows, .src = src};
    transform(&e, read_tile, kernel, false, write_domain);
}

void rx_rows_step(const rx_rows *rows, const float *kernel, const float *f, const float *x,
                  const uint8_t *mask, float pedestal, float *next)
{
    ends e = {.rows = rows, .x = x, .f = f, .mask = mask, .pedestal = pedestal, .dst = next};
    const int w = rx_fft_width(rows->fft), h = rx_fft_height(rows->fft);
    rx_fft_filter_rows(rows->fft, read_light, kernel, false, rows->half, 0, h, write_ratio, &e);
    e.weighted = e.good < (long)w * h;
    if (e.weighted)
        transform(&e, read_good, kernel, true, write_domain);
    transform(&e, read_ratio, kernel, true, write_update);
}
