/* Noise units and the filling of masked pixels. */
#include "restore/network_data.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/simd.h"
#include "data/gaps.h"
#include "data/map.h"
#include "num/convolve.h"
#include "restore/prepared.h"

enum { CELL = 16 };
static const double SMOOTHING = 32; /* sigma, pixels */
static const float FAR_WEIGHT = 0.01f;
static const double FILL_MIN = 4, FILL_MAX = 24; /* FWHM of the near fill, pixels */

static int usable(float sigma)
{
    return isfinite(sigma) && sigma > 0;
}

/* Logarithms of the noise of n pixels, part of a row of a cell. */
static void add_logs(const float *sigma, const uint8_t *mask, int n, rx_cells *c, size_t cell)
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
    c->weight[cell] += count;
}

/* The same of a row of the tile; rows come in their order. */
static void add_row(const rx_map *noise, const uint8_t *mask, int width, int y, rx_cells *c)
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

rx_status rx_network_scale(const rx_image *image, const uint8_t *mask, int nthreads, rx_coarse *dst,
                           rx_error *err)
{
    rx_cells c = {0};
    double sum = 0, count = 0;
    *dst = (rx_coarse){0};
    rx_status status;
    RX_TRY_EXIT(rx_cells_new(image->width, image->height, CELL, &c, err));
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int cy = 0; cy < c.ny; cy++)
        for (int y = cy * CELL; y < (cy + 1) * CELL && y < image->height; y++)
            add_row(&image->noise, mask, image->width, y, &c);
    for (size_t k = 0; k < (size_t)c.nx * (size_t)c.ny; k++) {
        sum += c.sum[k];
        count += c.weight[k];
    }
    const double mean = count > 0 ? sum / count : log(rx_prepared_noiseless(image, mask));
    status = rx_cells_smooth(&c, SMOOTHING, mean, nthreads, dst, NULL, err);
    for (size_t k = 0; k < (size_t)c.nx * (size_t)c.ny && status == RX_OK; k++)
        dst->value[k] = expf(dst->value[k]);
exit:
    rx_cells_free(&c);
    return status;
}

RX_SIMD static void to_units(int n, const float *restrict pixels, const float *restrict level,
                             const float *restrict unit, const uint8_t *restrict mask, float *restrict x)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float value = (pixels[i] - level[i]) / unit[i];
        const float low = value > -RX_PREPARED_LARGEST ? value : -RX_PREPARED_LARGEST,
                    cut = low < RX_PREPARED_LARGEST ? low : RX_PREPARED_LARGEST;
        x[i] = mask[i] != 0 ? 0 : cut;
    }
}

void rx_network_data_row(const rx_network_input *input, const rx_map *level, int y, float *unit, float *room,
                         float *x)
{
    const rx_image *image = input->image;
    const size_t row = (size_t)y * (size_t)image->width;
    rx_coarse_row(&input->scale, y, 0, image->width, unit);
    to_units(image->width, image->pixels + row, rx_map_row(level, y, 0, image->width, room), unit,
             input->mask + row, x);
}

/* Good pixels in noise units, and their sums in cells; one row of cells. rows[2][width]: scratch. */
static void set_rows(const rx_network_input *input, const rx_map *level, int cy, rx_cells *c, float *rows)
{
    const uint8_t *mask = input->mask;
    const int width = input->image->width;
    float *x = input->x;
    for (int y = cy * CELL; y < (cy + 1) * CELL && y < input->image->height; y++) {
        const size_t row = (size_t)y * (size_t)width;
        rx_network_data_row(input, level, y, rows, rows + width, x + row);
        for (int cx = 0; cx < c->nx; cx++) {
            const int end = (cx + 1) * CELL < width ? (cx + 1) * CELL : width;
            double sum = c->sum[(size_t)cy * c->nx + cx], count = 0;
            for (int i = cx * CELL; i < end; i++) {
                sum += x[row + (size_t)i];
                count += mask[row + (size_t)i] == 0;
            }
            c->sum[(size_t)cy * c->nx + cx] = sum;
            c->weight[(size_t)cy * c->nx + cx] += count;
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
    rx_blocks_good(f->mask, f->width, f->height, &(rx_blocks_window){bx - r, by - r, w, h, w}, good);
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
    f->radius = (int)ceil(3 * fwhm / RX_FWHM_SIGMA);
    f->area = (size_t)(f->blocks->width + 2 * f->radius) * (size_t)(f->blocks->height + 2 * f->radius);
    f->area = (f->area + 15) / 16 * 16;
    RX_TRY_EXIT(RX_MAKE(f->g, 2 * (size_t)f->radius + 1, err));
    RX_TRY_EXIT(RX_MAKE(f->work, 3 * f->area * (size_t)nthreads, err));
    RX_TRY_EXIT(RX_MAKE(f->rows, (size_t)f->blocks->width * (size_t)nthreads, err));
    rx_gauss_weights(fwhm, f->radius, f->g);
    status = rx_blocks_run(f->blocks, nthreads, fill_block, f, NULL, err);
exit:
    free(f->g);
    free(f->work);
    free(f->rows);
    return status;
}

rx_status rx_network_data(const rx_network_input *input, double psf_fwhm, const rx_blocks *blocks,
                          int nthreads, rx_error *err)
{
    const rx_image *image = input->image;
    rx_cells c = {0};
    rx_coarse far = {0};
    rx_status status = rx_cells_new(image->width, image->height, CELL, &c, err);
    const rx_map level = rx_image_sky(image);
    float *rows = RX_NEW(float, 2 * (size_t)image->width * (size_t)nthreads);
    if (status == RX_OK && rows == NULL)
        status = rx_error_memory(err, 2 * (size_t)image->width * (size_t)nthreads * sizeof *rows);
    if (status != RX_OK)
        goto exit;
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int cy = 0; cy < c.ny; cy++)
        set_rows(input, &level, cy, &c, rows + 2 * (size_t)omp_get_thread_num() * (size_t)image->width);
    RX_TRY_EXIT(rx_cells_smooth(&c, SMOOTHING, 0, nthreads, &far, NULL, err));
    filler f = {.mask = input->mask,
                .far = &far,
                .blocks = blocks,
                .width = image->width,
                .height = image->height,
                .x = input->x};
    status = fill(&f, psf_fwhm, rx_blocks_threads(blocks, nthreads), err);
    if (status == RX_OK)
        rx_gaps_fill(input->gaps, input->x);
exit:
    rx_coarse_free(&far);
    rx_cells_free(&c);
    free(rows);
    return status;
}
