/* Cells of the residual. */
#include "pipeline/residual.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"

enum { CELL = RX_RESIDUAL_CELL, HALF = CELL / 2 };

static const double CHI2 = 2.0, MEAN = 0.3; /* more is not explained; sigmas of a pixel */
static const double BRIGHT = 100.0;         /* sigmas of the model, where its PSF is never right */
static const double ENOUGH = 0.25;          /* of a cell's pixels */
static const double LARGE = 0.1;            /* share of cells */
static const double DARK = 0.02;            /* share of boxes */

typedef struct sums {
    long used, faint;
    double mean, squares; /* of d */
    double sky[4];        /* of the pixels over sigma, by quarter of the cell */
    long pixels[4];
} sums;

static void sum_cell(const rx_image *image, const rx_restored *restored, int cx, int cy, sums *dst)
{
    const rx_map sky = rx_image_sky(image);
    const int x0 = cx * CELL, y0 = cy * CELL, n = rx_min_int(CELL, image->width - x0),
              rows = rx_min_int(CELL, image->height - y0);
    *dst = (sums){0};
    for (int y = y0; y < y0 + rows; y++) {
        float level_room[CELL], sigma_room[CELL];
        const size_t k = (size_t)y * (size_t)image->width + (size_t)x0;
        const float *sigma = rx_map_row(&image->noise, y, x0, n, sigma_room);
        const float *level = rx_map_given(&sky) ? rx_map_row(&sky, y, x0, n, level_room) : NULL;
        for (int i = 0; i < n; i++) {
            if (restored->mask[k + (size_t)i] != 0 || !(sigma[i] > 0.0f))
                continue;
            const double s = (double)sigma[i], model = (double)restored->reblurred[k + (size_t)i],
                         value =
                             (double)image->pixels[k + (size_t)i] - (level != NULL ? (double)level[i] : 0.0);
            const double photons = image->gain > 0.0 ? fmax(model, 0.0) / image->gain : 0.0;
            const double d = (value - model) / sqrt(s * s + photons);
            const int quarter = (y - y0) / HALF * 2 + i / HALF;
            dst->sky[quarter] += value / s;
            dst->pixels[quarter]++;
            dst->used++;
            if (model > BRIGHT * s)
                continue;
            dst->faint++;
            dst->mean += d;
            dst->squares += d * d;
        }
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
