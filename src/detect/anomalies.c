/* Medians of rows, columns and boxes. */
#include "detect/anomalies.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "num/stats.h"

enum {
    BOX = RX_ANOMALIES_BOX,
    PIECE = 64,
    SAMPLE = 128,    /* pixels of a row or column */
    GROUP = 4,       /* boxes that touch */
    REACH = 16,      /* boxes, of what falls off from a bright one */
    LEAST_LINES = 20 /* rows or columns with a scatter */
};

static const double ENOUGH = 0.25;               /* of the pixels of a row, column or box */
static const double FAINT = 8.0;                 /* sigmas of the brightest pixel */
static const double LIGHT = 0.3, ERRORS = 5.0;   /* sigmas of a pixel; errors of the median */
static const float CLIP = 1.5F;                  /* sigmas */
static const double CLIPPED = 0.87;              /* change of a mean clipped there with one of the median */
static const double FALL = 1.5;                  /* power of the distance */
static const double STRIPED = 0.2, LARGE = 0.02; /* sigmas; share of boxes */
static const double COARSE = 1.3, CUT = 0.02;    /* sigmas; share of the pixels */
static const float NEAR = -3, LONE = -10;        /* z of the lowest value, and of what is none */
enum { LEAST_CUT = 10 };                         /* pixels */

/* Of what is looked at of a row: the smallest step from one pixel to the next, but 0 (HUGE_VAL: none); the lowest value that is no
 * lone one, its z, how many pixels have it and how many there are. */
typedef struct values {
    double step;
    float lowest, z;
    size_t alike, all;
} values;

/* What is measured, and room for it. */
typedef struct work {
    const rx_image *image;
    int nx, ny, along, across; /* boxes; pixels that are looked at, of a row and of a column */
    double limit;              /* of the median of a lit box */
    double *rows, *columns;    /* medians; NAN of too few pixels */
    values *values;            /* of the rows */
    double *median, *highest;  /* [ny][nx] of boxes */
} work;

/* Of long rows and columns pieces suffice, evenly spread: is pixel i of n one of them, and how many are? */
static bool is_sampled(int i, int n)
{
    return i / PIECE % rx_max_int(n / SAMPLE, 1) == 0;
}

static int sampled(int n)
{
    int count = 0;
    for (int i = 0; i < n; i++)
        count += is_sampled(i, n);
    return count;
}

/* Those of n values that are known, into dst, which has room for n. How many. */
static size_t keep_known(const float *z, int n, double *dst)
{
    size_t known = 0;
    for (int i = 0; i < n; i++) {
        dst[known] = (double)z[i];
        known += z[i] == z[i];
    }
    return known;
}

/* Median of the n values that are known, of n possible ones; in the order of `values` no more. */
static double median_of(double *values, size_t n, int possible)
{
    return (double)n >= ENOUGH * possible ? rx_median(values, n) : NAN;
}

/* That of both parts. */
static void join_lowest(const values *part, values *all)
{
    if (part->lowest < all->lowest) {
        all->lowest = part->lowest;
        all->z = part->z;
        all->alike = 0;
    }
    all->alike += part->lowest == all->lowest ? part->alike : 0;
    all->all += part->all;
}

static void look_at_values(const float *pixels, const float *z, int n, values *dst)
{
    for (int i = 0; i < n; i++) {
        const double step = i > 0 ? fabs((double)pixels[i] - (double)pixels[i - 1]) : 0;
        if (step > 0 && step < dst->step && z[i] == z[i] && z[i - 1] == z[i - 1])
            dst->step = step;
        if (z[i] > LONE)
            join_lowest(&(values){.lowest = pixels[i], .z = z[i], .alike = 1, .all = 1}, dst);
    }
}

static void measure_row(const work *w, int y, double *room)
{
    const int width = w->image->width;
    size_t n = 0;
    w->values[y] = (values){.step = HUGE_VAL, .lowest = INFINITY};
    for (int x = 0; x < width; x += PIECE) {
        float z[PIECE];
        const int count = rx_min_int(PIECE, width - x);
        if (!is_sampled(x, width))
            continue;
        rx_image_in_sigmas(w->image, x, y, count, z);
        n += keep_known(z, count, room + n);
        look_at_values(w->image->pixels + (size_t)y * (size_t)width + x, z, count, &w->values[y]);
    }
    w->rows[y] = median_of(room, n, w->along);
}

/* values: [PIECE][height]. */
static void measure_columns(const work *w, int x0, double *values)
{
    const int height = w->image->height, across = rx_min_int(PIECE, w->image->width - x0);
    size_t count[PIECE] = {0};
    for (int y = 0; y < height; y++) {
        float z[PIECE];
        if (!is_sampled(y, height))
            continue;
        rx_image_in_sigmas(w->image, x0, y, across, z);
        for (int i = 0; i < across; i++)
            count[i] += keep_known(z + i, 1, values + (size_t)i * (size_t)height + count[i]);
    }
    for (int i = 0; i < across; i++)
        w->columns[x0 + i] = median_of(values + (size_t)i * (size_t)height, count[i], w->across);
}

enum { WIDE = 128, ACROSS = WIDE / BOX };

/* Boxes beside each other, from the pixel x0, y0 on. */
typedef struct band {
    int x0, y0, across, up; /* pixels */
    float z[BOX][WIDE];     /* NAN, too, beyond the image */
} band;

static void read_rows(const rx_image *image, int first, band *dst)
{
    for (int y = first; y < dst->up; y += 2)
        rx_image_in_sigmas(image, dst->x0, dst->y0 + y, dst->across, dst->z[y]);
}

/* Sum over the known values of every second row, clipped, and their number, of each box. */
RX_SIMD static void sum_boxes(const band *b, float *restrict sum, float *restrict known)
{
    float all[WIDE] = {0}, low[WIDE];
    int count[WIDE] = {0};
    for (int y = 0; y < BOX; y += 2) {
        const float *z = b->z[y];
#pragma omp simd
        for (int i = 0; i < WIDE; i++)
            low[i] = z[i] < CLIP ? z[i] : CLIP; /* those that are not known, too */
#pragma omp simd
        for (int i = 0; i < WIDE; i++)
            all[i] += low[i] > -CLIP ? low[i] : -CLIP;
#pragma omp simd
        for (int i = 0; i < WIDE; i++)
            count[i] += z[i] == z[i];
    }
    for (int i = 0; i < ACROSS; i++) {
        for (int k = 0; k < BOX; k++) {
            sum[i] += all[i * BOX + k];
            known[i] += (float)count[i * BOX + k];
        }
        sum[i] -= CLIP * (BOX * BOX / 2 - known[i]);
    }
}

/* How many of a box's values are above that. */
RX_SIMD static int count_above(const float *z, float limit)
{
    int above = 0;
#pragma omp simd reduction(+ : above)
    for (int i = 0; i < BOX * BOX; i++)
        above += z[i] > limit;
    return above;
}

/* Of `known` values the middle one, known to be between low and high, to 1 in 1000. */
static double middle_of(const float *z, int known, double low, double high)
{
    while (high > 1.001 * low) {
        const double between = sqrt(low * high);
        if (2 * count_above(z, (float)between) > known)
            low = between;
        else
            high = between;
    }
    return low;
}

/* Whose mean is known: of a dark box it does for the median. */
static void measure_box(const work *w, const band *b, int x, double mean)
{
    const size_t at = (size_t)(b->y0 / BOX) * (size_t)w->nx + (size_t)((b->x0 + x) / BOX);
    float z[BOX * BOX], highest = -INFINITY;
    int known = 0;
    for (int y = 0; y < BOX; y++)
        memcpy(z + y * BOX, b->z[y] + x, BOX * sizeof *z);
    for (int i = 0; i < BOX * BOX; i++) {
        highest = z[i] > highest ? z[i] : highest;
        known += z[i] == z[i];
    }
    w->highest[at] = (double)highest;
    if (known < ENOUGH * BOX * BOX)
        w->median[at] = NAN;
    else if (2 * count_above(z, (float)w->limit) < known)
        w->median[at] = fmin(mean, w->limit);
    else
        w->median[at] = middle_of(z, known, w->limit, (double)highest);
}

/* Boxes whose every second row has a clipped mean below half of the limit's are dark: it does for their median. */
static void measure_boxes(const work *w, int by)
{
    const rx_image *image = w->image;
    band b = {.y0 = by * BOX, .up = rx_min_int(BOX, image->height - by * BOX)};
    for (b.x0 = 0; b.x0 < image->width; b.x0 += WIDE) {
        float sum[ACROSS] = {0}, known[ACROSS] = {0};
        bool odd_read = false;
        b.across = rx_min_int(WIDE, image->width - b.x0);
        for (int i = 0; i < BOX * WIDE && (b.across < WIDE || b.up < BOX); i++)
            b.z[i / WIDE][i % WIDE] = NAN;
        read_rows(image, 0, &b);
        sum_boxes(&b, sum, known);
        for (int i = 0; i * BOX < b.across; i++) {
            const double mean = (double)sum[i] / (double)known[i];
            if ((double)known[i] >= ENOUGH * BOX * BOX / 2 && mean < 0.5 * CLIPPED * w->limit) {
                w->median[(size_t)by * (size_t)w->nx + (size_t)(b.x0 / BOX + i)] = mean;
                continue;
            }
            if (!odd_read)
                read_rows(image, 1, &b);
            odd_read = true;
            measure_box(w, &b, i * BOX, mean);
        }
    }
}

/* rms of offsets beyond the noise of medians of so many pixels. medians is written over. */
static double offsets(double *medians, int n, int pixels, double wide)
{
    size_t known = 0;
    for (int i = 1; i < n; i++)
        if (isfinite(medians[i]) && isfinite(medians[i - 1]))
            medians[known++] = medians[i - 1] - medians[i];
    if (known < LEAST_LINES)
        return NAN;
    const double step = rx_sigma_mad(medians, known, NULL), noise = RX_MEDIAN_ERROR * wide;
    return sqrt(fmax(0.5 * step * step - noise * noise / pixels, 0.0));
}

/* room: for n numbers. */
static double usual_step(const values *rows, int n, double *room)
{
    size_t known = 0;
    for (int i = 0; i < n; i++)
        if (isfinite(rows[i].step))
            room[known++] = rows[i].step;
    return known > 0 ? rx_median(room, known) : 0;
}

static double share_of_lowest(const values *rows, int n)
{
    values all = {.lowest = INFINITY};
    for (int i = 0; i < n; i++)
        join_lowest(&rows[i], &all);
    return all.alike < LEAST_CUT || all.z < NEAR ? 0 : (double)all.alike / (double)all.all;
}

/* Does the light of a box fall off to it from a brighter one? */
static bool falls_off(const work *w, int bx, int by)
{
    const double own = w->median[(size_t)by * (size_t)w->nx + (size_t)bx];
    for (int v = rx_max_int(by - REACH, 0); v <= rx_min_int(by + REACH, w->ny - 1); v++)
        for (int u = rx_max_int(bx - REACH, 0); u <= rx_min_int(bx + REACH, w->nx - 1); u++) {
            const double other = w->median[(size_t)v * (size_t)w->nx + (size_t)u];
            if (other > 2.0 * own && other >= own * pow(1.0 + hypot(u - bx, v - by), FALL))
                return true;
        }
    return false;
}

enum { FAINT_LIGHT = 1, SEEN, LIT }; /* of rx_anomalies.lit */

/* Groups of boxes that touch; small ones are galaxies of low surface brightness, and noise. queue: [ny nx]. */
static void join_light(const work *w, int *queue, unsigned char *lit)
{
    for (int k = 0; k < w->nx * w->ny; k++) {
        int n = 0;
        if (lit[k] != FAINT_LIGHT)
            continue;
        queue[n++] = k;
        lit[k] = SEEN;
        for (int i = 0; i < n; i++) {
            const int x = queue[i] % w->nx, y = queue[i] / w->nx;
            for (int v = rx_max_int(y - 1, 0); v <= rx_min_int(y + 1, w->ny - 1); v++)
                for (int u = rx_max_int(x - 1, 0); u <= rx_min_int(x + 1, w->nx - 1); u++)
                    if (lit[v * w->nx + u] == FAINT_LIGHT) {
                        lit[v * w->nx + u] = SEEN;
                        queue[n++] = v * w->nx + u;
                    }
        }
        for (int i = 0; i < n; i++)
            lit[queue[i]] = n >= GROUP ? LIT : 0;
    }
}

static rx_status find_light(const work *w, int nthreads, rx_anomalies *dst, rx_error *err)
{
    const int n = w->nx * w->ny;
    long boxes = 0, lit = 0;
    int *queue;
    RX_TRY(RX_MAKE(queue, (size_t)n, err));
#pragma omp parallel for schedule(dynamic, 256) num_threads(nthreads)
    for (int k = 0; k < n; k++)
        if (w->median[k] > w->limit && w->highest[k] < FAINT && !falls_off(w, k % w->nx, k / w->nx))
            dst->lit[k] = FAINT_LIGHT;
    join_light(w, queue, dst->lit);
    for (int k = 0; k < n; k++) {
        boxes += isfinite(w->median[k]);
        lit += dst->lit[k] == LIT;
    }
    dst->light = boxes > 0 ? (double)lit / (double)boxes : NAN;
    free(queue);
    return RX_OK;
}

rx_status rx_anomalies_measure(const rx_image *image, double wide, int nthreads, rx_anomalies *dst,
                               rx_error *err)
{
    const int width = image->width, height = image->height, threads = rx_max_int(nthreads, 1);
    work w = {.image = image,
              .limit = fmax(LIGHT, ERRORS * RX_MEDIAN_ERROR * wide / BOX),
              .nx = (width + BOX - 1) / BOX,
              .ny = (height + BOX - 1) / BOX,
              .along = sampled(width),
              .across = sampled(height)};
    const size_t boxes = (size_t)w.nx * (size_t)w.ny;
    const size_t room = (size_t)rx_max_int(width, PIECE * height);
    double *numbers = NULL;
    rx_status status = RX_OK;
    *dst = (rx_anomalies){.nx = w.nx, .ny = w.ny};
    RX_TRY_EXIT(RX_MAKE(dst->lit, boxes, err));
    RX_TRY_EXIT(RX_MAKE(w.rows, (size_t)height, err));
    RX_TRY_EXIT(RX_MAKE(w.columns, (size_t)width, err));
    RX_TRY_EXIT(RX_MAKE(w.values, (size_t)height, err));
    RX_TRY_EXIT(RX_MAKE(w.median, boxes, err));
    RX_TRY_EXIT(RX_MAKE(w.highest, boxes, err));
    RX_TRY_EXIT(RX_MAKE(numbers, room * (size_t)threads, err));
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int t = 0; t < threads; t++) {
        for (int y = t; y < height; y += threads)
            measure_row(&w, y, numbers + room * (size_t)t);
        for (int by = t; by < w.ny; by += threads)
            measure_boxes(&w, by);
        for (int x = t * PIECE; x < width; x += threads * PIECE)
            measure_columns(&w, x, numbers + room * (size_t)t);
    }
    RX_TRY_EXIT(find_light(&w, threads, dst, err));
    dst->rows = offsets(w.rows, height, w.along, wide);
    dst->columns = offsets(w.columns, width, w.across, wide);
    dst->step = usual_step(w.values, height, numbers);
    dst->cut = share_of_lowest(w.values, height);
exit:
    free(w.rows);
    free(w.columns);
    free(w.values);
    free(w.median);
    free(w.highest);
    free(numbers);
    if (status != RX_OK)
        rx_anomalies_free(dst);
    return status;
}

void rx_anomalies_free(rx_anomalies *anomalies)
{
    free(anomalies->lit);
    *anomalies = (rx_anomalies){0};
}

int rx_anomalies_lit_at(const rx_anomalies *anomalies, const rx_image *image, int x, int y)
{
    float z = 0.0f;
    if (anomalies->lit != NULL)
        rx_image_in_sigmas(image, x, y, 1, &z);
    if (anomalies->lit == NULL || (double)z > FAINT)
        return 0;
    for (int v = rx_max_int(y / BOX - 1, 0); v <= rx_min_int(y / BOX + 1, anomalies->ny - 1); v++)
        for (int u = rx_max_int(x / BOX - 1, 0); u <= rx_min_int(x / BOX + 1, anomalies->nx - 1); u++)
            if (anomalies->lit[(size_t)v * (size_t)anomalies->nx + (size_t)u])
                return 1;
    return 0;
}

int rx_anomalies_is_striped(const rx_anomalies *anomalies)
{
    return anomalies->rows > STRIPED || anomalies->columns > STRIPED;
}

int rx_anomalies_is_lit(const rx_anomalies *anomalies)
{
    return anomalies->light > LARGE;
}

int rx_anomalies_is_coarse(const rx_anomalies *anomalies, double sigma)
{
    return anomalies->step > COARSE * sigma;
}

int rx_anomalies_is_cut(const rx_anomalies *anomalies)
{
    return anomalies->cut > CUT;
}
