/* Cells of the residual. */
#include "pipeline/residual.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"

enum { CELL = RX_RESIDUAL_CELL, HALF = CELL / 2 };

static const double CHI2 = 2.0, MEAN = 0.3; /* more is not explained; sigmas of a pixel */
static const double BRIGHT =
    100.0; /* sigmas of the model, and half of them of the pixels, where its PSF is never right */
static const double ENOUGH = 0.25; /* of a cell's pixels */
static const double LARGE = 0.1;   /* share of cells */
static const double DARK = 0.02;   /* share of boxes */

typedef struct sums {
    long faint;
    double mean, squares; /* of d */
    double sky[4];        /* of the pixels over sigma, by quarter of the cell */
    long pixels[4];
} sums;

/* A row of a cell: what is known of its pixels, */
typedef struct seen {
    const float *pixels, *level, *sigma, *model;
    const uint8_t *mask;
} seen;

/* and those that count, their value above the sky over its noise, and, where the model is not bright, d. */
typedef struct line {
    float counts[CELL], faint[CELL], height[CELL], d[CELL];
} line;

RX_SIMD static void fill_line(int n, const seen *of, float photon, line *restrict dst)
{
    const float *pixels = of->pixels, *level = of->level, *sigma = of->sigma, *model = of->model;
    const uint8_t *mask = of->mask;
    const float bright = (float)BRIGHT;
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float counts = (mask[i] == 0) & (sigma[i] > 0.0f) ? 1.0f : 0.0f,
                    s = counts > 0.0f ? sigma[i] : 1.0f;
        const float value = pixels[i] - level[i], light = model[i] > 0.0f ? model[i] : 0.0f;
        const float faint = (model[i] > bright * s) & (value > 0.5f * bright * s) ? 0.0f : counts;
        dst->counts[i] = counts;
        dst->faint[i] = faint;
        dst->height[i] = counts > 0.0f ? value / s : 0.0f;
        /* no square of a sigma, which may be 1e-30 */
        dst->d[i] = faint > 0.0f ? (value - model[i]) / s / sqrtf(1.0f + photon * (light / s) / s) : 0.0f;
    }
}

/* A line of at most a quarter's width. */
RX_SIMD static void add_line(int n, const line *row, int from, int quarter, sums *dst)
{
    double height = 0.0, mean = 0.0, squares = 0.0;
    float counts = 0.0f, faint = 0.0f;
#pragma omp simd reduction(+ : height, mean, squares, counts, faint)
    for (int i = from; i < from + n; i++) {
        const double d = (double)row->d[i];
        height += (double)row->height[i];
        mean += d;
        squares += d * d;
        counts += row->counts[i];
        faint += row->faint[i];
    }
    dst->sky[quarter] += height;
    dst->pixels[quarter] += (long)counts;
    dst->faint += (long)faint;
    dst->mean += mean;
    dst->squares += squares;
}

static void sum_cell(const rx_image *image, const rx_restored *restored, int cx, int cy, sums *dst)
{
    const rx_map sky = rx_image_sky(image);
    const int x0 = cx * CELL, y0 = cy * CELL, n = rx_min_int(CELL, image->width - x0),
              rows = rx_min_int(CELL, image->height - y0);
    const float photon = image->gain > 0.0 ? (float)(1.0 / image->gain) : 0.0f;
    *dst = (sums){0};
    for (int y = y0; y < y0 + rows; y++) {
        float level_room[CELL], sigma_room[CELL];
        const size_t k = (size_t)y * (size_t)image->width + (size_t)x0;
        line row;
        const seen of = {image->pixels + k, rx_map_row(&sky, y, x0, n, level_room),
                         rx_map_row(&image->noise, y, x0, n, sigma_room), restored->reblurred + k,
                         restored->mask + k};
        fill_line(n, &of, photon, &row);
        for (int half = 0; half < 2 && half * HALF < n; half++)
            add_line(rx_min_int(HALF, n - half * HALF), &row, half * HALF, (y - y0) / HALF * 2 + half, dst);
    }
}

rx_status rx_residual_flag(const rx_image *image, const rx_restored *restored, int nthreads, rx_residual *dst,
                           rx_error *err)
{
    const int nx = (image->width + CELL - 1) / CELL, ny = (image->height + CELL - 1) / CELL, n = nx * ny;
    long boxes = 0, dark = 0;
    *dst = (rx_residual){.nx = nx, .ny = ny, .share = NAN, .dark = NAN};
    sums *all = RX_NEW(sums, (size_t)n);
    dst->cell = RX_NEW(unsigned char, (size_t)n);
    if (all == NULL || dst->cell == NULL) {
        free(all);
        rx_residual_free(dst);
        return rx_error_memory(err, (size_t)n * sizeof *all);
    }
#pragma omp parallel for schedule(dynamic) num_threads(nthreads > 0 ? nthreads : 1)
    for (int k = 0; k < n; k++)
        sum_cell(image, restored, k % nx, k / nx, &all[k]);
    for (int k = 0; k < n; k++) {
        const sums *s = &all[k];
        for (int q = 0; q < 4; q++)
            if ((double)s->pixels[q] >= ENOUGH * HALF * HALF) {
                boxes++;
                const int below = s->sky[q] < -MEAN * (double)s->pixels[q];
                dst->cell[k] |= (unsigned char)(below << (q + 1));
                dark += below;
            }
        if ((double)s->faint < ENOUGH * CELL * CELL)
            continue;
        const double count = (double)s->faint;
        const int unexplained = s->squares > CHI2 * count || fabs(s->mean) > MEAN * count;
        dst->cell[k] |= (unsigned char)unexplained;
        dst->cells++;
        dst->unexplained += unexplained;
    }
    if (dst->cells > 0)
        dst->share = (double)dst->unexplained / (double)dst->cells;
    if (boxes > 0)
        dst->dark = (double)dark / (double)boxes;
    free(all);
    return RX_OK;
}

void rx_residual_free(rx_residual *residual)
{
    free(residual->cell);
    *residual = (rx_residual){0};
}

/* Bit `shift` of the pixel's cell, or with -1 that of its quarter. */
static int bit_at(const rx_residual *residual, double x, double y, int shift)
{
    const int px = (int)floor(x + 0.5), py = (int)floor(y + 0.5), cx = px / CELL, cy = py / CELL;
    if (residual->cell == NULL || px < 0 || py < 0 || cx >= residual->nx || cy >= residual->ny)
        return 0;
    if (shift < 0)
        shift = 1 + py % CELL / HALF * 2 + px % CELL / HALF;
    return residual->cell[(size_t)cy * (size_t)residual->nx + (size_t)cx] >> shift & 1;
}

int rx_residual_at(const rx_residual *residual, double x, double y)
{
    return bit_at(residual, x, y, 0);
}

int rx_residual_dark_at(const rx_residual *residual, double x, double y)
{
    return bit_at(residual, x, y, -1);
}

int rx_residual_is_large(double share)
{
    return share > LARGE;
}

int rx_residual_is_dark(double dark)
{
    return dark > DARK;
}
