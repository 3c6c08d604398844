/* Cutting data and templates. */
#include "template/patch.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

static double own_light(const rx_footprint *f, double flux, int x, int y)
{
    const int i = x - f->x0, j = y - f->y0;
    if (i < 0 || j < 0 || i >= f->width || j >= f->height)
        return 0.0;
    return flux * f->values[(size_t)j * (size_t)f->width + (size_t)i];
}

rx_status rx_patch_cut(const rx_canvas *canvas, const rx_footprint *footprint, double flux, int cx, int cy,
                       int half, int domain, rx_patch *patch, rx_error *err)
{
    if (half > domain / 2 - 2) /* neighbours are asked for derivatives */
        half = domain / 2 - 2;
    const size_t side = 2 * (size_t)half + 1;
    *patch = (rx_patch){.x0 = cx - half, .y0 = cy - half, .side = (int)side, .corner = domain / 2 - half};
    patch->data = rx_alloc(side * side, sizeof(double));
    patch->weight = rx_alloc(side * side, sizeof(double));
    if (patch->data == NULL || patch->weight == NULL) {
        rx_patch_clear(patch);
        return rx_error_memory(err, 2 * side * side * sizeof(double));
    }
    for (int j = 0; j < patch->side; j++)
        for (int i = 0; i < patch->side; i++) {
            const int x = patch->x0 + i, y = patch->y0 + j;
            if (x < 0 || y < 0 || x >= canvas->width || y >= canvas->height)
                continue;
            const size_t k = (size_t)y * (size_t)canvas->width + (size_t)x, p = (size_t)j * side + (size_t)i;
            patch->weight[p] = canvas->weight[k];
            if (patch->weight[p] > 0.0)
                patch->data[p] =
                    canvas->data[k] - (double)canvas->model[k] + own_light(footprint, flux, x, y);
        }
    return RX_OK;
}

void rx_patch_add(rx_patch *patch, const rx_footprint *footprint, double flux)
{
    for (int j = 0; j < patch->side; j++)
        for (int i = 0; i < patch->side; i++) {
            const size_t p = (size_t)j * (size_t)patch->side + (size_t)i;
            if (patch->weight[p] > 0.0)
                patch->data[p] += own_light(footprint, flux, patch->x0 + i, patch->y0 + j);
        }
}

void rx_patch_clear(rx_patch *patch)
{
    free(patch->data);
    free(patch->weight);
    *patch = (rx_patch){0};
}

rx_status rx_footprint_crop(const float *plane, int n, size_t stride, int cx, int cy, double level, int width,
                            int height, rx_footprint *dst, rx_error *err)
{
    int low[2] = {n, n}, high[2] = {-1, -1};
    double outside = 0;
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
            const int x = cx - n / 2 + i, y = cy - n / 2 + j;
            const float value = plane[(size_t)j * stride + (size_t)i];
            if (x < 0 || y < 0 || x >= width || y >= height) {
                outside += value;
            } else if (fabsf(value) > level) {
                low[0] = i < low[0] ? i : low[0];
                high[0] = i > high[0] ? i : high[0];
                low[1] = j < low[1] ? j : low[1];
                high[1] = j > high[1] ? j : high[1];
            }
        }
    *dst = (rx_footprint){.inside = 1.0 - outside};
    if (high[0] < 0)
        return RX_OK;
    dst->x0 = cx - n / 2 + low[0];
    dst->y0 = cy - n / 2 + low[1];
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
                plane[(size_t)(j + low[1]) * stride + (size_t)(i + low[0])];
    return RX_OK;
}

double rx_footprint_product(const rx_footprint *a, const rx_footprint *b, const rx_canvas *canvas)
{
    const int x0 = a->x0 > b->x0 ? a->x0 : b->x0, y0 = a->y0 > b->y0 ? a->y0 : b->y0;
    const int x1 = a->x0 + a->width < b->x0 + b->width ? a->x0 + a->width : b->x0 + b->width;
    const int y1 = a->y0 + a->height < b->y0 + b->height ? a->y0 + a->height : b->y0 + b->height;
    double sum = 0;
    for (int y = y0; y < y1; y++) {
        const float *u = a->values + (size_t)(y - a->y0) * (size_t)a->width - a->x0;
        const float *v = b->values + (size_t)(y - b->y0) * (size_t)b->width - b->x0;
        if (canvas == NULL) {
            for (int x = x0; x < x1; x++)
                sum += (double)u[x] * v[x];
        } else {
            const float *w = canvas->weight + (size_t)y * (size_t)canvas->width;
            for (int x = x0; x < x1; x++)
                sum += (double)u[x] * v[x] * w[x];
        }
    }
    return sum;
}
