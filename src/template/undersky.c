/* The sky under modelled sources. */
#include "template/undersky.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

static const double CLIP = 3.0;
static const double ENOUGH = 0.05; /* share of a cell's pixels that must be free */
enum { CLIPPINGS = 10 };

typedef struct mesh {
    int nx, ny;
    double *value; /* [ny][nx], NAN where not known */
} mesh;

/* Clipped mean of data - model over free pixels of [x0, x1) x [y0, y1); NAN with too few. */
static double cell_mean(const rx_canvas *c, const int32_t *segments, int x0, int x1, int y0, int y1)
{
    double mean = 0, sigma = HUGE_VAL;
    long kept = -1;
    for (int round = 0; round < CLIPPINGS; round++) {
        double sum = 0, square = 0;
        long n = 0;
        for (int y = y0; y < y1; y++)
            for (int x = x0; x < x1; x++) {
                const size_t k = (size_t)y * (size_t)c->width + (size_t)x;
                if (segments[k] != 0 || !(c->weight[k] > 0))
                    continue;
                const double v = (double)c->data[k] - c->model[k];
                if (fabs(v - mean) > CLIP * sigma)
                    continue;
                sum += v;
                square += v * v;
                n++;
            }
        if (n < ENOUGH * (x1 - x0) * (double)(y1 - y0) || n < 16)
            return NAN;
        mean = sum / (double)n;
        sigma = sqrt(fmax(square / (double)n - mean * mean, 0));
        if (n == kept)
            break;
        kept = n;
    }
    return mean;
}

static int edge(int i, int n, int size)
{
    return (int)((long)i * size / n);
}

/* Cells that are not known take the mean of known neighbours, in rounds; 0 when there is none at all. */
static void fill_holes(mesh *m, double *next)
{
    const size_t cells = (size_t)m->nx * (size_t)m->ny;
    for (int round = 0; round < m->nx + m->ny; round++) {
        int holes = 0;
        for (int y = 0; y < m->ny; y++)
            for (int x = 0; x < m->nx; x++) {
                const size_t k = (size_t)y * (size_t)m->nx + (size_t)x;
                double sum = 0;
                int n = 0;
                next[k] = m->value[k];
                for (int v = y - 1; v <= y + 1 && !isfinite(m->value[k]); v++)
                    for (int u = x - 1; u <= x + 1; u++)
                        if (u >= 0 && v >= 0 && u < m->nx && v < m->ny &&
                            isfinite(m->value[(size_t)v * (size_t)m->nx + (size_t)u])) {
                            sum += m->value[(size_t)v * (size_t)m->nx + (size_t)u];
                            n++;
                        }
                if (!isfinite(m->value[k]))
                    next[k] = n > 0 ? sum / n : NAN;
                holes += !isfinite(next[k]);
            }
        for (size_t k = 0; k < cells; k++)
            m->value[k] = next[k];
        if (holes == 0)
            return;
    }
    for (size_t k = 0; k < cells; k++)
        m->value[k] = isfinite(m->value[k]) ? m->value[k] : 0;
}

/* Bilinear between cell centres, constant beyond the outermost. */
static double between(const mesh *m, const rx_canvas *c, int x, int y)
{
    const double u = fmin(fmax((x + 0.5) * m->nx / c->width - 0.5, 0), m->nx - 1);
    const double v = fmin(fmax((y + 0.5) * m->ny / c->height - 0.5, 0), m->ny - 1);
    const int i = (int)u < m->nx - 1 ? (int)u : m->nx - 1, j = (int)v < m->ny - 1 ? (int)v : m->ny - 1;
    const int i1 = i + 1 < m->nx ? i + 1 : i, j1 = j + 1 < m->ny ? j + 1 : j;
    const double *low = m->value + (size_t)j * (size_t)m->nx, *high = m->value + (size_t)j1 * (size_t)m->nx;
    const double a = low[i] + (u - i) * (low[i1] - low[i]), b = high[i] + (u - i) * (high[i1] - high[i]);
    return a + (v - j) * (b - a);
}

static void subtract(rx_canvas *c, const mesh *m, int nthreads)
{
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            const size_t k = (size_t)y * (size_t)c->width + (size_t)x;
            if (c->weight[k] > 0)
                c->data[k] -= (float)between(m, c, x, y);
        }
}

rx_status rx_undersky_subtract(rx_canvas *canvas, const int32_t *segments, int cell, int nthreads,
                               double *mean, rx_error *err)
{
    mesh m = {.nx = (canvas->width + cell / 2) / cell, .ny = (canvas->height + cell / 2) / cell};
    m.nx = m.nx > 1 ? m.nx : 1;
    m.ny = m.ny > 1 ? m.ny : 1;
    const int cells = m.nx * m.ny;
    m.value = RX_NEW(double, cells);
    double *next = RX_NEW(double, cells), sum = 0;
    if (m.value == NULL || next == NULL) {
        free(m.value);
        free(next);
        return rx_error_memory(err, 2 * (size_t)cells * sizeof(double));
    }
#pragma omp parallel for schedule(dynamic) num_threads(nthreads)
    for (int i = 0; i < cells; i++) {
        const int x = i % m.nx, y = i / m.nx;
        m.value[i] =
            cell_mean(canvas, segments, edge(x, m.nx, canvas->width), edge(x + 1, m.nx, canvas->width),
                      edge(y, m.ny, canvas->height), edge(y + 1, m.ny, canvas->height));
    }
    fill_holes(&m, next);
    for (int i = 0; i < cells; i++)
        sum += m.value[i];
    *mean = sum / cells;
    subtract(canvas, &m, nthreads);
    free(m.value);
    free(next);
    return RX_OK;
}
