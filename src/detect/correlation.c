/* A cell is copied with the pixels that its lags reach, and looked at by itself. */
#include "detect/correlation.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
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
    NEAR = RX_NOISE_NEAR /* lags that say what noise is */
};

static const double CUT = 4.0;           /* widths */
static const double CUT_WIDTH = 0.99946; /* rms of a normal deviate cut there: sqrt(1 - 2 CUT phi(CUT)) */
static const double STANDS_OUT = 3.5, BRIGHT = 20.0; /* widths of the filtered cell */
/* What is left out takes noise with it that stands out by chance: of lag (dx, dy) LEFT_OUT times the filter's own correlation, which
 * falls as LIKE says. 2 t phi(t) = 0.0061, t = STANDS_OUT, would go if pixels stood out one by one; 0.0049 by 27 Mpixel of white noise. */
static const double LEFT_OUT = 0.0049, LIKE[] = {1.0, 2.0 / 3.0, 1.0 / 6.0};
static const double LEAST = 0.02;     /* correlation that matters */
static const double LEAST_SUM = 0.15; /* the same of their sum */
static const double FLOOR = 0.3;      /* more than that at the reach is noise, not sky */

typedef struct cell {
    long used;
    double lag[LAGS]; /* mean products over the mean square; lag[0] the width */
    double skewness;
} cell;

typedef struct room {
    float z[AREA], filtered[AREA];
    unsigned char good[AREA], out[AREA];
    uint64_t bits[WINDOW][2]; /* good, pixel x at bit x % 64 of word x / 64 */
    double sorted[AREA];
} room;

static int cells_along(int side)
{
    const int few = rx_min_int(rx_max_int(side / CELL, 1), FEWER);
    return rx_max_int(few, rx_min_int(side / (2 * CELL), GRID));
}

/* Where the window of cell i of n along a side begins: cells stand evenly, from border to border. */
static int window_at(int side, int n, int i)
{
    const int last = rx_max_int(side - CELL, 0);
    return (n > 1 ? (int)((long)last * i / (n - 1)) : last / 2) - REACH;
}

/* z of the window at (left, low), 0 where a pixel is not good or beyond the image. */
static void copy(const rx_image *image, const unsigned char *used, int left, int low, room *r)
{
    const rx_map sky = rx_image_sky(image);
    const int first = rx_max_int(left, 0), n = rx_min_int(left + WINDOW, image->width) - first;
    memset(r->z, 0, sizeof r->z);
    memset(r->good, 0, sizeof r->good);
    for (int y = rx_max_int(low, 0); y < rx_min_int(low + WINDOW, image->height); y++) {
        float level_room[WINDOW], sigma_room[WINDOW];
        const size_t at = (size_t)y * (size_t)image->width + (size_t)first;
        const float *sigma = rx_map_row(&image->noise, y, first, n, sigma_room), *level = NULL;
        const int to = (y - low) * WINDOW + first - left;
        if (rx_map_given(&sky))
            level = rx_map_row(&sky, y, first, n, level_room);
        for (int x = 0; x < n; x++) {
            const float value = image->pixels[at + (size_t)x] - (level != NULL ? level[x] : 0.0f);
            if (!rx_image_hides(image, at + (size_t)x) && sigma[x] > 0.0f && isfinite(value) &&
                (used == NULL || used[at + (size_t)x])) {
                r->z[to + x] = value / sigma[x];
                r->good[to + x] = 1;
            }
        }
    }
}

/* Median and robust width of the good values, without the rim, which no filter reaches; of every seventh where these are
 * enough, in an order that no period of a resampled image meets. */
static double width_of(const float *values, room *r, double *middle)
{
    enum { LEAST_NUMBER = 500 };
    size_t n = 0;
    for (int step = 7; step > 0 && n < LEAST_NUMBER; step -= 6) {
        n = 0;
        for (int y = 1; y < WINDOW - 1; y++)
            for (int x = 1 + 3 * y % step; x < WINDOW - 1; x += step) {
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

/* Leaves z - mean of what is used, 0 elsewhere. Values in steps as wide as the noise have no width but that of the mesh, 1. */
static double centre(room *r)
{
    double middle, sum = 0.0, squares = 0.0;
    long n = 0;
    const double limit = CUT * fmax(width_of(r->z, r, &middle), 1.0);
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

/* Products of the cell's columns with those of another window, each column's sum by itself, in the order of the rows: the
 * same for all processors. */
RX_SIMD static double sum_products(const float *a, const float *b)
{
    typedef float eight __attribute__((vector_size(32), aligned(4), may_alias));
    enum { VECTORS = CELL / 8 };
    eight sum[VECTORS] = {{0}};
    float columns[CELL];
    double all = 0.0;
    for (int y = 0; y < CELL; y++, a += WINDOW, b += WINDOW) {
        const eight *p = (const eight *)a, *q = (const eight *)b;
        for (int i = 0; i < VECTORS; i++)
            sum[i] += p[i] * q[i];
    }
    memcpy(columns, sum, sizeof columns);
    for (int x = 0; x < CELL; x++)
        all += (double)columns[x];
    return all;
}

RX_SIMD static long count_pairs(const uint64_t *a, const uint64_t *b)
{
    long pairs = 0;
    for (int y = 0; y < CELL; y++)
        pairs += __builtin_popcountll(a[y] & b[y]);
    return pairs;
}

static int lag_of(int dx, int dy)
{
    return dy == 0 ? dx : REACH + 1 + (dy - 1) * (2 * REACH + 1) + dx + REACH;
}

/* Mean products of the cell's pixels with those dx beside them, for each dy. */
static void mean_products(const room *r, int dx, double *lag)
{
    uint64_t here[CELL], there[CELL + REACH];
    const float *cell = r->z + REACH * WINDOW + REACH;
    for (int y = 0; y < CELL + REACH; y++) {
        const uint64_t *bits = r->bits[REACH + y];
        there[y] = bits[0] >> (REACH + dx) | bits[1] << 1 << (63 - REACH - dx);
        if (y < CELL)
            here[y] = bits[0] >> REACH | bits[1] << (64 - REACH);
    }
    for (int dy = dx < 0; dy <= REACH; dy++) {
        const long pairs = count_pairs(here, there + dy);
        lag[lag_of(dx, dy)] = pairs > 0 ? sum_products(cell, cell + dy * WINDOW + dx) / (double)pairs : 0.0;
    }
}

static double mean_cube(const room *r)
{
    double sum = 0.0;
    long n = 0;
    for (int y = REACH; y < REACH + CELL; y++)
        for (int x = REACH; x < REACH + CELL; x++) {
            const double z = (double)r->z[y * WINDOW + x];
            sum += z * z * z;
            n += r->good[y * WINDOW + x];
        }
    return n > 0 ? sum / (double)n : 0.0;
}

static void measure_cell(const rx_image *image, const unsigned char *used, int left, int low, room *r,
                         cell *dst)
{
    *dst = (cell){0};
    copy(image, used, left, low, r);
    if (used == NULL)
        leave_sources_out(r);
    const double width = centre(r);
    pack_good(r);
    long n = 0;
    for (int y = REACH; y < REACH + CELL; y++)
        for (int x = REACH; x < REACH + CELL; x++)
            n += r->good[y * WINDOW + x];
    if (n < ENOUGH || !(width > 0.0))
        return;
    mean_products(r, 0, dst->lag);
    const double variance = dst->lag[0];
    if (!(variance > 0.0))
        return;
    dst->skewness = mean_cube(r) / pow(variance, 1.5);
    for (int dx = -REACH; dx <= REACH; dx++)
        if (dx != 0)
            mean_products(r, dx, dst->lag);
    for (int k = 1; k < LAGS; k++)
        dst->lag[k] /= variance;
    for (int dy = 0; dy < 3 && used == NULL; dy++)
        for (int dx = dy == 0 ? 1 : -2; dx < 3; dx++)
            dst->lag[lag_of(dx, dy)] += LEFT_OUT * LIKE[abs(dx)] * LIKE[dy];
    dst->lag[0] = used == NULL ? width * sqrt(1.0 + LEFT_OUT) : width;
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
    for (int i = 0; i < n; i++)
        sorted[i] = cells[which[i]].skewness;
    const double width = rx_sigma_mad(sorted, (size_t)n, &noise.skewness);
    noise.skewness_error = n < QUADRANT_CELLS ? HUGE_VAL : RX_MEDIAN_ERROR * width / sqrt((double)n);
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
    noise.error = (n > 2 ? RX_MEDIAN_ERROR : 1.0) * sqrt(squares / (double)noise.pixels);
    /* of the sum, half are the others again */
    const double sum_error = sqrt(2.0 * ((2 * NEAR + 1) * (2 * NEAR + 1) - 1)) * noise.error;
    noise.correlated =
        largest > fmax(4.0 * noise.error, LEAST) || fabs(sum) > fmax(5.0 * sum_error, LEAST_SUM);
    memcpy(noise.measured, noise.at, sizeof noise.at);
    for (int i = 0; i < RX_NOISE_SIDE * RX_NOISE_SIDE; i++) {
        double *at = &noise.at[i / RX_NOISE_SIDE][i % RX_NOISE_SIDE];
        const int dx = abs(i % RX_NOISE_SIDE - REACH), dy = abs(i / RX_NOISE_SIDE - REACH);
        const bool far = dx > NEAR || dy > NEAR; /* many lags of little are much together */
        if (dx + dy > 0 && (!noise.correlated || (far && fabs(*at) < 3.0 * noise.error)))
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
static void measure_quadrant(const cell *cells, const int *which, int n, int q, double *sorted,
                             rx_noise_correlation *dst)
{
    double middle;
    dst->quadrant[q] = NAN;
    if (n < QUADRANT_CELLS)
        return;
    for (int i = 0; i < n; i++)
        sorted[i] = near_sum(&cells[which[i]]);
    const double width = rx_sigma_mad(sorted, (size_t)n, &middle);
    dst->quadrant[q] = middle;
    dst->quadrant_error[q] = RX_MEDIAN_ERROR * width / sqrt((double)n);
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
            const int left = window_at(image->width, nx, k % nx), low = window_at(image->height, ny, k / nx);
            measure_cell(image, used, left, low, &rooms[t], &cells[k]);
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
        measure_quadrant(cells, which, found, q, sorted, dst);
    }
exit:
    free(cells);
    free(rooms);
    free(which);
    free(sorted);
    return status;
}
