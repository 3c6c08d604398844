/* Sums over correlated noise. */
#include "template/correlated.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"

/* dst += k * src. */
RX_SIMD static void add_row(const double *restrict src, int count, double k, double *restrict dst)
{
#pragma omp simd
    for (int x = 0; x < count; x++)
        dst[x] += k * src[x];
}

/* dst = root(w) times what is given, row y of the image from x on. */
static void weigh_row(const rx_fit_image *image, int y, int x, int count, double *dst)
{
    const float *weight = image->weight + rx_fit_image_row(image, y) + (size_t)x;
    for (int i = 0; i < count; i++)
        dst[i] *= sqrt((double)weight[i]);
}

/* A row of the template, weighed, goes to all rows that its noise reaches. */
static void spread_row(const rx_noise_correlation *noise, const rx_footprint *f, int y, const double *row,
                       rx_correlated *dst)
{
    const rx_window *w = &dst->window;
    const size_t width = (size_t)(w->x1 - w->x0);
    for (int dy = -RX_NOISE_REACH; dy <= RX_NOISE_REACH; dy++) {
        if (y + dy < w->y0 || y + dy >= w->y1)
            continue;
        double *to = dst->values + (size_t)(y + dy - w->y0) * width;
        for (int dx = -RX_NOISE_REACH; dx <= RX_NOISE_REACH; dx++) {
            const double at = noise->at[dy + RX_NOISE_REACH][dx + RX_NOISE_REACH];
            const int x0 = rx_max_int(f->x0 + dx, w->x0), x1 = rx_min_int(f->x0 + f->width + dx, w->x1);
            if (at != 0.0 && x0 < x1)
                add_row(row + (x0 - dx - f->x0), x1 - x0, at, to + (x0 - w->x0));
        }
    }
}

rx_status rx_correlated_new(const rx_fit_image *image, const rx_footprint *f, const rx_window *within,
                            rx_correlated *dst, rx_error *err)
{
    const int reach = RX_NOISE_REACH;
    const rx_window w = {rx_max_int(f->x0 - reach, within->x0), rx_max_int(f->y0 - reach, within->y0),
                         rx_min_int(f->x0 + f->width + reach, within->x1),
                         rx_min_int(f->y0 + f->height + reach, within->y1)};
    *dst = (rx_correlated){.window = w};
    if (f->width == 0 || w.x1 <= w.x0 || w.y1 <= w.y0) {
        dst->window = (rx_window){0, 0, 0, 0};
        return RX_OK;
    }
    const size_t width = (size_t)(w.x1 - w.x0), area = width * (size_t)(w.y1 - w.y0);
    double *row = RX_NEW(double, (size_t)f->width);
    dst->values = RX_NEW(double, area);
    if (row == NULL || dst->values == NULL) {
        free(row);
        rx_correlated_clear(dst);
        return rx_error_memory(err, area * sizeof(double));
    }
    for (int y = f->y0; y < f->y0 + f->height; y++) {
        const float *values = f->values + (size_t)(y - f->y0) * (size_t)f->width;
        for (int i = 0; i < f->width; i++)
            row[i] = values[i];
        weigh_row(image, y, f->x0, f->width, row);
        spread_row(image->correlation, f, y, row, dst);
    }
    for (int y = w.y0; y < w.y1; y++)
        weigh_row(image, y, w.x0, (int)width, dst->values + (size_t)(y - w.y0) * width);
    free(row);
    return RX_OK;
}

void rx_correlated_clear(rx_correlated *grain)
{
    free(grain->values);
    *grain = (rx_correlated){.values = NULL};
}

RX_SIMD double rx_correlated_covariance(const rx_correlated *grain, const rx_footprint *f)
{
    const rx_window *w = &grain->window;
    const int x0 = rx_max_int(f->x0, w->x0), x1 = rx_min_int(f->x0 + f->width, w->x1);
    double sum = 0.0;
    for (int y = rx_max_int(f->y0, w->y0); y < rx_min_int(f->y0 + f->height, w->y1); y++) {
        const double *g = grain->values + (size_t)(y - w->y0) * (size_t)(w->x1 - w->x0);
        const float *t = f->values + (size_t)(y - f->y0) * (size_t)f->width;
#pragma omp simd reduction(+ : sum)
        for (int x = x0; x < x1; x++)
            sum += g[x - w->x0] * (double)t[x - f->x0];
    }
    return sum;
}
