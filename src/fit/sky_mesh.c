/* Bilinear skies. */
#include "fit/sky_mesh.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/simd.h"

/* The cell before pixel x of `size` among n, and how far behind its centre the pixel is. */
static int place_of(int x, int n, int size, double *off)
{
    const double u = fmin(fmax((x + 0.5) * n / size - 0.5, 0), n - 1);
    const int first = (int)u < n - 1 ? (int)u : n - 1;
    *off = u - first;
    return first;
}

rx_status rx_sky_mesh_open(int width, int height, int cell, rx_sky_mesh *mesh, rx_error *err)
{
    const int nx = (width + cell / 2) / cell, ny = (height + cell / 2) / cell;
    *mesh = (rx_sky_mesh){
        .width = width, .height = height, .cell = cell, .nx = nx > 1 ? nx : 1, .ny = ny > 1 ? ny : 1};
    const size_t cells = (size_t)mesh->nx * (size_t)mesh->ny;
    mesh->value = RX_NEW(double, cells);
    mesh->first = RX_NEW(int, (size_t)width);
    mesh->off = RX_NEW(double, (size_t)width);
    if (mesh->value == NULL || mesh->first == NULL || mesh->off == NULL) {
        rx_sky_mesh_clear(mesh);
        return rx_error_memory(err, cells * sizeof(double) + 2 * (size_t)width * sizeof(double));
    }
    for (int x = 0; x < width; x++)
        mesh->first[x] = place_of(x, mesh->nx, width, &mesh->off[x]);
    return RX_OK;
}

void rx_sky_mesh_clear(rx_sky_mesh *mesh)
{
    free(mesh->value);
    free(mesh->first);
    free(mesh->off);
    *mesh = (rx_sky_mesh){0};
}

double rx_sky_mesh_at(const rx_sky_mesh *mesh, int x, int y)
{
    double up;
    const int line = place_of(y, mesh->ny, mesh->height, &up), next = line + 1 < mesh->ny ? line + 1 : line;
    const int i = mesh->first[x], j = i + 1 < mesh->nx ? i + 1 : i;
    const double *low = mesh->value + (size_t)line * (size_t)mesh->nx;
    const double *high = mesh->value + (size_t)next * (size_t)mesh->nx;
    const double below = low[i] + mesh->off[x] * (low[j] - low[i]),
                 above = high[i] + mesh->off[x] * (high[j] - high[i]);
    return below + up * (above - below);
}

/* Between four centres, left and right ones below and above the row; `up` from the ones to the others. */
RX_SIMD static void take_off_between(const double below[2], const double above[2], double up,
                                     const double *off, int n, const float *weight, float *data)
{
    const double low = below[0], low_step = below[1] - below[0];
    const double high = above[0], high_step = above[1] - above[0];
#pragma omp simd
    for (int k = 0; k < n; k++) {
        const double a = low + off[k] * low_step, b = high + off[k] * high_step;
        data[k] -= weight[k] > 0 ? (float)(a + up * (b - a)) : 0.0f;
    }
}

void rx_sky_mesh_subtract(const rx_sky_mesh *mesh, int y, int x, int n, const float *weight, float *data)
{
    double up;
    const int line = place_of(y, mesh->ny, mesh->height, &up), next = line + 1 < mesh->ny ? line + 1 : line;
    const double *low = mesh->value + (size_t)line * (size_t)mesh->nx;
    const double *high = mesh->value + (size_t)next * (size_t)mesh->nx;
    for (int k = 0, end; k < n; k = end) {
        const int i = mesh->first[x + k], j = i + 1 < mesh->nx ? i + 1 : i;
        for (end = k + 1; end < n && mesh->first[x + end] == i;)
            end++;
        take_off_between((double[2]){low[i], low[j]}, (double[2]){high[i], high[j]}, up, mesh->off + x + k,
                         end - k, weight + k, data + k);
    }
}

void rx_sky_mesh_multiply(const rx_sky_mesh *mesh, int y, int x, int n, float *values)
{
    double up;
    const int line = place_of(y, mesh->ny, mesh->height, &up);
    const int next = line + 1 < mesh->ny ? line + 1 : line;
    const double *low = mesh->value + (size_t)line * (size_t)mesh->nx;
    const double *high = mesh->value + (size_t)next * (size_t)mesh->nx;
    for (int k = 0; k < n; k++) {
        const int i = mesh->first[x + k], j = i + 1 < mesh->nx ? i + 1 : i;
        const double off = mesh->off[x + k];
        const double below = low[i] + off * (low[j] - low[i]), above = high[i] + off * (high[j] - high[i]);
        values[k] *= (float)(below + up * (above - below));
    }
}
