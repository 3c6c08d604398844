/* A cell is copied with the pixels that its lags reach, and looked at by itself. */
#include "detect/correlation.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "num/stats.h"

enum {
    REACH = RX_NOISE_REACH,
    CELL = 64,
    WINDOW = CELL + 2 * REACH,
    AREA = WINDOW * WINDOW,
    LAGS = REACH + 1 + REACH * (2 * REACH + 1), /* dy > 0, or dy = 0 and dx >= 0 */
    GRID = 12,                                  /* cells in x and in y at most */
    FEWER = 8,                                  /* where more would look at most of the image */
    FAR = 10,                                   /* pixels around bright ones that are left out */
    ENOUGH = 1000,                              /* pixels, in a cell and in all */
    QUADRANT_CELLS = 9,
    NEAR = RX_NOISE_NEAR, /* lags by which noise is judged */
    EIGHT = 8
};

static const double CUT = 4.0;           /* widths */
static const double CUT_WIDTH = 0.99946; /* rms of a normal deviate cut there: sqrt(1 - 2 CUT phi(CUT)) */
static const double STANDS_OUT = 3.5, BRIGHT = 20.0; /* widths of the filtered cell */
static const double LEAST = 0.02;                    /* correlation that matters */
static const double LEAST_SUM = 0.15;                /* the same of their sum */
static const double FLOOR = 0.3;                     /* more than that at the reach is noise, not sky */
static const double MEDIAN_ERROR = 1.2533;           /* of a median over that of a mean */

typedef struct cell {
    long used;
    double lag[LAGS]; /* mean products over the mean square; lag[0] the width */
} cell;

typedef struct room {
    float z[AREA], filtered[AREA];
    unsigned char good[AREA], out[AREA];
    uint64_t bits[WINDOW][2]; /* good, pixel x at bit x % 64 of word x / 64 */
    double sorted[AREA];
} room;

/* Where a cell lies. */
typedef struct place {
    int x, y, width, height;   /* of the cell */
    int left, low, across, up; /* its window in the image */
} place;

static int cells_along(int side)
{
    const int few = rx_min_int(rx_max_int(side / CELL, 1), FEWER);
    return rx_max_int(few, rx_min_int(side / (2 * CELL), GRID));
}

static place place_of(const rx_image *image, int nx, int ny, int k)
{
    const int width = rx_min_int(CELL, image->width), height = rx_min_int(CELL, image->height);
    const int i = k % nx, j = k / nx;
    place p = {.width = width, .height = height};
    /* evenly, from border to border */
    p.x = nx > 1 ? (int)((long)(image->width - width) * i / (nx - 1)) : (image->width - width) / 2;
    p.y = ny > 1 ? (int)((long)(image->height - height) * j / (ny - 1)) : (image->height - height) / 2;
    p.left = rx_max_int(p.x - REACH, 0);
    p.low = rx_max_int(p.y - REACH, 0);
    p.across = rx_min_int(p.x + width + REACH, image->width) - p.left;
    p.up = rx_min_int(p.y + height + REACH, image->height) - p.low;
    return p;
}

/* z of the window, 0 where a pixel is not good. */
static void copy(const rx_image *image, const unsigned char *used, const place *p, room *r)
{
    const rx_map sky = rx_image_sky(image);
    memset(r->z, 0, sizeof r->z);
    memset(r->good, 0, sizeof r->good);
    for (int y = 0; y < p->up; y++) {
        float level_room[WINDOW], sigma_room[WINDOW];
        const size_t at = (size_t)(p->low + y) * (size_t)image->width + (size_t)p->left;
        const float *sigma = rx_map_row(&image->noise, p->low + y, p->left, p->across, sigma_room),
                    *level = NULL;
        if (rx_map_given(&sky))
            level = rx_map_row(&sky, p->low + y, p->left, p->across, level_room);
        for (int x = 0; x < p->across; x++) {
            const float value = image->pixels[at + (size_t)x] - (level != NULL ? level[x] : 0.0f);
            if (!rx_image_hides(image, at + (size_t)x) && sigma[x] > 0.0f && isfinite(value) &&
                (used == NULL || used[at + (size_t)x])) {
                r->z[y * WINDOW + x] = value / sigma[x];
                r->good[y * WINDOW + x] = 1;
            }
        }
    }
}

/* Median and robust width of the good values; of every second in x and in y where that is enough of them. */
static double width_of(const float *values, room *r, double *middle)
{
    size_t n = 0;
    for (int step = 2; step > 0 && n < ENOUGH; step--) {
        n = 0;
        for (int y = 0; y < WINDOW; y += step)
            for (int x = 0; x < WINDOW; x += step) {
                r->sorted[n] = (double)values[y * WINDOW + x];
                n += r->good[y * WINDOW + x];
            }
    }
    return rx_sigma_mad(r->sorted, n, middle);
}

/* Pixels within `reach` of one that stands out so far are not good: within reach in x, then in y. */
RX_SIMD static void leave_out(double middle, double limit, int reach, room *r)
{
    int any[WINDOW] = {0};
    memset(r->out, 0, sizeof r->out);
    for (int y = 0; y < WINDOW; y++) {
        unsigned char line[WINDOW + 2 * FAR] = {0}, *out = r->out + y * WINDOW;
        const unsigned char *good = r->good + y * WINDOW;
        const float *filtered = r->filtered + y * WINDOW;
        int found = 0;
#pragma omp simd reduction(| : found)
        for (int x = 0; x < WINDOW; x++)
            found |= line[FAR + x] = good[x] & (fabs((double)filtered[x] - middle) > limit);
        any[y] = found;
        for (int d = -reach; found && d <= reach; d++)
#pragma omp simd
            for (int x = 0; x < WINDOW; x++)
                out[x] |= line[FAR + x + d];
    }
    for (int y = 0; y < WINDOW; y++)
        for (int v = rx_max_int(y - reach, 0); any[y] && v <= rx_min_int(y + reach, WINDOW - 1); v++)
#pragma omp simd
            for (int x = 0; x < WINDOW; x++)
                r->good[v * WINDOW + x] &= !r->out[y * WINDOW + x];
}

RX_SIMD static void filter_window(const float *restrict window, float *restrict filtered)
{
    for (int y = 1; y < WINDOW - 1; y++)
#pragma omp simd
        for (int x = 1; x < WINDOW - 1; x++) {
            const float *z = window + y * WINDOW + x;
            filtered[y * WINDOW + x] = (4.0f * z[0] + 2.0f * (z[-1] + z[1] + z[-WINDOW] + z[WINDOW]) +
                                        z[-WINDOW - 1] + z[-WINDOW + 1] + z[WINDOW - 1] + z[WINDOW + 1]) /
                                       16.0f;
        }
}

static void leave_sources_out(room *r)
{
    filter_window(r->z, r->filtered);
    double middle;
    const double width = width_of(r->filtered, r, &middle);
    leave_out(middle, STANDS_OUT * width, FAR / 2, r);
    leave_out(middle, BRIGHT * width, FAR, r);
}

/* Leaves z - mean of what is used, 0 elsewhere. */
static double centre(room *r)
{
    double middle, sum = 0.0, squares = 0.0;
    long n = 0;
    const double limit = CUT * width_of(r->z, r, &middle);
    for (int i = 0; i < AREA; i++) {
        r->good[i] = r->good[i] && fabs((double)r->z[i] - middle) <= limit;
        sum += r->good[i] ? (double)r->z[i] : 0.0;
        n += r->good[i];
    }
    const double mean = n > 0 ? sum / (double)n : 0.0;
    for (int i = 0; i < AREA; i++) {
        r->z[i] = r->good[i] ? (float)((double)r->z[i] - mean) : 0.0f;
        squares += (double)r->z[i] * (double)r->z[i];
    }
    return n > 0 ? sqrt(squares / (double)n) / CUT_WIDTH : 0.0;
}

static void pack_good(room *r)
{
    memset(r->bits, 0, sizeof r->bits);
    for (int y = 0; y < WINDOW; y++)
        for (int x = 0; x < WINDOW; x++)
            r->bits[y][x / 64] |= (uint64_t)r->good[y * WINDOW + x] << (x % 64);
}

/* n pixels from x on, 64 at most. */
static inline uint64_t bits_from(const uint64_t *row, int x, int n)
{
    const uint64_t low = x < 64 ? row[0] >> x : row[1] >> (x - 64),
                   high = x > 0 && x < 64 ? row[1] << (64 - x) : 0;
    return (low | high) & (n < 64 ? ((uint64_t)1 << n) - 1 : ~(uint64_t)0);
}

/* Products of 32 columns, summed over n rows of two windows. Each column by itself, in the order of the rows: the same for
 * all processors. */
RX_SIMD static double sum_columns(const float *a, const float *b, int n)
{
    typedef float eight __attribute__((vector_size(32), aligned(4)));
    eight sum[4] = {{0}};
    float columns[4 * EIGHT];
    double all = 0.0;
    for (int y = 0; y < n; y++, a += WINDOW, b += WINDOW) {
        const eight *p = (const eight *)a, *q = (const eight *)b;
        sum[0] += p[0] * q[0];
        sum[1] += p[1] * q[1];
        sum[2] += p[2] * q[2];
        sum[3] += p[3] * q[3];
    }
    memcpy(columns, sum, sizeof columns);
    for (int x = 0; x < 4 * EIGHT; x++)
        all += (double)columns[x];
    return all;
}

RX_SIMD static long count_pairs(const uint64_t *a, const uint64_t *b, int n)
{
    long pairs = 0;
    for (int y = 0; y < n; y++)
        pairs += __builtin_popcountll(a[y] & b[y]);
    return pairs;
}

static double sum_products(const float *a, const float *b, int columns, int rows)
{
    double sum = 0.0;
    int x = 0;
    for (; x + 4 * EIGHT <= columns; x += 4 * EIGHT)
        sum += sum_columns(a + x, b + x, rows);
    for (; x < columns; x++)
        for (int y = 0; y < rows; y++)
            sum += (double)(a[y * WINDOW + x] * b[y * WINDOW + x]);
    return sum;
}

/* Where lag (dx, dy) stands among all. */
static int lag_of(int dx, int dy)
{
    return dy == 0 ? dx : REACH + 1 + (dy - 1) * (2 * REACH + 1) + dx + REACH;
}

/* Mean products of the cell's pixels with those dx beside them, for each dy. */
static void mean_products(const place *p, const room *r, int dx, double *lag)
{
    uint64_t here[WINDOW], there[WINDOW];
    const int x0 = p->x - p->left, y0 = p->y - p->low;
    const int first = rx_max_int(x0, -dx), n = rx_min_int(x0 + p->width, p->across - dx) - first;
    for (int y = 0; y < WINDOW; y++) {
        here[y] = bits_from(r->bits[y], first, n);
        there[y] = bits_from(r->bits[y], first + dx, n);
    }
    for (int dy = dx < 0; dy <= REACH; dy++) {
        const float *a = r->z + y0 * WINDOW + first;
        const int rows = rx_min_int(p->height, p->up - dy - y0);
        const long pairs = count_pairs(here + y0, there + y0 + dy, rows);
        lag[lag_of(dx, dy)] =
            pairs > 0 ? sum_products(a, a + dy * WINDOW + dx, n, rows) / (double)pairs : 0.0;
    }
}

static void measure_cell(const rx_image *image, const unsigned char *used, const place *p, room *r, cell *dst)
{
    *dst = (cell){0};
    copy(image, used, p, r);
    if (used == NULL)
        leave_sources_out(r);
    const double width = centre(r);
    pack_good(r);
    long n = 0;
    for (int y = 0; y < p->height; y++)
        for (int x = 0; x < p->width; x++)
            n += r->good[(p->y - p->low + y) * WINDOW + p->x - p->left + x];
    if (n < ENOUGH || !(width > 0.0))
        return;
    mean_products(p, r, 0, dst->lag);
    const double variance = dst->lag[0];
    if (!(variance > 0.0))
        return;
    for (int dx = -REACH; dx <= REACH; dx++)
        if (dx != 0)
            mean_products(p, r, dx, dst->lag);
    for (int k = 1; k < LAGS; k++)
        dst->lag[k] /= variance;
    dst->lag[0] = width;
    dst->used = n;
}

static double median_lag(const cell *cells, const int *which, int n, int lag, double *sorted)
{
    for (int i = 0; i < n; i++)
        sorted[i] = cells[which[i]].lag[lag];
    return rx_median(sorted, (size_t)n);
}

/* What does not fade with distance is the sky's. */
static void remove_floor(rx_noise_correlation *dst)
{
    double sum = 0.0;
    int lags = 0;
    for (int dy = -REACH; dy <= REACH; dy++)
        for (int dx = -REACH; dx <= REACH; dx++)
            if (abs(dx) == REACH || abs(dy) == REACH) {
                sum += dst->at[dy + REACH][dx + REACH];
                lags++;
            }
    const double floor = sum / lags;
    if (fabs(floor) > FLOOR)
        return;
    dst->scale *= sqrt(1.0 - floor);
    for (int i = 0; i < RX_NOISE_SIDE * RX_NOISE_SIDE; i++) {
        double *at = &dst->at[i / RX_NOISE_SIDE][i % RX_NOISE_SIDE];
        *at = (*at - floor) / (1.0 - floor);
    }
    dst->at[REACH][REACH] = 1.0;
}

/* The medians over those cells, and what they amount to. */
static rx_noise_correlation combine(const cell *cells, const int *which, int n, double *sorted)
{
    rx_noise_correlation noise = rx_noise_white(n > 0 ? RX_NOISE_MEASURED : RX_NOISE_UNKNOWN);
    if (n == 0)
        return noise;
    int k = 1;
    for (int i = 0; i < n; i++)
        noise.pixels += cells[which[i]].used;
    noise.scale = median_lag(cells, which, n, 0, sorted);
    for (int dy = 0; dy <= REACH; dy++)
        for (int dx = dy == 0 ? 1 : -REACH; dx <= REACH; dx++, k++)
            noise.at[REACH + dy][REACH + dx] = noise.at[REACH - dy][REACH - dx] =
                median_lag(cells, which, n, k, sorted);
    remove_floor(&noise);
    double squares = 0.0, largest = 0.0, sum = 0.0;
    for (int dy = -REACH; dy <= REACH; dy++)
        for (int dx = -REACH; dx <= REACH; dx++) {
            const double value = noise.at[dy + REACH][dx + REACH];
            squares += value * value;
            if (dx == 0 && dy == 0)
                continue;
            if (abs(dx) <= 1 && abs(dy) <= 1)
                largest = fmax(largest, fabs(value));
            if (abs(dx) <= NEAR && abs(dy) <= NEAR)
                sum += value;
        }
    noise.error = (n > 2 ? MEDIAN_ERROR : 1.0) * sqrt(squares / (double)noise.pixels);
    /* of the sum, half are the others again */
    const double sum_error = sqrt(2.0 * ((2 * NEAR + 1) * (2 * NEAR + 1) - 1)) * noise.error;
    noise.correlated =
        largest > fmax(4.0 * noise.error, LEAST) || fabs(sum) > fmax(5.0 * sum_error, LEAST_SUM);
    memcpy(noise.measured, noise.at, sizeof noise.at);
    for (int i = 0; i < RX_NOISE_SIDE * RX_NOISE_SIDE; i++) {
        double *at = &noise.at[i / RX_NOISE_SIDE][i % RX_NOISE_SIDE];
        if (i != RX_NOISE_SIDE * RX_NOISE_SIDE / 2 && (!noise.correlated || fabs(*at) < 3.0 * noise.error))
            *at = 0.0;
    }
    return noise;
}

/* What the nearest lags of one cell sum up to, without what all lags at the reach have in common. */
static double near_sum(const cell *c)
{
    double near = 0.0, far = 0.0;
    int n = 0, k = 1;
    for (int dy = 0; dy <= REACH; dy++)
        for (int dx = dy == 0 ? 1 : -REACH; dx <= REACH; dx++, k++) {
            if (abs(dx) <= NEAR && abs(dy) <= NEAR)
                near += 2.0 * c->lag[k];
            if (abs(dx) == REACH || abs(dy) == REACH) {
                far += c->lag[k];
                n++;
            }
        }
    const double floor = far / n;
    return (1.0 + near - (2 * NEAR + 1) * (2 * NEAR + 1) * floor) / (1.0 - floor);
}

/* Of a quadrant, from the medians and the scatter of its cells: no lag is left out for its error, which would make
 * a quadrant look other than the whole. */
static void judge_quadrant(const cell *cells, const int *which, int n, int q, double *sorted,
                           rx_noise_correlation *dst)
{
    double middle;
    dst->quadrant[q] = NAN;
    if (n < QUADRANT_CELLS)
        return;
    for (int i = 0; i < n; i++)
        sorted[i] = near_sum(&cells[which[i]]);
    const double width = rx_sigma_mad(sorted, (size_t)n, &middle);
    dst->quadrant[q] = sqrt(fmax(middle, 0.01));
    dst->quadrant_error[q] = MEDIAN_ERROR * width / sqrt((double)n) / (2.0 * dst->quadrant[q]);
}

rx_status rx_correlation_measure(const rx_image *image, const unsigned char *used, int nthreads,
                                 rx_noise_correlation *dst, rx_error *err)
{
    const int nx = cells_along(image->width), ny = cells_along(image->height), n = nx * ny;
    const int threads = rx_max_int(rx_min_int(nthreads, n), 1);
    rx_status status = RX_OK;
    cell *cells = RX_NEW(cell, (size_t)n);
    room *rooms = RX_NEW(room, (size_t)threads);
    int *which = RX_NEW(int, (size_t)n);
    double *sorted = RX_NEW(double, (size_t)n);
    *dst = rx_noise_white(RX_NOISE_UNKNOWN);
    if (cells == NULL || rooms == NULL || which == NULL || sorted == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)n * sizeof *cells + (size_t)threads * sizeof *rooms));
#pragma omp parallel for num_threads(threads) schedule(static)
    for (int t = 0; t < threads; t++)
        for (int k = t; k < n; k += threads) {
            const place p = place_of(image, nx, ny, k);
            measure_cell(image, used, &p, &rooms[t], &cells[k]);
        }
    int found = 0;
    for (int k = 0; k < n; k++)
        if (cells[k].used > 0)
            which[found++] = k;
    *dst = combine(cells, which, found, sorted);
    for (int q = 0; q < RX_NOISE_QUADRANTS; q++) {
        found = 0;
        for (int k = 0; k < n; k++)
            if (cells[k].used > 0 && (2 * (k % nx) >= nx) + 2 * (2 * (k / nx) >= ny) == q)
                which[found++] = k;
        judge_quadrant(cells, which, found, q, sorted, dst);
    }
exit:
    free(cells);
    free(rooms);
    free(which);
    free(sorted);
    return status;
}
