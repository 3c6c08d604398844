/* Noise units and the filling of masked pixels. */
#include "restore/network_data.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/wide.h"
#include "data/map.h"
#include "num/convolve.h"

enum { CELL = 16, CELL_RADIUS = 6 };
static const double CELL_FWHM = 2 * 2.3548200450309493; /* of the smoothing, cells */
static const float LARGEST =
    1e7f; /* far above any signal-to-noise; single precision holds the sky beside it */
static const double NOISELESS = 1e-3; /* noise of a tile without any, share of its peak */
static const float FAR_WEIGHT = 0.01f;
static const double FILL_MIN = 4, FILL_MAX = 24; /* FWHM of the near fill, pixels */

/* Sums in cells. */
typedef struct cells {
    int nx, ny;
    double *sum, *count;
} cells;

static void cells_free(cells *c)
{
    free(c->sum);
    free(c->count);
}

static rx_status cells_new(int width, int height, cells *dst, rx_error *err)
{
    const int nx = (width + CELL - 1) / CELL, ny = (height + CELL - 1) / CELL;
    const size_t n = (size_t)nx * (size_t)ny;
    *dst = (cells){nx, ny, RX_NEW(double, n), RX_NEW(double, n)};
    return dst->sum == NULL || dst->count == NULL ? rx_error_memory(err, 2 * n * sizeof(double)) : RX_OK;
}

/* One direction of the Gaussian: n cells of a row, `step` numbers apart. */
static void smooth_line(int n, size_t step, const float *g, const double *src, double *dst)
{
    for (int i = 0; i < n; i++) {
        double sum = 0;
        for (int k = -CELL_RADIUS; k <= CELL_RADIUS; k++)
            if (i + k >= 0 && i + k < n)
                sum += (double)g[k + CELL_RADIUS] * src[(size_t)(i + k) * step];
        dst[(size_t)i * step] = sum;
    }
}

static void smooth_cells(const cells *c, int nthreads, double *plane, double *work)
{
    float g[2 * CELL_RADIUS + 1];
    rx_gauss_weights(CELL_FWHM, CELL_RADIUS, g);
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < c->ny; y++)
        smooth_line(c->nx, 1, g, plane + (size_t)y * c->nx, work + (size_t)y * c->nx);
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int x = 0; x < c->nx; x++)
        smooth_line(c->ny, (size_t)c->nx, g, work + x, plane + x);
}

/* Means of the cells, smoothed; `empty` where no cell with a good pixel is near. The cells' sums are used up.
 */
static rx_status coarse_means(cells *c, double empty, int nthreads, rx_coarse *dst, rx_error *err)
{
    const size_t n = (size_t)c->nx * (size_t)c->ny;
    double *work = RX_NEW(double, n);
    *dst = (rx_coarse){c->nx, c->ny, RX_NEW(float, n)};
    if (work == NULL || dst->value == NULL) {
        free(work);
        return rx_error_memory(err, n * sizeof *work);
    }
    smooth_cells(c, nthreads, c->sum, work);
    smooth_cells(c, nthreads, c->count, work);
    for (size_t k = 0; k < n; k++)
        dst->value[k] = (float)(c->count[k] > 0 ? c->sum[k] / c->count[k] : empty);
    free(work);
    return RX_OK;
}

void rx_coarse_free(rx_coarse *coarse)
{
    free(coarse->value);
    coarse->value = NULL;
}

/* Cell below position v (pixels), and the fraction beyond its centre; whole numbers, as floor() would be a
 * call. */
static int place(int v, int n, float *fraction)
{
    const int beyond = v - CELL / 2; /* and half a pixel more, of the first cell's centre */
    *fraction = 0;
    if (beyond < 0 || n < 2)
        return 0;
    if (beyond / CELL > n - 2) {
        *fraction = 1;
        return n - 2;
    }
    *fraction = ((float)(beyond % CELL) + 0.5f) / CELL;
    return beyond / CELL;
}

/* dst[n]: pixels x .. x + n - 1 of a row, between cells i and `next` of the rows low and high, the fraction
 * fy beyond the centres of the low one. */
static inline void coarse_span(const float *low, const float *high, int i, int next, float fy, int x, int n,
                               float *restrict dst)
{
    const float a0 = low[i], a1 = low[next] - low[i], b0 = high[i], b1 = high[next] - high[i];
    for (int k = 0; k < n; k++) {
        const float u = ((float)(x + k) + 0.5f) / CELL - 0.5f - (float)i;
        const float fx = u < 0 ? 0 : u > 1 ? 1 : u;
        const float a = a0 + fx * a1, b = b0 + fx * b1;
        dst[k] = a + fy * (b - a);
    }
}

/* The same of the pixels from the centre of cell i to that of the next one. */
static inline void coarse_cell(const float *low, const float *high, int i, float fy, float *restrict dst)
{
    const float a0 = low[i], a1 = low[i + 1] - low[i], b0 = high[i], b1 = high[i + 1] - high[i];
#pragma omp simd
    for (int k = 0; k < CELL; k++) {
        const float fx = ((float)k + 0.5f) / CELL;
        const float a = a0 + fx * a1, b = b0 + fx * b1;
        dst[k] = a + fy * (b - a);
    }
}

/* The row between the cells' rows low and high. */
RX_WIDE static void coarse_row(const float *low, const float *high, int nx, float fy, int x, int n,
                               float *dst)
{
    float fx = 0;
    for (int k = 0; k < n;) {
        const int i = place(x + k, nx, &fx), next = nx > 1 ? i + 1 : i, centre = CELL * i + CELL / 2;
        const int end = i < nx - 2 ? centre + CELL - x : n; /* up to the centre of the next cell */
        const int count = (end < n ? end : n) - k;
        if (count == CELL && x + k == centre && nx > 1)
            coarse_cell(low, high, i, fy, dst + k);
        else
            coarse_span(low, high, i, next, fy, x + k, count, dst + k);
        k += count;
    }
}

void rx_coarse_row(const rx_coarse *coarse, int y, int x, int n, float *dst)
{
    float fy = 0;
    const int j = place(y, coarse->ny, &fy);
    const float *low = coarse->value + (size_t)j * coarse->nx;
    coarse_row(low, coarse->ny > 1 ? low + coarse->nx : low, coarse->nx, fy, x, n, dst);
}

static int usable(float sigma)
{
    return isfinite(sigma) && sigma > 0;
}

/* Stands in for the noise of a tile without any. */
static double noiseless(const rx_tile *tile, const rx_background *background, const uint8_t *mask)
{
    const rx_map level = rx_background_level(background);
    double peak = 0;
    for (int y = 0; y < tile->height; y++)
        for (int x = 0; x < tile->width; x++) {
            const size_t k = (size_t)y * (size_t)tile->width + (size_t)x;
            if (mask[k] == 0)
                peak = fmax(peak, fabs((double)tile->pixels[k] - rx_map_at(&level, x, y)));
        }
    return peak > 0 ? NOISELESS * peak : 1;
}

/* Logarithms of the noise of n pixels, part of a row of a cell. */
static void add_logs(const float *sigma, const uint8_t *mask, int n, cells *c, size_t cell)
{
    /* the logarithm of a product is the sum of logarithms; four floats multiply without leaving a double */
    enum { AT_ONCE = 4 };
    double product = 1;
    int count = 0;
    for (int i = 0; i < n; i++) {
        if (mask[i] == 0 && usable(sigma[i])) {
            product *= (double)sigma[i];
            count++;
        }
        if (i % AT_ONCE == AT_ONCE - 1 || i == n - 1) {
            c->sum[cell] += log(product);
            product = 1;
        }
    }
    c->count[cell] += count;
}

/* The same of a row of the tile; rows come in their order. */
static void add_row(const rx_map *noise, const uint8_t *mask, int width, int y, cells *c)
{
    enum { PIECE = 64 * CELL };
    float room[PIECE];
    const size_t row = (size_t)(y / CELL) * (size_t)c->nx;
    for (int x = 0; x < width; x += PIECE) {
        const int end = width - x < PIECE ? width : x + PIECE;
        const float *sigma = rx_map_row(noise, y, x, end - x, room);
        for (int at = x; at < end; at += CELL)
            add_logs(sigma + (at - x), mask + (size_t)y * (size_t)width + (size_t)at,
                     end - at < CELL ? end - at : CELL, c, row + (size_t)(at / CELL));
    }
}

rx_status rx_network_scale(const rx_tile *tile, const rx_background *background, const uint8_t *mask,
                           int nthreads, rx_coarse *dst, rx_error *err)
{
    cells c = {0};
    const rx_map noise = rx_background_noise(background);
    double sum = 0, count = 0;
    *dst = (rx_coarse){0};
    rx_status status = cells_new(tile->width, tile->height, &c, err);
    if (status != RX_OK)
        goto exit;
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int cy = 0; cy < c.ny; cy++)
        for (int y = cy * CELL; y < (cy + 1) * CELL && y < tile->height; y++)
            add_row(&noise, mask, tile->width, y, &c);
    for (size_t k = 0; k < (size_t)c.nx * (size_t)c.ny; k++) {
        sum += c.sum[k];
        count += c.count[k];
    }
    const double mean = count > 0 ? sum / count : log(noiseless(tile, background, mask));
    status = coarse_means(&c, mean, nthreads, dst, err);
    for (size_t k = 0; k < (size_t)c.nx * (size_t)c.ny && status == RX_OK; k++)
        dst->value[k] = expf(dst->value[k]);
exit:
    cells_free(&c);
    return status;
}

RX_WIDE static void to_units(int n, const float *restrict pixels, const float *restrict level,
                             const float *restrict unit, const uint8_t *restrict mask, float *restrict x)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float value = (pixels[i] - level[i]) / unit[i];
        const float low = value > -LARGEST ? value : -LARGEST, cut = low < LARGEST ? low : LARGEST;
        x[i] = mask[i] != 0 ? 0 : cut;
    }
}

/* Good pixels in noise units, and their sums in cells; one row of cells. rows[2][width]: scratch. */
static void set_rows(const rx_tile *tile, const rx_map *level, const uint8_t *mask, const rx_coarse *scale,
                     int cy, cells *c, float *rows, float *x)
{
    const int width = tile->width;
    float *unit = rows, *room = rows + width;
    for (int y = cy * CELL; y < (cy + 1) * CELL && y < tile->height; y++) {
        rx_coarse_row(scale, y, 0, width, unit);
        const size_t row = (size_t)y * width;
        to_units(width, tile->pixels + row, rx_map_row(level, y, 0, width, room), unit, mask + row, x + row);
        for (int cx = 0; cx < c->nx; cx++) {
            const int end = (cx + 1) * CELL < width ? (cx + 1) * CELL : width;
            double sum = c->sum[(size_t)cy * c->nx + cx], count = 0;
            for (int i = cx * CELL; i < end; i++) {
                sum += x[row + (size_t)i];
                count += mask[row + (size_t)i] == 0;
            }
            c->sum[(size_t)cy * c->nx + cx] = sum;
            c->count[(size_t)cy * c->nx + cx] += count;
        }
    }
}

/* What the filling of a block works with; planes of (block + 2 radius)^2 pixels per thread. */
typedef struct filler {
    const uint8_t *mask;
    const rx_coarse *far;
    const rx_blocks *blocks;
    int width, height, radius;
    float *g, *x;       /* [2 radius + 1]; the tile's plane */
    size_t area;        /* of a plane of `work`: data, good, scratch */
    float *work, *rows; /* [nthreads][3][area], [nthreads][block width] */
} filler;

/* plane[h][w] in place: Gaussian sums, right at radius and more from its border; each pixel's terms in one
 * order, so that nothing depends on the block. */
static void smooth_block(const filler *f, int w, int h, float *plane, float *scratch)
{
    const int r = f->radius;
    for (int y = 0; y < h; y++) {
        const float *src = plane + (size_t)y * w;
        float *dst = scratch + (size_t)y * w;
        for (int x = 0; x < w; x++)
            dst[x] = 0;
        for (int k = -r; k <= r; k++)
#pragma omp simd
            for (int x = r; x < w - r; x++)
                dst[x] += f->g[k + r] * src[x + k];
    }
    for (int y = r; y < h - r; y++) {
        float *dst = plane + (size_t)y * w;
        for (int x = 0; x < w; x++)
            dst[x] = 0;
        for (int k = -r; k <= r; k++) {
            const float *src = scratch + (size_t)(y + k) * w;
#pragma omp simd
            for (int x = 0; x < w; x++)
                dst[x] += f->g[k + r] * src[x];
        }
    }
}

static int any_masked(const filler *f, int x0, int y0, int x1, int y1)
{
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++)
            if (f->mask[(size_t)y * f->width + x] != 0)
                return 1;
    return 0;
}

static rx_status fill_block(void *user, int thread, int bx, int by, rx_error *err)
{
    filler *f = user;
    const int r = f->radius, w = f->blocks->width + 2 * r, h = f->blocks->height + 2 * r;
    const int x0 = bx < 0 ? 0 : bx, y0 = by < 0 ? 0 : by;
    const int x1 = bx + f->blocks->width < f->width ? bx + f->blocks->width : f->width;
    const int y1 = by + f->blocks->height < f->height ? by + f->blocks->height : f->height;
    float *data = f->work + (size_t)thread * 3 * f->area, *good = data + f->area, *scratch = good + f->area;
    float *far = f->rows + (size_t)thread * f->blocks->width;
    (void)err;
    if (!any_masked(f, x0, y0, x1, y1))
        return RX_OK;
    rx_blocks_good(f->mask, f->width, f->height, bx - r, by - r, w, h, w, good);
    /* masked pixels of the plane may be written by other threads meanwhile: they are never read */
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            const size_t k = (size_t)y * w + x;
            data[k] = good[k] > 0 ? f->x[(size_t)(by - r + y) * f->width + (bx - r + x)] : 0;
        }
    smooth_block(f, w, h, data, scratch);
    smooth_block(f, w, h, good, scratch);
    for (int y = y0; y < y1; y++) {
        rx_coarse_row(f->far, y, x0, x1 - x0, far);
        for (int x = x0; x < x1; x++) {
            const size_t k = (size_t)y * f->width + x, b = (size_t)(y - by + r) * w + (x - bx + r);
            if (f->mask[k] != 0)
                f->x[k] = (data[b] + FAR_WEIGHT * far[x - x0]) / (good[b] + FAR_WEIGHT);
        }
    }
    return RX_OK;
}

static rx_status fill(filler *f, double psf_fwhm, int nthreads, rx_error *err)
{
    const double fwhm = fmin(fmax(2 * psf_fwhm, FILL_MIN), FILL_MAX);
    rx_status status = RX_OK;
    f->radius = (int)ceil(3 * fwhm / 2.3548200450309493);
    f->area = (size_t)(f->blocks->width + 2 * f->radius) * (size_t)(f->blocks->height + 2 * f->radius);
    f->area = (f->area + 15) / 16 * 16;
    f->g = RX_NEW(float, 2 * (size_t)f->radius + 1);
    f->work = RX_NEW(float, 3 * f->area * (size_t)nthreads);
    f->rows = RX_NEW(float, (size_t)f->blocks->width *(size_t)nthreads);
    if (f->g == NULL || f->work == NULL || f->rows == NULL) {
        status = rx_error_memory(err, 3 * f->area * (size_t)nthreads * sizeof(float));
        goto exit;
    }
    rx_gauss_weights(fwhm, f->radius, f->g);
    status = rx_blocks_run(f->blocks, nthreads, fill_block, f, NULL, 0, 0, err);
exit:
    free(f->g);
    free(f->work);
    free(f->rows);
    return status;
}

rx_status rx_network_data(const rx_tile *tile, const rx_background *background, const uint8_t *mask,
                          const rx_coarse *scale, double psf_fwhm, const rx_blocks *blocks, int nthreads,
                          float *x, rx_error *err)
{
    cells c = {0};
    rx_coarse far = {0};
    rx_status status = cells_new(tile->width, tile->height, &c, err);
    const rx_map level = rx_background_level(background);
    float *rows = RX_NEW(float, 2 * (size_t)tile->width * (size_t)nthreads);
    if (status == RX_OK && rows == NULL)
        status = rx_error_memory(err, 2 * (size_t)tile->width * (size_t)nthreads * sizeof *rows);
    if (status != RX_OK)
        goto exit;
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int cy = 0; cy < c.ny; cy++)
        set_rows(tile, &level, mask, scale, cy, &c,
                 rows + 2 * (size_t)omp_get_thread_num() * (size_t)tile->width, x);
    status = coarse_means(&c, 0, nthreads, &far, err);
    if (status == RX_OK) {
        filler f = {.mask = mask,
                    .far = &far,
                    .blocks = blocks,
                    .width = tile->width,
                    .height = tile->height,
                    .x = x};
        status = fill(&f, psf_fwhm, rx_blocks_threads(blocks, nthreads), err);
    }
exit:
    rx_coarse_free(&far);
    cells_free(&c);
    free(rows);
    return status;
}
