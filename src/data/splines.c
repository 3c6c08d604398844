/* Nodes of all rows once, then pixels between two of them. */
#include "data/splines.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/simd.h"

/* Where a row lies between two rows of meshes: `first` and the next, with the weights of their values and of
 * their derivatives. */
typedef struct place {
    int first;
    float low, high, low3, high3;
} place;

static place place_of_row(const rx_spline_grid *grid, int y)
{
    float t = (float)((double)((float)y / (float)grid->mesh_height) - 0.5);
    place p = {.first = (int)t};
    t -= (float)p.first;
    if (p.first >= grid->ny - 1) {
        p.first = grid->ny - 2;
        t += 1.0f;
    }
    p.high = t;
    p.low = 1.0f - t;
    p.high3 = p.high * p.high * p.high - p.high;
    p.low3 = p.low * p.low * p.low - p.low;
    return p;
}

/* Second derivatives over 6 of the natural spline through nodes[n]: factor[k] of the elimination, which are
 * the same for all rows; `second` is scratch in between. */
static void differentiate(const float *factor, int n, const float *nodes, float *second)
{
    second[0] = 0.0f;
    for (int k = 1; k < n - 1; k++)
        second[k] = factor[k] * (second[k - 1] - 6.0f * (nodes[k + 1] + nodes[k - 1] - 2.0f * nodes[k]));
    second[n - 1] = 0.0f;
    for (int k = n - 2; k > 0; k--)
        second[k] = (float)((double)(factor[k] * second[k + 1] + second[k]) / 6.0);
}

static void set_nodes(const rx_spline_grid *grid, const float *factor, int y, float *nodes)
{
    const size_t n = (size_t)grid->nx;
    if (grid->ny < 2) {
        memcpy(nodes, grid->values, n * sizeof *nodes);
        memcpy(nodes + n, grid->derivatives, n * sizeof *nodes);
        return;
    }
    const place p = place_of_row(grid, y);
    const float *v = grid->values + (size_t)p.first * n, *d = grid->derivatives + (size_t)p.first * n;
    for (size_t k = 0; k < n; k++)
        nodes[k] = p.low * v[k] + p.high * v[n + k] + p.low3 * d[k] + p.high3 * d[n + k];
    if (n > 1)
        differentiate(factor, grid->nx, nodes, nodes + n);
}

/* The first pixel behind those between the nodes `low` and low + 1. A change comes half a mesh after a mesh
 * begins, and at neither end of the row; meshes of one pixel have none, as in SExtractor. */
static int end_of(const rx_splines *s, int low)
{
    return low >= s->nodes - 2 || s->mesh < 2 ? s->width : (low + 1) * s->mesh + s->mesh / 2;
}

static int node_below(const rx_splines *s, int x)
{
    const int low = s->mesh < 2 ? 0 : (x - s->mesh / 2) / s->mesh;
    return low < 0 ? 0 : low > s->nodes - 2 ? s->nodes - 2 : low;
}

/* Steps are added one by one: their rounding is a part of the maps. */
static void set_places(rx_splines *s)
{
    const float step = (float)(1.0 / s->mesh);
    float t = (step - 1.0f) / 2.0f;
    for (int x = 0, low = 0; x < s->width; x++, t += step) {
        if (x == end_of(s, low)) {
            low++;
            t = s->mesh % 2 == 0 ? step / 2.0f : 0.0f;
        }
        s->place[x] = t;
    }
}

rx_status rx_splines_new(const rx_spline_grid *grid, int width, int height, int nthreads, rx_splines *dst,
                         rx_error *err)
{
    const size_t n = (size_t)grid->nx;
    rx_splines s = {.width = width, .height = height, .nodes = grid->nx, .mesh = grid->mesh_width};
    rx_status status = RX_OK;
    float *factor = RX_NEW(float, n);
    s.node = RX_NEW(float, 2 * n * (size_t)height);
    s.place = RX_NEW(float, (size_t)width);
    if (factor == NULL || s.node == NULL || s.place == NULL) {
        status = rx_error_memory(err, (2 * n * (size_t)height + (size_t)width) * sizeof(float));
        rx_splines_free(&s);
        goto exit;
    }
    for (size_t k = 1; k + 1 < n; k++)
        factor[k] = -1.0f / (factor[k - 1] + 4.0f);
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1)
    for (int y = 0; y < height; y++)
        set_nodes(grid, factor, y, s.node + 2 * n * (size_t)y);
    set_places(&s);
    *dst = s;
exit:
    free(factor);
    return status;
}

void rx_splines_free(rx_splines *splines)
{
    free(splines->node);
    free(splines->place);
    *splines = (rx_splines){0};
}

/* n pixels between the nodes at v[0] and v[1]. */
RX_SIMD static void fill_between(const float *v, const float *d, const float *place, int n, float *dst)
{
    const float v0 = v[0], v1 = v[1], d0 = d[0], d1 = d[1];
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float t = place[i], u = 1.0f - t;
        dst[i] = u * (v0 + (u * u - 1.0f) * d0) + t * (v1 + (t * t - 1.0f) * d1);
    }
}

void rx_splines_row(const rx_splines *splines, int y, int x, int n, float *dst)
{
    const int nodes = splines->nodes, end = x + n;
    const float *node = splines->node + 2 * (size_t)nodes * (size_t)y;
    if (nodes < 2) {
        for (int i = 0; i < n; i++)
            dst[i] = nodes == 0 ? splines->value : node[0];
        return;
    }
    for (int low = node_below(splines, x); x < end; low++) {
        const int next = end_of(splines, low), count = (next < end ? next : end) - x;
        fill_between(node + low, node + nodes + low, splines->place + x, count, dst);
        dst += count;
        x += count;
    }
}
