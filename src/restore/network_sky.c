/* The sky between the sources of a network, and its image in ADU. */
#include "restore/network_sky.h"

#include <float.h>
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/simd.h"
#include "data/map.h"

enum { CELL = 8, ROUNDS = 64 };
static const double LEAST_SIGMA = 5, PER_FWHM = 1.7; /* of G: pixels, and the PSF's FWHM */
static const float CLIP = 5;                         /* sigmas */
static const float ERROR = 0.3f;                     /* of a model, share of its light */
static const double SETTLED = 1e-5;                  /* noise units: far below what VERIFY_SEAMS allows */
static const double WIDE = 4;                        /* of the wide G, in sigmas of the near one */
static const double SEEN = 2;  /* standard errors, from which on light begins to count */
static const double LIGHT = 1; /* noise units: the most that a cell counts for */

/* What all rows have in common. */
typedef struct frame {
    const rx_network_input *input;
    const float *m;
    rx_map level;
    int width;
    double photon; /* variance per unit of light and ADU of scale */
    float error;
} frame;

static frame frame_of(const rx_network_input *input, const float *m, float error)
{
    const rx_image *image = input->image;
    return (frame){.input = input,
                   .m = m,
                   .level = rx_image_sky(image),
                   .width = image->width,
                   .photon = image->gain > 0 && isfinite(image->gain) ? 1 / image->gain : 0,
                   .error = error};
}

/* r and the variance of n pixels, of the sky, of the photons of m and of its error. */
RX_SIMD static void residuals(const frame *f, int n, const float *restrict m, const float *restrict unit,
                              const float *restrict sigma, float *restrict r, float *restrict variance)
{
    const float photon = (float)f->photon, error = f->error;
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float known = (sigma[i] > 0) & (sigma[i] <= FLT_MAX) ? sigma[i] : unit[i];
        const float light = m[i] > 0 ? m[i] : 0, sky = known / unit[i], wrong = error * light;
        r[i] -= m[i];
        variance[i] = sky * sky + photon * light / unit[i] + wrong * wrong;
    }
}

/* One row: unit, r and variance of its pixels, each [width]. */
static void read_row(const frame *f, int y, float *unit, float *room, float *r, float *variance)
{
    rx_network_data_row(f->input, &f->level, y, unit, room, r);
    const float *sigma = rx_map_row(&f->input->image->noise, y, 0, f->width, room);
    residuals(f, f->width, f->m + (size_t)y * (size_t)f->width, unit, sigma, r, variance);
}

/* What the n columns of a cell say of a level, each by itself. r: CELL rows, then as many of weights, then of how far a
 * residual counts. */
static inline void pull(int rows, int n, int stride, const float *r, float level, float *restrict part)
{
    const float *w = r + CELL * (size_t)stride, *far = w + CELL * (size_t)stride;
    for (int y = 0; y < rows; y++, r += stride, w += stride, far += stride)
#pragma omp simd
        for (int i = 0; i < n; i++) {
            const float away = r[i] - level, low = away > -far[i] ? away : -far[i];
            part[i] += w[i] * (low < far[i] ? low : far[i]);
        }
}

/* Huber's weighted mean of a cell of `rows` rows of n pixels, and the sum of weights. */
RX_SIMD static double cell_mean(int rows, int n, int stride, const float *r, double *weight)
{
    const float *w = r + CELL * (size_t)stride;
    double level = 0, sum = 0;
    for (int y = 0; y < rows; y++)
        for (int i = 0; i < n; i++)
            sum += (double)w[y * stride + i];
    *weight = sum;
    for (int round = 0; round < ROUNDS && sum > 0; round++) {
        float part[CELL] = {0};
        double change = 0;
        if (n == CELL) /* so that the compiler knows */
            pull(rows, CELL, stride, r, (float)level, part);
        else
            pull(rows, n, stride, r, (float)level, part);
        for (int i = 0; i < n; i++)
            change += (double)part[i];
        level += change / sum;
        if (fabs(change) < SETTLED * sum)
            break;
    }
    return level;
}

/* variance becomes the weight; far: where a residual counts no more than there. */
RX_SIMD static void set_weights(int n, const uint8_t *restrict mask, float *restrict variance,
                                float *restrict far)
{
#pragma omp simd
    for (int i = 0; i < n; i++)
        far[i] = CLIP * sqrtf(variance[i]);
#pragma omp simd
    for (int i = 0; i < n; i++)
        variance[i] = mask[i] == 0 ? 1 / variance[i] : 0;
}

/* Sum of what the data hold above the sky in a cell, its good pixels counted in *good. */
static double cell_light(int rows, int n, int stride, const float *r, const float *m, double *good)
{
    const float *w = r + CELL * (size_t)stride;
    double sum = 0;
    for (int y = 0; y < rows; y++, r += stride, w += stride, m += stride)
        for (int i = 0; i < n; i++) {
            const int used = w[i] > 0;
            sum += used ? (double)(r[i] + m[i]) : 0;
            *good += used;
        }
    return fmax(-LIGHT * *good, fmin(LIGHT * *good, sum));
}

/* A row of cells, of the residual and of the light. room: 2 + 3 CELL rows of the tile. */
static void add_cells(const frame *f, int cy, rx_cells *c, rx_cells *light, float *room)
{
    const int width = f->width, height = f->input->image->height;
    const int rows = height - cy * CELL < CELL ? height - cy * CELL : CELL;
    float *r = room + 2 * (size_t)width, *w = r + CELL * (size_t)width, *far = w + CELL * (size_t)width;
    for (int y = 0; y < rows; y++) {
        const size_t at = (size_t)y * (size_t)width;
        const uint8_t *mask = f->input->mask + (size_t)(cy * CELL + y) * (size_t)width;
        read_row(f, cy * CELL + y, room, room + width, r + at, w + at);
        set_weights(width, mask, w + at, far + at);
    }
    for (int cx = 0; cx < c->nx; cx++) {
        const int x = cx * CELL, n = width - x < CELL ? width - x : CELL;
        const size_t k = (size_t)cy * (size_t)c->nx + (size_t)cx;
        const float *m = f->m + (size_t)(cy * CELL) * (size_t)width + (size_t)x;
        const double mean = cell_mean(rows, n, width, r + x, &c->weight[k]);
        c->sum[k] = c->weight[k] * mean;
        light->sum[k] = cell_light(rows, n, width, r + x, m, &light->weight[k]);
    }
}

/* share[ny][nx] is raised to what the light within `sigma` of each cell says: under a Gaussian of that sigma 0 up to SEEN
 * standard errors of white noise, 1 from SEEN + 1 on. */
static rx_status see(const rx_cells *light, double sigma, int nthreads, double *share, rx_error *err)
{
    const int nx = light->nx, ny = light->ny, reach = (int)ceil(sigma / CELL);
    const double per_error = sqrt(4 * M_PI) * sigma / CELL;
    rx_coarse seen = {0}, pixels = {0};
    rx_status status = rx_cells_smooth(light, sigma, 0, nthreads, &seen, &pixels, err);
    if (status == RX_OK) {
        for (size_t k = 0; k < (size_t)nx * (size_t)ny; k++) {
            const double errors = fabs((double)seen.value[k]) * per_error * sqrt((double)pixels.value[k]);
            seen.value[k] = (float)fmax(0, fmin(1, errors - SEEN));
        }
#pragma omp parallel for schedule(static) num_threads(nthreads)
        for (int y = 0; y < ny; y++)
            for (int x = 0; x < nx; x++)
                for (int v = y < reach ? -y : -reach; v <= reach && y + v < ny; v++)
                    for (int u = x < reach ? -x : -reach; u <= reach && x + u < nx; u++)
                        if (u * u + v * v <= reach * reach)
                            share[(size_t)y * nx + x] = fmax(
                                share[(size_t)y * nx + x], (double)seen.value[(size_t)(y + v) * nx + x + u]);
    }
    rx_coarse_free(&pixels);
    rx_coarse_free(&seen);
    return status;
}

/* S of network_sky.h. */
static rx_status make_share(const rx_cells *light, double sigma, int nthreads, rx_coarse *share,
                            rx_error *err)
{
    const size_t n = (size_t)light->nx * (size_t)light->ny;
    rx_cells c = {.side = CELL, .nx = light->nx, .ny = light->ny};
    rx_status status = RX_OK;
    RX_TRY_EXIT(RX_MAKE(c.sum, n, err));
    RX_TRY_EXIT(RX_MAKE(c.weight, n, err));
    RX_TRY_EXIT(see(light, sigma, nthreads, c.sum, err));
    RX_TRY_EXIT(see(light, 2 * sigma, nthreads, c.sum, err));
    for (size_t k = 0; k < n; k++)
        c.weight[k] = 1;
    status = rx_cells_smooth(&c, sigma, 0, nthreads, share, NULL, err);
exit:
    rx_cells_free(&c);
    return status;
}

/* G of what the cells have, and of what that leaves of them. */
static rx_status smooth_twice(const rx_cells *residual, double sigma, int nthreads, rx_coarse *dst,
                              rx_error *err)
{
    const size_t n = (size_t)residual->nx * (size_t)residual->ny;
    rx_cells left = *residual;
    rx_coarse more = {0};
    rx_status status;
    RX_TRY(RX_MAKE(left.sum, n, err));
    RX_TRY_EXIT(rx_cells_smooth(residual, sigma, 0, nthreads, dst, NULL, err));
    for (size_t k = 0; k < n; k++)
        left.sum[k] = residual->sum[k] - residual->weight[k] * (double)dst->value[k];
    RX_TRY_EXIT(rx_cells_smooth(&left, sigma, 0, nthreads, &more, NULL, err));
    for (size_t k = 0; k < n; k++)
        dst->value[k] += more.value[k];
exit:
    rx_coarse_free(&more);
    free(left.sum);
    return status;
}

/* L of the cells: near becomes wide + share (near - wide). */
static rx_status make_sky(const rx_cells *residual, const rx_cells *light, double sigma, int nthreads,
                          rx_coarse *near, rx_error *err)
{
    /* the means of cells are as wide as a box, and the lines between their centres as a hat */
    const double rest = sqrt(fmax(1, sigma * sigma - CELL * CELL / 4.0));
    rx_coarse wide = {0}, share = {0};
    rx_status status = smooth_twice(residual, rest, nthreads, near, err);
    if (status == RX_OK)
        status = rx_cells_smooth(residual, WIDE * sigma, 0, nthreads, &wide, NULL, err);
    if (status == RX_OK)
        status = make_share(light, sigma, nthreads, &share, err);
    for (size_t k = 0; k < (size_t)near->nx * (size_t)near->ny && status == RX_OK; k++)
        near->value[k] = wide.value[k] + share.value[k] * (near->value[k] - wide.value[k]);
    rx_coarse_free(&share);
    rx_coarse_free(&wide);
    return status;
}

rx_status rx_network_sky(const rx_network_input *input, const float *m, double fwhm, int nthreads,
                         rx_coarse *dst, rx_error *err)
{
    const size_t room = (2 + 3 * CELL) * (size_t)input->image->width;
    const frame f = frame_of(input, m, ERROR);
    rx_cells residual = {0}, light = {0};
    float *rows = NULL;
    *dst = (rx_coarse){0};
    rx_status status = RX_OK;
    RX_TRY_EXIT(RX_MAKE(rows, room * (size_t)nthreads, err));
    RX_TRY_EXIT(rx_cells_new(input->image->width, input->image->height, CELL, &residual, err));
    RX_TRY_EXIT(rx_cells_new(input->image->width, input->image->height, CELL, &light, err));
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int cy = 0; cy < residual.ny; cy++)
        add_cells(&f, cy, &residual, &light, rows + room * (size_t)omp_get_thread_num());
    status = make_sky(&residual, &light, fmax(LEAST_SIGMA, PER_FWHM * fwhm), nthreads, dst, err);
exit:
    rx_cells_free(&light);
    rx_cells_free(&residual);
    free(rows);
    return status;
}

RX_SIMD static void to_adu(int n, const float *restrict unit, const float *restrict sky, float *restrict v)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const double value = ((double)v[i] + (double)sky[i]) * (double)unit[i];
        v[i] = (float)value;
    }
    /* one choice in a loop, or it does not become vectors */
#pragma omp simd
    for (int i = 0; i < n; i++)
        v[i] = v[i] > FLT_MAX ? FLT_MAX : v[i];
#pragma omp simd
    for (int i = 0; i < n; i++)
        v[i] = v[i] < -FLT_MAX ? -FLT_MAX : v[i];
}

/* Sum and number of (r - L)^2 / variance of a row's good pixels. */
RX_SIMD static double row_chi2(int n, const uint8_t *restrict mask, const float *restrict r,
                               const float *restrict variance, const float *restrict sky, long *good)
{
    double sum = 0;
    int count = 0;
#pragma omp simd reduction(+ : sum, count)
    for (int i = 0; i < n; i++) {
        const double residual = (double)r[i] - (double)sky[i], used = mask[i] == 0 ? 1 : 0;
        sum += used * residual * residual / (double)variance[i];
        count += mask[i] == 0;
    }
    *good += count;
    return sum;
}

/* Where a row of the result goes. room: 5 rows of the tile. */
static double add_row(const frame *f, const rx_coarse *sky, int y, float *room, const rx_network_adu *dst,
                      long *good)
{
    float *pixels = dst->pixels, *reblurred = dst->reblurred;
    const int n = f->width;
    const size_t row = (size_t)y * (size_t)n;
    const uint8_t *mask = f->input->mask + row;
    float *unit = room, *r = room + 2 * (size_t)n, *variance = r + n, *low = variance + n;
    rx_coarse_row(sky, y, 0, n, low);
    read_row(f, y, unit, room + n, r, variance);
    to_adu(n, unit, low, pixels + row);
    for (int i = 0; i < n; i++)
        if ((mask[i] & ~RX_MASK_GAP) != 0)
            pixels[row + (size_t)i] = 0;
    if (reblurred != NULL) {
        if (reblurred != f->m)
            memcpy(reblurred + row, f->m + row, (size_t)n * sizeof *reblurred);
        to_adu(n, unit, low, reblurred + row);
    }
    return row_chi2(n, mask, r, variance, low, good);
}

rx_status rx_network_sky_add(const rx_network_input *input, const float *m, const rx_coarse *sky,
                             int nthreads, rx_network_adu *dst, rx_error *err)
{
    const int height = input->image->height;
    const size_t room = 5 * (size_t)input->image->width;
    const frame f = frame_of(input, m, 0);
    float *rows = RX_NEW(float, room *(size_t)nthreads);
    double *sums = RX_NEW(double, (size_t)height), sum = 0;
    long good = 0;
    if (rows == NULL || sums == NULL) {
        free(rows);
        free(sums);
        return rx_error_memory(err, room * (size_t)nthreads * sizeof *rows);
    }
#pragma omp parallel for schedule(static) num_threads(nthreads) reduction(+ : good)
    for (int y = 0; y < height; y++)
        sums[y] = add_row(&f, sky, y, rows + room * (size_t)omp_get_thread_num(), dst, &good);
    for (int y = 0; y < height; y++)
        sum += sums[y];
    dst->chi2 = good > 0 ? sum / (double)good : NAN;
    free(rows);
    free(sums);
    return RX_OK;
}
