/* Sums in cells, and maps from them. */
#include "restore/network_coarse.h"

#include <math.h>
#include <stdlib.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/simd.h"
#include "num/convolve.h"

enum { MOST_RADIUS = 48 }; /* of the Gaussian, cells */

void rx_cells_free(rx_cells *c)
{
    free(c->sum);
    free(c->weight);
}

rx_status rx_cells_new(int width, int height, int side, rx_cells *dst, rx_error *err)
{
    const int nx = (width + side - 1) / side, ny = (height + side - 1) / side;
    const size_t n = (size_t)nx * (size_t)ny;
    *dst = (rx_cells){side, nx, ny, RX_NEW(double, n), RX_NEW(double, n)};
    return dst->sum == NULL || dst->weight == NULL ? rx_error_memory(err, 2 * n * sizeof(double)) : RX_OK;
}

/* A Gaussian on cells. */
typedef struct gauss {
    int radius;
    float weight[2 * MOST_RADIUS + 1];
} gauss;

/* One direction: n cells of a row, `step` numbers apart. */
static void smooth_line(int n, size_t step, const gauss *g, const double *src, double *dst)
{
    for (int i = 0; i < n; i++) {
        double sum = 0;
        for (int k = -g->radius; k <= g->radius; k++)
            if (i + k >= 0 && i + k < n)
                sum += (double)g->weight[k + g->radius] * src[(size_t)(i + k) * step];
        dst[(size_t)i * step] = sum;
    }
}

static void smooth_cells(const rx_cells *c, const gauss *g, int nthreads, const double *src, double *work,
                         double *dst)
{
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < c->ny; y++)
        smooth_line(c->nx, 1, g, src + (size_t)y * c->nx, work + (size_t)y * c->nx);
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int x = 0; x < c->nx; x++)
        smooth_line(c->ny, (size_t)c->nx, g, work + x, dst + x);
}

static rx_status new_coarse(const rx_cells *c, rx_coarse *dst, rx_error *err)
{
    const size_t n = (size_t)c->nx * (size_t)c->ny;
    *dst = (rx_coarse){c->side, c->nx, c->ny, RX_NEW(float, n)};
    return dst->value == NULL ? rx_error_memory(err, n * sizeof(float)) : RX_OK;
}

rx_status rx_cells_smooth(const rx_cells *c, double sigma, double empty, int nthreads, rx_coarse *dst,
                          rx_coarse *weight, rx_error *err)
{
    const size_t n = (size_t)c->nx * (size_t)c->ny;
    const double cells = sigma / c->side, radius = ceil(3 * cells);
    gauss g = {.radius = radius < MOST_RADIUS ? (int)radius : MOST_RADIUS};
    double *room = RX_NEW(double, 3 * n), *sums = room + n, *weights = sums + n;
    rx_status status = room == NULL ? rx_error_memory(err, 3 * n * sizeof *room) : new_coarse(c, dst, err);
    if (status == RX_OK && weight != NULL)
        status = new_coarse(c, weight, err);
    if (status == RX_OK) {
        rx_gauss_weights(cells * RX_FWHM_SIGMA, g.radius, g.weight);
        smooth_cells(c, &g, nthreads, c->sum, room, sums);
        smooth_cells(c, &g, nthreads, c->weight, room, weights);
        for (size_t k = 0; k < n; k++)
            dst->value[k] = (float)(weights[k] > 0 ? sums[k] / weights[k] : empty);
        for (size_t k = 0; k < n && weight != NULL; k++)
            weight->value[k] = (float)weights[k];
    }
    free(room);
    return status;
}

void rx_coarse_free(rx_coarse *coarse)
{
    free(coarse->value);
    coarse->value = NULL;
}

/* Cell below position v (pixels), and the fraction beyond its centre; whole numbers, as floor() would be a
 * call. */
static int place(int v, int cell, int n, float *fraction)
{
    const int beyond = v - cell / 2; /* and half a pixel more, of the first cell's centre */
    *fraction = 0;
    if (beyond < 0 || n < 2)
        return 0;
    if (beyond / cell > n - 2) {
        *fraction = 1;
        return n - 2;
    }
    *fraction = ((float)(beyond % cell) + 0.5f) / (float)cell;
    return beyond / cell;
}

/* Pixels from the centre of cell i to that of the next one, between cells of the rows low and high, the
 * fraction fy beyond the centres of the low one. */
static inline void coarse_cell(const float *low, const float *high, int i, int cell, float fy,
                               float *restrict dst)
{
    const float a0 = low[i], a1 = low[i + 1] - low[i], b0 = high[i], b1 = high[i + 1] - high[i];
#pragma omp simd
    for (int k = 0; k < cell; k++) {
        const float fx = ((float)k + 0.5f) / (float)cell;
        const float a = a0 + fx * a1, b = b0 + fx * b1;
        dst[k] = a + fy * (b - a);
    }
}

/* The row between the cells' rows low and high. */
RX_SIMD static void coarse_row(const rx_coarse *coarse, int row, float fy, int x, int n, float *dst)
{
    const int nx = coarse->nx, cell = coarse->cell;
    const float *low = coarse->value + (size_t)row * (size_t)nx, *high = coarse->ny > 1 ? low + nx : low;
    float fx = 0;
    for (int k = 0; k < n;) {
        const int i = place(x + k, cell, nx, &fx), next = nx > 1 ? i + 1 : i, centre = cell * i + cell / 2;
        const int end = i < nx - 2 ? centre + cell - x : n; /* up to the centre of the next cell */
        const int count = (end < n ? end : n) - k;
        if (count == cell && x + k == centre && nx > 1) {
            coarse_cell(low, high, i, cell, fy, dst + k);
            k += count;
            continue;
        }
        const float a0 = low[i], a1 = low[next] - low[i], b0 = high[i], b1 = high[next] - high[i];
        for (const int last = k + count; k < last; k++) {
            const float u = ((float)(x + k) + 0.5f) / (float)cell - 0.5f - (float)i;
            const float along = u < 0 ? 0 : u > 1 ? 1 : u;
            const float a = a0 + along * a1, b = b0 + along * b1;
            dst[k] = a + fy * (b - a);
        }
    }
}

void rx_coarse_row(const rx_coarse *coarse, int y, int x, int n, float *dst)
{
    float fy = 0;
    const int j = place(y, coarse->cell, coarse->ny, &fy);
    coarse_row(coarse, j, fy, x, n, dst);
}
