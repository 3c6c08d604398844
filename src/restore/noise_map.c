/* Noise for detection on a restored image. */
#include "restore/noise_map.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/simd.h"
#include "data/map.h"
#include "num/convolve.h"

/* A block is done at a time, its sums stay in the cache; TOGETHER of a row grow in registers. */
enum { ROWS = 96, COLUMNS = 256, TOGETHER = 64, RADIUS_MOST = 8 };
enum { LINE = COLUMNS + 2 * RADIUS_MOST, LINES = ROWS + 2 * RADIUS_MOST };
static const double SMOOTH_FWHM = 1.5 * RX_FWHM_SIGMA; /* pixels */
static const float SHARE = 0.1f;                       /* of the brightness around, in sigmas */

/* Sums along x of a block's rows, of brightness and of weights. */
typedef struct sums {
    atomic_flag taken;
    float num[LINES][COLUMNS], den[LINES][COLUMNS];
    float all[COLUMNS]; /* sums of weights over a whole neighbourhood that nothing hides */
    int clean[LINES];   /* nothing is hidden in that row */
} sums;

typedef struct noise_maker {
    rx_map_maker maker;
    int width, height;
    const float *pixels;
    rx_map level, noise;
    const uint8_t *mask; /* NULL: nothing is hidden */
    float factor;
    int radius;
    float weights[2 * RADIUS_MOST + 1];
    int rooms;
    sums *room; /* [rooms], behind this: one for each thread, as it is too large for its stack */
} noise_maker;

/* sum[n] = weights[2 radius + 1] along the line, whose first value belongs to -radius. */
RX_SIMD static void along(const float *restrict line, const float *restrict weights, int radius, int n,
                          float *restrict sum)
{
    for (int x = 0; x < n; x += TOGETHER) {
        float s[TOGETHER] = {0};
        for (int i = 0; i <= 2 * radius; i++)
#pragma omp simd
            for (int k = 0; k < TOGETHER; k++)
                s[k] += weights[i] * line[x + i + k];
        memcpy(sum + x, s, sizeof s);
    }
}

/* sum[n] of the rows first .. last (from the one at `rows`, COLUMNS apart), each with its weight. */
RX_SIMD static void across(const float *rows, const float *restrict weights, int first, int last, int n,
                           float *restrict sum)
{
    for (int x = 0; x < n; x += TOGETHER) {
        float s[TOGETHER] = {0};
        for (int i = first; i <= last; i++)
#pragma omp simd
            for (int k = 0; k < TOGETHER; k++)
                s[k] += weights[i] * rows[(ptrdiff_t)i * COLUMNS + x + k];
        memcpy(sum + x, s, sizeof s);
    }
}

/* How bright n pixels are, in sigmas, and which of them are seen. Returns how many are hidden. */
RX_SIMD static int brightness(int n, const float *restrict pixels, const float *restrict level,
                              const float *restrict sigma, const uint8_t *restrict mask, float *restrict line,
                              float *restrict good)
{
    int hidden = 0;
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float above = (pixels[i] - level[i]) / sigma[i];
        line[i] = (sigma[i] > 0) & (above > 0) ? above : 0.0f;
        good[i] = 1;
    }
    for (int i = 0; mask != NULL && i < n; i++)
        if ((mask[i] & ~RX_MASK_UNTOUCHED) != 0) {
            line[i] = good[i] = 0;
            hidden++;
        }
    return hidden;
}

/* Row y of the tile, columns x0 - radius .. x0 + n + radius - 1 of it, into the sums' row j. */
static void sum_row(const noise_maker *j, int x0, int y, int n, int row, sums *s)
{
    float line[LINE + TOGETHER] = {0}, good[LINE + TOGETHER] = {0}, level[LINE], sigma[LINE];
    const int width = j->width, r = j->radius;
    const int from = x0 > r ? x0 - r : 0, to = x0 + n + r < width ? x0 + n + r : width, count = to - from;
    const size_t k = (size_t)y * (size_t)width + (size_t)from;
    const int at = from - (x0 - r);
    const int hidden = brightness(count, j->pixels + k, rx_map_row(&j->level, y, from, count, level),
                                  rx_map_row(&j->noise, y, from, count, sigma),
                                  j->mask != NULL ? j->mask + k : NULL, line + at, good + at);
    s->clean[row] = hidden == 0;
    along(line, j->weights, r, n, s->num[row]);
    if (row > 0 && s->clean[row] && s->clean[row - 1])
        memcpy(s->den[row], s->den[row - 1], sizeof s->den[row]);
    else
        along(good, j->weights, r, n, s->den[row]);
}

RX_SIMD static void make_noise(int n, const float *restrict num, const float *restrict den,
                               const uint8_t *restrict mask, const float *restrict sigma, float factor,
                               float *restrict map)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float around = num[i] / den[i]; /* a pixel that is seen counts itself: den > 0 */
        map[i] = sigma[i] * sqrtf(1.0f + SHARE * SHARE * around * around);
    }
    for (int i = 0; mask != NULL && i < n; i++)
        if ((mask[i] & ~RX_MASK_UNTOUCHED) != 0)
            map[i] = sigma[i];
#pragma omp simd
    for (int i = 0; i < n; i++)
        map[i] *= factor;
}

/* Pixels x .. x + n - 1 of the rows y .. end - 1, at most COLUMNS and ROWS. */
typedef struct piece {
    int x, y, n, end;
} piece;

/* Into map, rows `stride` apart. */
static void make_block(const noise_maker *j, sums *s, const piece *p, size_t stride, float *map)
{
    const int x0 = p->x, y0 = p->y, n = p->n, y1 = p->end;
    float num[COLUMNS], den[COLUMNS], room[COLUMNS];
    const int width = j->width, height = j->height, r = j->radius;
    const int top = y0 > r ? y0 - r : 0, end = y1 + r < height ? y1 + r : height;
    int known = 0; /* whether `all` is */
    for (int y = top; y < end; y++)
        sum_row(j, x0, y, n, y - top, s);
    for (int y = y0; y < y1; y++) {
        const int first = y < r ? -y : -r, last = y + r >= height ? height - 1 - y : r, row = y - top;
        const size_t k = (size_t)y * (size_t)width + (size_t)x0;
        int unclean = 0;
        for (int i = first; i <= last; i++)
            unclean += !s->clean[row + i];
        const int whole = unclean == 0 && last - first == 2 * r;
        across(s->num[row], j->weights + r, first, last, n, num);
        if (!whole || !known)
            across(s->den[row], j->weights + r, first, last, n, whole ? s->all : den);
        known |= whole;
        make_noise(n, num, whole ? s->all : den, j->mask != NULL ? j->mask + k : NULL,
                   rx_map_row(&j->noise, y, x0, n, room), j->factor, map + (size_t)(y - y0) * stride);
    }
}

/* One that no other thread works in. */
static sums *take_room(const noise_maker *j)
{
    for (int i = 0;; i = (i + 1) % j->rooms)
        if (!atomic_flag_test_and_set(&j->room[i].taken))
            return &j->room[i];
}

static void make(const rx_map_maker *maker, int x, int y, int n, int rows, float *dst)
{
    sums *s = take_room((const noise_maker *)maker);
    for (int top = 0; top < rows; top += ROWS)
        for (int left = 0; left < n; left += COLUMNS) {
            const piece p = {x + left, y + top, n - left < COLUMNS ? n - left : COLUMNS,
                             y + (rows - top < ROWS ? rows : top + ROWS)};
            make_block((const noise_maker *)maker, s, &p, (size_t)n, dst + (size_t)top * (size_t)n + left);
        }
    atomic_flag_clear(&s->taken);
}

rx_status rx_noise_map(const rx_image *image, const uint8_t *mask, float factor, int nthreads,
                       rx_map_maker **dst, rx_error *err)
{
    const int rooms = nthreads < 1 ? 1 : nthreads;
    const size_t bytes = sizeof(noise_maker) + (size_t)rooms * sizeof(sums);
    noise_maker *j = rx_alloc(1, bytes); /* zeros: no room is taken */
    *dst = NULL;
    if (j == NULL)
        return rx_error_memory(err, bytes);
    *j = (noise_maker){.maker.make = make,
                       .width = image->width,
                       .height = image->height,
                       .pixels = image->pixels,
                       .level = rx_image_sky(image),
                       .noise = image->noise,
                       .mask = mask,
                       .factor = factor,
                       .radius = rx_gauss_radius(SMOOTH_FWHM),
                       .rooms = rooms,
                       .room = (sums *)(void *)(j + 1)};
    rx_gauss_weights(SMOOTH_FWHM, j->radius, j->weights);
    *dst = &j->maker;
    return RX_OK;
}
