/* Cutting data and templates. */
#include "template/patch.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/simd.h"

/* count pixels from k on. */
RX_SIMD static void cut_row(const rx_fit_image *image, ptrdiff_t k, int count, double *restrict data,
                            double *restrict weight)
{
    const float *w = image->weight + k, *d = image->data + k, *m = image->model + k;
#pragma omp simd
    for (int i = 0; i < count; i++) {
        weight[i] = w[i];
        data[i] = w[i] > 0.0f ? (double)d[i] - (double)m[i] : 0.0;
    }
}

rx_status rx_patch_cut(const rx_fit_image *image, int cx, int cy, int half, int domain, rx_patch *patch,
                       rx_error *err)
{
    if (half > domain / 2 - 2) /* neighbours are asked for derivatives */
        half = domain / 2 - 2;
    const size_t side = 2 * (size_t)half + 1;
    *patch = (rx_patch){.x0 = cx - half, .y0 = cy - half, .side = (int)side, .corner = domain / 2 - half};
    patch->data = rx_alloc(side * side, 2 * sizeof(double));
    if (patch->data == NULL)
        return rx_error_memory(err, 2 * side * side * sizeof(double));
    patch->weight = patch->data + side * side;
    const int first = patch->x0 > 0 ? 0 : -patch->x0;
    const int last = image->width - patch->x0 < patch->side ? image->width - patch->x0 : patch->side;
    for (int j = 0; j < patch->side; j++) {
        const int y = patch->y0 + j;
        if (y < 0 || y >= image->height)
            continue;
        const ptrdiff_t k = (ptrdiff_t)rx_fit_image_row(image, y) + patch->x0;
        cut_row(image, k + first, last - first, patch->data + (size_t)j * side + (size_t)first,
                patch->weight + (size_t)j * side + (size_t)first);
    }
    return RX_OK;
}

void rx_patch_add(rx_patch *patch, const rx_footprint *footprint, double flux)
{
    const rx_footprint *f = footprint;
    const int x0 = f->x0 > patch->x0 ? f->x0 : patch->x0, y0 = f->y0 > patch->y0 ? f->y0 : patch->y0;
    const int xf = f->x0 + f->width, xp = patch->x0 + patch->side, x1 = xf < xp ? xf : xp;
    const int yf = f->y0 + f->height, yp = patch->y0 + patch->side, y1 = yf < yp ? yf : yp;
    for (int y = y0; y < y1; y++) {
        const float *values = f->values + (size_t)(y - f->y0) * (size_t)f->width;
        const size_t row = (size_t)(y - patch->y0) * (size_t)patch->side;
        for (int x = x0; x < x1; x++) {
            const size_t p = row + (size_t)(x - patch->x0);
            if (patch->weight[p] > 0.0)
                patch->data[p] += flux * values[x - f->x0];
        }
    }
}

void rx_patch_dim(rx_patch *patch, double factor)
{
    const size_t area = (size_t)patch->side * (size_t)patch->side;
    for (size_t k = 0; k < area; k++)
        patch->weight[k] /= factor * factor;
}

void rx_patch_clear(rx_patch *patch)
{
    free(patch->data);
    *patch = (rx_patch){0};
}

RX_SIMD static int any_above(const float *row, int count, double level)
{
    float most = 0;
#pragma omp simd reduction(max : most)
    for (int i = 0; i < count; i++) {
        const float size = row[i] < 0 ? -row[i] : row[i];
        most = size > most ? size : most;
    }
    return most > level;
}

rx_status rx_footprint_crop(const rx_template_plane *plane, double level, int width, int height,
                            rx_footprint *dst, rx_error *err)
{
    const int n = plane->n, x0 = plane->cx - n / 2, y0 = plane->cy - n / 2;
    const int first = x0 < 0 ? -x0 : 0, end = width - x0 < n ? width - x0 : n;
    int low[2] = {n, n}, high[2] = {-1, -1};
    double outside = 0;
    for (int j = 0; j < n; j++) {
        const float *row = plane->values + (size_t)j * plane->stride;
        const int inside = y0 + j >= 0 && y0 + j < height;
        for (int i = 0; i < n && (!inside || first > 0 || end < n); i++)
            outside += inside && i >= first && i < end ? 0.0f : row[i];
        if (!inside || !any_above(row + first, end - first, level))
            continue;
        low[1] = low[1] < n ? low[1] : j;
        high[1] = j;
        for (int i = first; i < low[0]; i++)
            if (fabsf(row[i]) > level)
                low[0] = i;
        for (int i = end - 1; i > high[0]; i--)
            if (fabsf(row[i]) > level)
                high[0] = i;
    }
    *dst = (rx_footprint){.inside = 1.0 - outside};
    if (high[0] < 0)
        return RX_OK;
    dst->x0 = x0 + low[0];
    dst->y0 = y0 + low[1];
    dst->width = high[0] - low[0] + 1;
    dst->height = high[1] - low[1] + 1;
    dst->values = RX_NEW(float, (size_t)dst->width *(size_t)dst->height);
    if (dst->values == NULL) {
        *dst = (rx_footprint){0};
        return rx_error_memory(err, 0);
    }
    for (int j = 0; j < dst->height; j++)
        for (int i = 0; i < dst->width; i++)
            dst->values[(size_t)j * (size_t)dst->width + (size_t)i] =
                plane->values[(size_t)(j + low[1]) * plane->stride + (size_t)(i + low[0])];
    return RX_OK;
}

double rx_footprint_peak(const rx_footprint *f)
{
    float peak = 0;
    for (size_t k = 0; k < (size_t)f->width * (size_t)f->height; k++)
        peak = f->values[k] > peak ? f->values[k] : peak;
    return (double)peak;
}

RX_SIMD double rx_footprint_product(const rx_footprint *a, const rx_footprint *b, const rx_fit_image *image)
{
    const int x0 = a->x0 > b->x0 ? a->x0 : b->x0, y0 = a->y0 > b->y0 ? a->y0 : b->y0;
    const int x1 = a->x0 + a->width < b->x0 + b->width ? a->x0 + a->width : b->x0 + b->width;
    const int y1 = a->y0 + a->height < b->y0 + b->height ? a->y0 + a->height : b->y0 + b->height;
    double sum = 0;
    for (int y = y0; y < y1; y++) {
        const float *u = a->values + (size_t)(y - a->y0) * (size_t)a->width - a->x0;
        const float *v = b->values + (size_t)(y - b->y0) * (size_t)b->width - b->x0;
        if (image == NULL) {
#pragma omp simd reduction(+ : sum)
            for (int x = x0; x < x1; x++)
                sum += (double)u[x] * v[x];
        } else {
            const float *w = image->weight + rx_fit_image_row(image, y);
#pragma omp simd reduction(+ : sum)
            for (int x = x0; x < x1; x++)
                sum += (double)u[x] * v[x] * w[x];
        }
    }
    return sum;
}
