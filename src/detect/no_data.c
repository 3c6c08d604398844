/* Runs of one value, what touches them, and whether the sky beside them is one. */
#include "detect/no_data.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "num/stats.h"

enum { RUN = 32, HALF = RUN / 2, STRIP = 256, SAMPLE = 20000 };

static const double SKY = 0.35, FADES = 0.2, POINTS = 0.5;

typedef struct seek {
    const rx_image *image;
    const uint8_t *mask;
    float value;
    unsigned char *empty; /* [height][width] */
} seek;

static bool may_be(const seek *s, size_t k)
{
    return s->mask[k] == 0 && s->image->pixels[k] == s->value;
}

/* The pixels of runs along a line: the last one at k, `step` apart. */
static void mark_run(const seek *s, size_t k, int run, size_t step)
{
    for (int i = 0; i < (run == RUN ? RUN : 1); i++)
        s->empty[k - (size_t)i * step] = 1;
}

static void search_row(const seek *s, int y)
{
    const size_t width = (size_t)s->image->width;
    int run = 0;
    for (size_t k = (size_t)y * width; k < (size_t)(y + 1) * width; k++) {
        run = may_be(s, k) ? run + 1 : 0;
        if (run >= RUN)
            mark_run(s, k, run, 1);
    }
}

/* Columns x0 to x0 + STRIP - 1. */
static void search_columns(const seek *s, int x0)
{
    const int width = s->image->width, across = rx_min_int(STRIP, width - x0);
    int run[STRIP] = {0};
    for (int y = 0; y < s->image->height; y++)
        for (int i = 0; i < across; i++) {
            const size_t k = (size_t)y * (size_t)width + (size_t)(x0 + i);
            run[i] = may_be(s, k) ? run[i] + 1 : 0;
            if (run[i] >= RUN)
                mark_run(s, k, run[i], (size_t)width);
        }
}

static void search(const seek *s, int threads)
{
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int y = 0; y < s->image->height; y++)
        search_row(s, y);
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int x = 0; x < s->image->width; x += STRIP)
        search_columns(s, x);
}

/* Of every run two pixels stand HALF apart at multiples of it: without such a pair there is none. */
static bool may_have_runs(const seek *s, int threads)
{
    const int width = s->image->width, height = s->image->height;
    const float *pixels = s->image->pixels, value = s->value;
    int pairs = 0;
#pragma omp parallel for schedule(static) num_threads(threads) reduction(| : pairs)
    for (int y = 0; y < height; y++) {
        const float *row = pixels + (size_t)y * (size_t)width;
        for (int x = HALF; x < width; x += HALF)
            pairs |= (row[x - HALF] == value) & (row[x] == value);
        for (int x = 0; y % HALF == 0 && y < height - HALF && x < width; x++)
            pairs |= (row[x] == value) & (row[(size_t)HALF * (size_t)width + (size_t)x] == value);
    }
    return pairs != 0;
}

static float lowest_of(const rx_image *image, const uint8_t *mask, int threads)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    float lowest = INFINITY;
#pragma omp parallel for simd schedule(static) num_threads(threads) reduction(min : lowest)
    for (size_t k = 0; k < n; k++)
        lowest = mask[k] == 0 && image->pixels[k] < lowest ? image->pixels[k] : lowest;
    return lowest;
}

/* Has the sky itself such values? */
static bool is_of_the_sky(const seek *s)
{
    const size_t n = (size_t)s->image->width * (size_t)s->image->height;
    size_t alike = 0, rest = 0;
    for (size_t k = 0; k < n; k++)
        if (s->mask[k] == 0 && !s->empty[k]) {
            rest++;
            alike += may_be(s, k);
        }
    return (double)alike > SKY * (double)rest;
}

static bool is_beside(const seek *s, int x, int y)
{
    const int width = s->image->width, height = s->image->height;
    for (int v = rx_max_int(y - 1, 0); v <= rx_min_int(y + 1, height - 1); v++)
        for (int u = rx_max_int(x - 1, 0); u <= rx_min_int(x + 1, width - 1); u++)
            if (s->empty[(size_t)v * (size_t)width + (size_t)u])
                return true;
    return false;
}

static bool touches(const seek *s, int x, int y)
{
    const size_t k = (size_t)y * (size_t)s->image->width + (size_t)x;
    if (s->empty[k] || !may_be(s, k) || !is_beside(s, x, y))
        return false;
    s->empty[k] = 1;
    return true;
}

/* Whatever touches it and is alike, to and fro until nothing does. */
static void spread(const seek *s)
{
    const int width = s->image->width, height = s->image->height;
    for (bool more = true; more;) {
        more = false;
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++)
                more |= touches(s, x, y);
        for (int y = height - 1; y >= 0; y--)
            for (int x = width - 1; x >= 0; x--)
                more |= touches(s, x, y);
    }
}

/* Pixels that are used, beside what is empty or all: how many, and the median of their steps to the next one in the row, of an even
 * part of many of them. */
typedef struct part {
    size_t pixels;
    double step; /* NAN: of none */
} part;

static part measure_part(const seek *s, bool beside, double *room)
{
    const int width = s->image->width, height = s->image->height;
    size_t count = 0, every = 1;
    part dst = {0};
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const size_t k = (size_t)y * (size_t)width + (size_t)x;
            if (s->mask[k] != 0 || s->empty[k] || (beside && !is_beside(s, x, y)))
                continue;
            dst.pixels++;
            if (x + 1 == width || s->mask[k + 1] != 0 || s->empty[k + 1] || dst.pixels % every != 0)
                continue;
            if (count == SAMPLE) { /* every other one of them, and of what comes */
                every *= 2;
                count /= 2;
                for (size_t i = 0; i < count; i++)
                    room[i] = room[2 * i];
            }
            room[count++] = fabs((double)s->image->pixels[k + 1] - (double)s->image->pixels[k]);
        }
    dst.step = count > 0 ? rx_median(room, count) : NAN;
    return dst;
}

/* Of pixels with one value; room for SAMPLE numbers. */
static size_t hide_value(seek *s, int threads, uint8_t *mask, double *room)
{
    const size_t n = (size_t)s->image->width * (size_t)s->image->height;
    size_t hidden = 0;
    memset(s->empty, 0, n);
    search(s, threads);
    if (is_of_the_sky(s))
        return 0;
    spread(s);
    const part beside = measure_part(s, true, room), all = measure_part(s, false, room);
    if (beside.step < FADES * all.step || (double)beside.pixels > POINTS * (double)all.pixels)
        return 0;
    for (size_t k = 0; k < n; k++)
        if (s->empty[k]) {
            mask[k] |= RX_MASK_BAD;
            hidden++;
        }
    return hidden;
}

rx_status rx_no_data_hide(const rx_image *image, int nthreads, uint8_t *mask, size_t *found, rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    const int threads = rx_max_int(nthreads, 1);
    const float values[] = {lowest_of(image, mask, threads), 0.0f};
    unsigned char *empty = NULL;
    double *room = NULL;
    rx_status status = RX_OK;
    *found = 0;
    for (int i = 0; i < (values[0] == 0.0f ? 1 : 2); i++) {
        seek s = {.image = image, .mask = mask, .value = values[i]};
        if (!may_have_runs(&s, threads))
            continue;
        if (empty == NULL) {
            RX_TRY_EXIT(RX_MAKE(empty, n, err));
            RX_TRY_EXIT(RX_MAKE(room, (size_t)SAMPLE, err));
        }
        s.empty = empty;
        *found += hide_value(&s, threads, mask, room);
    }
exit:
    free(empty);
    free(room);
    return status;
}
