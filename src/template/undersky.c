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

/* data - model of the free pixels of [x0, x1) x [y0, y1); returns how many. */
static long gather(const rx_canvas *c, const int32_t *segments, int x0, int x1, int y0, int y1, double *dst)
{
    long n = 0;
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            const size_t k = (size_t)y * (size_t)c->width + (size_t)x;
            dst[n] = (double)c->data[k] - c->model[k];
            n += segments[k] == 0 && c->weight[k] > 0;
        }
    return n;
}

/* Clipped mean of n values; NAN with fewer than `enough`. */
static double clipped_mean(const double *values, long count, double enough)
{
    double mean = 0, sigma = HUGE_VAL;
    long kept = -1;
    for (int round = 0; round < CLIPPINGS; round++) {
        double sum = 0, square = 0;
        long n = 0;
        const double limit = CLIP * sigma;
        for (long k = 0; k < count; k++) {
            const double v = values[k];
            const int take = !(fabs(v - mean) > limit);
            sum += take ? v : 0.0;
            square += take ? v * v : 0.0;
            n += take;
        }
        if (n < enough)
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

static rx_status measure_cells(const rx_canvas *c, const int32_t *segments, int nthreads, mesh *m,
                               rx_error *err)
{
    /* the widest cell has one pixel more than the narrowest; one more is written to before it is known not to
     * count */
    const size_t room = ((size_t)(c->width / m->nx) + 1) * ((size_t)(c->height / m->ny) + 1) + 1;
    rx_status failed = RX_OK;
#pragma omp parallel num_threads(nthreads)
    {
        double *values = rx_alloc(room, sizeof(double));
        if (values == NULL) {
#pragma omp critical(rx_undersky_failure)
            failed = rx_error_memory(err, room * sizeof(double));
        }
#pragma omp for schedule(dynamic)
        for (int i = 0; i < m->nx * m->ny; i++) {
            const int x = i % m->nx, y = i / m->nx;
            const int x0 = edge(x, m->nx, c->width), x1 = edge(x + 1, m->nx, c->width);
            const int y0 = edge(y, m->ny, c->height), y1 = edge(y + 1, m->ny, c->height);
            if (values != NULL)
                m->value[i] = clipped_mean(values, gather(c, segments, x0, x1, y0, y1, values),
                                           fmax(ENOUGH * (x1 - x0) * (double)(y1 - y0), 16));
        }
        free(values);
    }
    return failed;
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

/* Between which of n cells the pixel x of `size` lies, and how far from the first of the two centres. */
typedef struct place {
    int first, second;
    double off;
} place;

static place place_of(int x, int n, int size)
{
    const double u = fmin(fmax((x + 0.5) * n / size - 0.5, 0), n - 1);
    const int first = (int)u < n - 1 ? (int)u : n - 1;
    return (place){first, first + 1 < n ? first + 1 : first, u - first};
}

/* Bilinear between cell centres, constant beyond the outermost. */
static rx_status subtract(rx_canvas *c, const mesh *m, int nthreads, rx_error *err)
{
    place *columns = RX_NEW(place, (size_t)c->width);
    if (columns == NULL)
        return rx_error_memory(err, (size_t)c->width * sizeof *columns);
    for (int x = 0; x < c->width; x++)
        columns[x] = place_of(x, m->nx, c->width);
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < c->height; y++) {
        const place row = place_of(y, m->ny, c->height);
        const double *low = m->value + (size_t)row.first * (size_t)m->nx;
        const double *high = m->value + (size_t)row.second * (size_t)m->nx;
        float *data = c->data + (size_t)y * (size_t)c->width;
        const float *weight = c->weight + (size_t)y * (size_t)c->width;
        for (int x = 0; x < c->width; x++) {
            const int i = columns[x].first, j = columns[x].second;
            const double a = low[i] + columns[x].off * (low[j] - low[i]);
            const double b = high[i] + columns[x].off * (high[j] - high[i]);
            if (weight[x] > 0)
                data[x] -= (float)(a + row.off * (b - a));
        }
    }
    free(columns);
    return RX_OK;
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
    rx_status status = measure_cells(canvas, segments, nthreads, &m, err);
    if (status != RX_OK)
        goto exit;
    fill_holes(&m, next);
    for (int i = 0; i < cells; i++)
        sum += m.value[i];
    *mean = sum / cells;
    status = subtract(canvas, &m, nthreads, err);
exit:
    free(m.value);
    free(next);
    return status;
}
