/* Runs of one value, what touches them, and whether sky or light can have made them. */
#include "detect/no_data.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "num/stats.h"

enum { RUN = 32, HALF = RUN / 2, STRIP = 256, SAMPLE = 20000, MANY = 1024, MAX_RUN = 1 << 20 };

/* What is known of a pixel. */
enum {
    IN_ROW = 1,    /* of a run in a row, */
    IN_COLUMN = 2, /* in a column, */
    JOINED = 4,    /* or of a region that has one */
    BESIDE = 8,    /* it has another value, and touches such a region */
    KEPT = 16,     /* a region of light */
    EMPTY = IN_ROW | IN_COLUMN | JOINED
};

static const double BY_CHANCE = 0.01; /* runs that the noise of a tile may make */
static const double SKY = 0.35;       /* pixels with one value join without an end from a share of 0.41 on */
static const double FADES = 0.2, POINTS = 0.5;
static const double LIGHT = 5.0; /* sigma */

typedef struct value {
    float value;
    int run;                 /* how long one must be */
    bool sky;                /* the sky itself has it */
    size_t alike, two, four; /* elsewhere: pixels that have it; runs in rows of 2 and more, of 4 and more */
    size_t beside;           /* other pixels that touch its regions; of these */
    size_t steps, flat;      /* with a next one in the row, and such that differ from it by next to nothing */
} value;

typedef struct seek {
    const rx_image *image;
    bool keep_sky;
    const uint8_t *mask;
    unsigned char *mark; /* [height][width] */
    size_t *region;      /* [room] */
    size_t room;
    value *values; /* [nvalues] rising */
    size_t nvalues;
    double *steps, *levels; /* [SAMPLE] */
    /* pixels that are in no run: how many, the medians of their values and of their steps to the next one in the row */
    size_t rest;
    double level, step;
} seek;

/* Padding may be at saturation, too. */
static bool is_used(const seek *s, size_t k)
{
    return (s->mask[k] & ~RX_MASK_SATURATED) == 0;
}

static bool is_alike(const seek *s, size_t a, size_t b)
{
    return s->image->pixels[a] == s->image->pixels[b] && is_used(s, a) && is_used(s, b);
}

static bool is_next(const seek *s, size_t k, int steps)
{
    return k % (size_t)s->image->width + (size_t)steps < (size_t)s->image->width;
}

static value *find(const seek *s, float pixel)
{
    size_t from = 0, to = s->nvalues;
    while (from < to) {
        const size_t middle = (from + to) / 2;
        if (s->values[middle].value < pixel)
            from = middle + 1;
        else
            to = middle;
    }
    return from < s->nvalues && s->values[from].value == pixel ? &s->values[from] : NULL;
}

/* The last pixel of a run is at k, the others `step` apart. */
static void mark_run(const seek *s, size_t k, int run, size_t step, unsigned char how)
{
    if (run < RUN)
        return;
    const value *v = find(s, s->image->pixels[k]);
    if (v != NULL && (v->sky || run < v->run))
        return;
    for (int i = 0; i < run; i++)
        s->mark[k - (size_t)i * step] |= how;
}

static void search_row(const seek *s, int y)
{
    const size_t width = (size_t)s->image->width, from = (size_t)y * width;
    int run = is_used(s, from);
    for (size_t k = from + 1; k < from + width; k++) {
        if (is_alike(s, k - 1, k)) {
            run++;
            continue;
        }
        mark_run(s, k - 1, run, 1, IN_ROW);
        run = is_used(s, k);
    }
    mark_run(s, from + width - 1, run, 1, IN_ROW);
}

/* Columns x0 to x0 + STRIP - 1. */
static void search_columns(const seek *s, int x0)
{
    const size_t step = (size_t)s->image->width;
    const int height = s->image->height, across = rx_min_int(STRIP, s->image->width - x0);
    int run[STRIP];
    for (int i = 0; i < across; i++)
        run[i] = is_used(s, (size_t)(x0 + i));
    for (int y = 1; y <= height; y++)
        for (int i = 0; i < across; i++) {
            const size_t last = (size_t)(y - 1) * step + (size_t)(x0 + i);
            if (y < height && is_alike(s, last, last + step)) {
                run[i]++;
                continue;
            }
            mark_run(s, last, run[i], step, IN_COLUMN);
            run[i] = y < height && is_used(s, last + step);
        }
}

static void search(const seek *s, int threads)
{
    memset(s->mark, 0, (size_t)s->image->width * (size_t)s->image->height);
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int y = 0; y < s->image->height; y++)
        search_row(s, y);
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int x = 0; x < s->image->width; x += STRIP)
        search_columns(s, x);
}

/* Of every run two pixels stand HALF apart at multiples of it, and one beside the first of them has the same value: without
 * such there is none. */
static bool may_have_runs(const rx_image *image, int threads)
{
    const int width = image->width, height = image->height;
    int found = 0;
#pragma omp parallel for schedule(static) num_threads(threads) reduction(| : found)
    for (int y = 0; y < height; y++) {
        const float *row = image->pixels + (size_t)y * (size_t)width;
        for (int x = HALF; x < width; x += HALF)
            found |= (row[x - HALF] == row[x]) & (row[x - 1] == row[x]);
        for (int x = 0; y % HALF == 0 && y < height - HALF && x < width; x++)
            found |= (row[x] == row[(size_t)width + (size_t)x]) &
                     (row[x] == row[(size_t)HALF * (size_t)width + (size_t)x]);
    }
    return found != 0;
}

static int by_value(const void *a, const void *b)
{
    const float x = ((const value *)a)->value, y = ((const value *)b)->value;
    return (x > y) - (x < y);
}

/* Of all runs, each once. */
static rx_status list_values(seek *s, rx_error *err)
{
    const size_t width = (size_t)s->image->width, n = width * (size_t)s->image->height;
    size_t found = 0, room = 0;
    for (size_t k = 0; k < n; k++) {
        const float pixel = s->image->pixels[k];
        const bool listed = (k % width != 0 && s->mark[k - 1] != 0 && is_alike(s, k - 1, k)) ||
                            (k >= width && s->mark[k - width] != 0 && is_alike(s, k - width, k));
        if (s->mark[k] == 0 || listed || (found > 0 && s->values[found - 1].value == pixel))
            continue;
        if (found == room)
            RX_TRY(RX_GROW(s->values, room = 2 * room + MANY, err));
        s->values[found++] = (value){.value = pixel, .run = RUN};
    }
    if (found > 1)
        qsort(s->values, found, sizeof *s->values, by_value);
    s->nvalues = 0;
    for (size_t i = 0; i < found; i++)
        if (i == 0 || s->values[i].value != s->values[s->nvalues - 1].value)
            s->values[s->nvalues++] = s->values[i];
    return RX_OK;
}

/* What is in no run; medians of an even part of it. */
static void measure_rest(seek *s)
{
    const size_t n = (size_t)s->image->width * (size_t)s->image->height;
    const float *pixels = s->image->pixels;
    size_t count = 0, every = 1;
    s->rest = 0;
    for (size_t i = 0; i < s->nvalues; i++)
        s->values[i].alike = s->values[i].two = s->values[i].four = 0;
    for (size_t k = 0; k < n; k++) {
        if (!is_used(s, k) || (s->mark[k] & EMPTY) != 0)
            continue;
        s->rest++;
        value *v = find(s, pixels[k]);
        if (v != NULL) {
            v->alike++;
            if (!(k % (size_t)s->image->width != 0 && is_alike(s, k - 1, k))) {
                const bool two = is_next(s, k, 1) && is_alike(s, k, k + 1);
                v->two += two;
                v->four += two && is_next(s, k, 3) && is_alike(s, k, k + 2) && is_alike(s, k, k + 3);
            }
        }
        if (!is_next(s, k, 1) || !is_used(s, k + 1) || (s->mark[k + 1] & EMPTY) != 0 || s->rest % every != 0)
            continue;
        if (count == SAMPLE) { /* every other one of them, and of what comes */
            every *= 2;
            count /= 2;
            for (size_t i = 0; i < count; i++) {
                s->steps[i] = s->steps[2 * i];
                s->levels[i] = s->levels[2 * i];
            }
        }
        s->steps[count] = fabs((double)pixels[k + 1] - (double)pixels[k]);
        s->levels[count++] = (double)pixels[k];
    }
    s->step = rx_median(s->steps, count);
    s->level = rx_median(s->levels, count);
}

/* The other pixels around one of a region of that value. */
static void look_around(const seek *s, size_t k, value *v)
{
    const int width = s->image->width, height = s->image->height;
    const int x = (int)(k % (size_t)width), y = (int)(k / (size_t)width);
    for (int b = rx_max_int(y - 1, 0); b <= rx_min_int(y + 1, height - 1); b++)
        for (int a = rx_max_int(x - 1, 0); a <= rx_min_int(x + 1, width - 1); a++) {
            const size_t at = (size_t)b * (size_t)width + (size_t)a;
            if (!is_used(s, at) || (s->mark[at] & (EMPTY | BESIDE)) != 0)
                continue;
            s->mark[at] |= BESIDE;
            v->beside++;
            if (is_next(s, at, 1) && is_used(s, at + 1) && (s->mark[at + 1] & EMPTY) == 0) {
                v->steps++;
                v->flat +=
                    fabs((double)s->image->pixels[at + 1] - (double)s->image->pixels[at]) < FADES * s->step;
            }
        }
}

/* How much light rises towards a pixel of a region: of its neighbours outside, in lines that are half a run long inside, how many
 * there are, and how many are brighter than what is half a run farther out. */
static void climb(const seek *s, size_t k, size_t *sides, size_t *rising)
{
    static const int to[][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    const int width = s->image->width, height = s->image->height;
    const int x = (int)(k % (size_t)width), y = (int)(k / (size_t)width);
    for (int i = 0; i < 4; i++) {
        const int far_x = x + (HALF + 1) * to[i][0], far_y = y + (HALF + 1) * to[i][1];
        const int in_x = x - HALF * to[i][0], in_y = y - HALF * to[i][1];
        if (rx_min_int(far_x, in_x) < 0 || rx_max_int(far_x, in_x) >= width || rx_min_int(far_y, in_y) < 0 ||
            rx_max_int(far_y, in_y) >= height || !is_alike(s, k, (size_t)in_y * (size_t)width + (size_t)in_x))
            continue;
        const size_t near = (size_t)(y + to[i][1]) * (size_t)width + (size_t)(x + to[i][0]),
                     far = (size_t)far_y * (size_t)width + (size_t)far_x;
        if (is_used(s, near) && is_used(s, far) && ((s->mark[near] | s->mark[far]) & EMPTY) == 0) {
            ++*sides;
            *rising += (double)s->image->pixels[near] - (double)s->image->pixels[far] > LIGHT * s->step;
        }
    }
}

/* A saturated star, whose light most of its sides rise from, or what bled from one, too thin for runs both ways and not along
 * the border. */
static bool is_light(const seek *s, size_t n)
{
    const int width = s->image->width, height = s->image->height;
    size_t wide = 0, border = 0, sides = 0, rising = 0;
    for (size_t i = 0; i < n; i++) {
        const size_t k = s->region[i];
        const int x = (int)(k % (size_t)width), y = (int)(k / (size_t)width), in = s->mark[k];
        border += (x == 0 || x == width - 1) ? (in & IN_COLUMN) != 0
                                             : (y == 0 || y == height - 1) && (in & IN_ROW) != 0;
        wide += (in & IN_ROW) != 0 && (in & IN_COLUMN) != 0;
        climb(s, k, &sides, &rising);
    }
    return wide > 0 ? 2 * rising > sides : border == 0;
}

/* The region of a run at `start`: what touches it and is alike, and so on. */
static rx_status join(seek *s, size_t start, rx_error *err)
{
    const int width = s->image->width, height = s->image->height;
    value *v = find(s, s->image->pixels[start]);
    size_t n = 0;
    s->mark[start] |= JOINED;
    s->region[n++] = start;
    for (size_t next = 0; next < n; next++) {
        const size_t k = s->region[next];
        const int x = (int)(k % (size_t)width), y = (int)(k / (size_t)width);
        if (n + 8 > s->room) {
            RX_TRY(RX_GROW(s->region, 2 * s->room, err));
            s->room *= 2;
        }
        for (int b = rx_max_int(y - 1, 0); b <= rx_min_int(y + 1, height - 1); b++)
            for (int a = rx_max_int(x - 1, 0); a <= rx_min_int(x + 1, width - 1); a++) {
                const size_t at = (size_t)b * (size_t)width + (size_t)a;
                if ((s->mark[at] & JOINED) == 0 && is_alike(s, k, at)) {
                    s->mark[at] |= JOINED;
                    s->region[n++] = at;
                }
            }
    }
    const bool light = (double)v->value > s->level + LIGHT * s->step && is_light(s, n);
    for (size_t i = 0; i < n; i++)
        if (light)
            s->mark[s->region[i]] |= KEPT;
        else
            look_around(s, s->region[i], v);
    return RX_OK;
}

static rx_status join_all(seek *s, rx_error *err)
{
    const size_t n = (size_t)s->image->width * (size_t)s->image->height;
    for (size_t i = 0; i < s->nvalues; i++)
        s->values[i].beside = s->values[i].steps = s->values[i].flat = 0;
    for (size_t k = 0; k < n; k++)
        if ((s->mark[k] & EMPTY) != 0 && (s->mark[k] & JOINED) == 0)
            RX_TRY(join(s, k, err));
    return RX_OK;
}

/* Of `alike` pixels, each followed by another one with a probability p, as many times p^(run - 1) begin a run. Sees whether any
 * run was too short. */
static bool lengthen(seek *s)
{
    bool any = false;
    for (size_t i = 0; i < s->nvalues; i++) {
        value *v = &s->values[i];
        if (v->sky || v->alike == 0)
            continue;
        const double p = sqrt(((double)v->four + 1.0) / ((double)v->two + 2.0));
        const double run = 1.0 + log(BY_CHANCE / (double)v->alike) / log(p);
        if (run > RUN) {
            v->run = run < MAX_RUN ? (int)ceil(run) : MAX_RUN;
            any = true;
        }
    }
    return any;
}

static bool is_no_data(const seek *s, const value *v)
{
    const bool stays = s->keep_sky && fabs((double)v->value - s->level) <= LIGHT * s->step;
    return !stays && !v->sky && 2 * v->flat <= v->steps && (double)v->beside <= POINTS * (double)s->rest;
}

/* Regions of all values; anew where some need longer runs. */
static rx_status seek_regions(seek *s, int threads, rx_error *err)
{
    search(s, threads);
    RX_TRY(list_values(s, err));
    measure_rest(s);
    bool sky = false;
    for (size_t i = 0; i < s->nvalues; i++)
        sky |= s->values[i].sky = (double)s->values[i].alike > SKY * (double)s->rest;
    if (sky)
        search(s, threads);
    RX_TRY(join_all(s, err));
    measure_rest(s);
    if (!lengthen(s))
        return RX_OK;
    search(s, threads);
    return join_all(s, err);
}

rx_status rx_no_data_hide(const rx_image *image, bool keep_sky, int nthreads, uint8_t *mask, size_t *found,
                          rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    const int threads = rx_max_int(nthreads, 1);
    seek s = {.image = image, .keep_sky = keep_sky, .mask = mask};
    rx_status status = RX_OK;
    *found = 0;
    if (!may_have_runs(image, threads))
        return RX_OK;
    RX_TRY_EXIT(RX_MAKE(s.mark, n, err));
    RX_TRY_EXIT(RX_MAKE(s.steps, (size_t)SAMPLE, err));
    RX_TRY_EXIT(RX_MAKE(s.levels, (size_t)SAMPLE, err));
    RX_TRY_EXIT(RX_MAKE(s.region, (size_t)MANY, err));
    s.room = MANY;
    RX_TRY_EXIT(seek_regions(&s, threads, err));
    for (size_t k = 0; k < n; k++)
        if ((s.mark[k] & EMPTY) != 0 && (s.mark[k] & KEPT) == 0 &&
            is_no_data(&s, find(&s, image->pixels[k]))) {
            mask[k] |= RX_MASK_BAD;
            ++*found;
        }
exit:
    free(s.mark);
    free(s.steps);
    free(s.levels);
    free(s.region);
    free(s.values);
    return status;
}
