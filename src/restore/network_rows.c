/* A block of the tile between transforms. */
#include "restore/network_rows.h"

#include <stddef.h>
#include <string.h>

#include "base/simd.h"
#include "nn/rl_step.h"

/* What the ends of a transform are given. */
typedef struct ends {
    const rx_rows *rows;
    const float *src, *x, *f;
    const uint8_t *mask;
    float pedestal;
    const rx_rows_kernel *kernel;
    long good, seen; /* pixels of the domain: not masked, on the tile */
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

/* One choice in a loop, and none whose other side is the neutral element of what follows: else a compiler
 * makes branches of them, not vectors. */
enum { TOGETHER = 64 };

/* r of n pixels. */
RX_SIMD static void ratios(int n, const float *restrict x, const float *restrict m,
                           const uint8_t *restrict mask, float pedestal, float *restrict r)
{
    for (int first = 0; first < n; first += TOGETHER) {
        const int count = n - first < TOGETHER ? n - first : TOGETHER;
        float ratio[TOGETHER];
#pragma omp simd
        for (int i = 0; i < count; i++)
            ratio[i] = rx_rl_ratio(x[first + i], m[first + i], 1, pedestal);
#pragma omp simd
        for (int i = 0; i < count; i++)
            r[first + i] = mask[first + i] != 0 ? 0 : ratio[i];
    }
}

static long good_pixels(int n, const uint8_t *mask)
{
    long good = 0;
    for (int i = 0; i < n; i++)
        good += mask[i] == 0;
    return good;
}

/* r into a, and how many pixels are good. */
static void write_ratio(void *user, int y, float *line)
{
    ends *e = user;
    int from = 0, to = 0;
    if (!on_tile(e->rows, y, &from, &to))
        return;
    float *r = in_domain(e->rows, e->rows->a, y, 0);
    const float *x = e->x + in_tile(e->rows, y, from);
    const uint8_t *mask = e->mask + in_tile(e->rows, y, from);
    clear_beyond(e->rows, from, to, r);
    ratios(to - from, x, line + from, mask, e->pedestal, r + from);
    e->good += good_pixels(to - from, mask);
    e->seen += to - from;
}

/* rx_rl_update() of n pixels, at most TOGETHER. */
RX_SIMD static void update_some(int n, const float *restrict f, const float *restrict c,
                                const float *restrict q, float *restrict next)
{
    float gain[TOGETHER];
#pragma omp simd
    for (int i = 0; i < n; i++)
        gain[i] = c[i] / (q[i] >= RX_RL_SHARE ? q[i] : RX_RL_SHARE);
#pragma omp simd
    for (int i = 0; i < n; i++)
        gain[i] = c[i] < RX_RL_MOST * q[i] ? gain[i] : RX_RL_MOST;
#pragma omp simd
    for (int i = 0; i < n; i++)
        gain[i] = q[i] >= RX_RL_SHARE ? gain[i] : 1;
#pragma omp simd
    for (int i = 0; i < n; i++)
        gain[i] = f[i] > 0 ? gain[i] : 1;
#pragma omp simd
    for (int i = 0; i < n; i++)
        next[i] = f[i] * gain[i];
}

/* q: NULL for ones, as the stamp sums to 1 and so does K'^T W far from masks and borders. */
static void update(int n, const float *f, const float *c, const float *q, float *next)
{
    float ones[TOGETHER];
    for (int i = 0; i < TOGETHER; i++)
        ones[i] = 1;
    for (int i = 0; i < n; i += TOGETHER)
        update_some(n - i < TOGETHER ? n - i : TOGETHER, f + i, c + i, q != NULL ? q + i : ones, next + i);
}

static int within(int i, int least, int most)
{
    return i < least ? least : i > most ? most : i;
}

/* K'^T W of n pixels of the tile's row y from x on where nothing is masked: the part of the stamp that lies
 * on the tile. Returns 0 where that is all of it. */
static int share_on_tile(const ends *e, int y, int x, int n, float *q)
{
    const rx_rows *r = e->rows;
    const int radius = e->kernel->radius, size = 2 * radius + 1;
    const int top = within(radius - y, 0, size), bottom = within(r->height - y + radius, 0, size);
    const double *first = e->kernel->inside + (size_t)top * (size_t)(size + 1),
                 *last = e->kernel->inside + (size_t)bottom * (size_t)(size + 1);
    const int whole = bottom - top == size;
    if (whole && x >= radius && x + n + radius <= r->width)
        return 0;
    const float middle = whole ? 1 : (float)(last[size] - first[size]);
    for (int i = 0; i < n; i++)
        q[i] = middle;
    for (int i = 0; i < n; i++) {
        const int left = within(radius - (x + i), 0, size),
                  right = within(r->width - (x + i) + radius, 0, size);
        if (right - left < size)
            q[i] = (float)(last[right] - first[right] - (last[left] - first[left]));
        else /* on to where the border on the right comes near */
            i = within(r->width - radius - x - 1, i, n);
    }
    return 1;
}

static void write_update(void *user, int y, float *line)
{
    const ends *e = user;
    const rx_rows *r = e->rows;
    const int from = r->left - r->x0, n = r->right - r->left;
    const size_t k = in_tile(r, y, from);
    float *q = in_domain(r, r->b, y, from);
    int weighted = e->good < e->seen; /* by rx_rows_step() */
    if (!weighted)
        weighted = share_on_tile(e, r->y0 + y, r->left, n, q);
    update(n, e->f + k, line + from, weighted ? q : NULL, e->dst + k);
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

void rx_rows_inside(const float *stamp, int radius, double *inside)
{
    const int size = 2 * radius + 1, stride = size + 1;
    for (int i = 0; i < stride; i++)
        inside[i] = 0;
    for (int j = 0; j < size; j++) {
        double row = 0;
        inside[(j + 1) * stride] = 0;
        for (int i = 0; i < size; i++) {
            row += stamp[j * size + i];
            inside[(j + 1) * stride + i + 1] = inside[j * stride + i + 1] + row;
        }
    }
}

void rx_rows_step(const rx_rows *rows, const rx_rows_kernel *kernel, const float *f, const float *x,
                  const uint8_t *mask, float pedestal, float *next)
{
    ends e = {
        .rows = rows, .x = x, .f = f, .mask = mask, .kernel = kernel, .pedestal = pedestal, .dst = next};
    const int h = rx_fft_height(rows->fft);
    rx_fft_filter_rows(rows->fft, read_light, kernel->spectrum, false, rows->half, 0, h, write_ratio, &e);
    if (e.good < e.seen)
        transform(&e, read_good, kernel->spectrum, true, write_domain);
    transform(&e, read_ratio, kernel->spectrum, true, write_update);
}
