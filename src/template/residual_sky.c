/* The sky under modelled sources, and its noise. */
#include "template/residual_sky.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/simd.h"

static const double CLIP = 3.0;
static const double CLIPPED = 0.9866; /* width of a Gaussian that is cut there, over its sigma */
static const double ENOUGH = 0.05;    /* share of a cell's pixels that must be free */
static const double FAINT_LIGHT =
    0.5; /* of a pixel's variance, that the sky has at least where its noise is measured */
enum { CLIPPINGS = 10 };

/* What one cell is measured on. */
typedef struct cells {
    const rx_residual_sky *where;
    const rx_fit_image *canvas;
    int noise; /* not the sky */
    rx_sky_mesh *sheet;
} cells;

/* data - model of the free pixels of [x0, x1) x [y0, y1), or that over its error where models are faint; returns how many. */
static long gather(const cells *of, int x0, int x1, int y0, int y1, double *dst)
{
    const rx_fit_image *c = of->canvas;
    long n = 0;
    for (int y = y0; y < y1; y++) {
        const int32_t *segment =
            of->where->segments != NULL ? of->where->segments + (size_t)y * (size_t)c->width : NULL;
        const size_t row = rx_fit_image_row(c, y);
        for (int x = x0; x < x1; x++) {
            const size_t k = row + (size_t)x;
            const double rest = (double)c->data[k] - c->model[k], weight = c->weight[k], sigma = c->sigma[k];
            dst[n] = of->noise ? rest * sqrt(weight) : rest;
            n += (segment == NULL || segment[x] == 0) && weight > 0 &&
                 (!of->noise || weight * sigma * sigma > FAINT_LIGHT);
        }
    }
    return n;
}

/* Clipped mean of n values, and their width; NAN with fewer than `enough`. */
RX_SIMD static double clipped_mean(const double *values, long count, double enough, double *width)
{
    double mean = 0, sigma = HUGE_VAL;
    long kept = -1;
    *width = NAN;
    for (int round = 0; round < CLIPPINGS; round++) {
        double sum = 0, square = 0;
        long n = 0;
        const double limit = CLIP * sigma;
#pragma omp simd reduction(+ : sum, square, n)
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
    *width = sigma;
    return mean;
}

static int edge(int i, int n, int size)
{
    return (int)((long)i * size / n);
}

/* The cells of lines first .. end - 1, whose pixels are shown. */
static rx_status measure_cells(const cells *of, int first, int end, rx_error *err)
{
    const rx_fit_image *c = of->canvas;
    rx_sky_mesh *m = of->sheet;
    /* the widest cell has one pixel more than the narrowest; one more is written to before it is known not to
     * count */
    const size_t room = ((size_t)(c->width / m->nx) + 1) * ((size_t)(c->height / m->ny) + 1) + 1;
    rx_status failed = RX_OK;
#pragma omp parallel num_threads(c->nthreads)
    {
        double *values = rx_alloc(room, sizeof(double));
        if (values == NULL) {
#pragma omp critical(rx_residual_sky_failure)
            failed = rx_error_memory(err, room * sizeof(double));
        }
#pragma omp for schedule(dynamic)
        for (int i = m->nx * first; i < m->nx * end; i++) {
            const int x = i % m->nx, y = i / m->nx;
            const int x0 = edge(x, m->nx, c->width), x1 = edge(x + 1, m->nx, c->width);
            const int y0 = edge(y, m->ny, c->height), y1 = edge(y + 1, m->ny, c->height);
            const int outside =
                of->where->crowd != NULL && !rx_crowding_at(of->where->crowd, (x0 + x1) / 2, (y0 + y1) / 2);
            double width = of->noise;
            if (values != NULL && !outside)
                m->value[i] = clipped_mean(values, gather(of, x0, x1, y0, y1, values),
                                           fmax(ENOUGH * (x1 - x0) * (double)(y1 - y0), 16), &width);
            if (of->noise)
                m->value[i] = outside ? 1 : width > 0 ? width / CLIPPED : NAN;
        }
        free(values);
    }
    return failed;
}

/* As many lines of cells at a time as fit in memory. */
static rx_status measure_all(const cells *of, rx_fit_image *c, rx_error *err)
{
    const rx_sky_mesh *m = of->sheet;
    const int rows = rx_fit_image_rows(c);
    rx_status status = RX_OK;
    for (int first = 0, end; first < m->ny && status == RX_OK; first = end) {
        const int from = edge(first, m->ny, c->height);
        for (end = first + 1; end < m->ny && edge(end + 1, m->ny, c->height) - from <= rows;)
            end++;
        status = rx_fit_image_load_rows(c, from, edge(end, m->ny, c->height), err);
        if (status == RX_OK)
            status = measure_cells(of, first, end, err);
    }
    return status;
}

/* Cells that are not known take the mean of known neighbours, in rounds; `lacking` when there is none at all. */
static void fill_holes(rx_sky_mesh *m, double lacking, double *next)
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
        m->value[k] = isfinite(m->value[k]) ? m->value[k] : lacking;
}

/* *sheet is cleared after an error. */
static rx_status measure(rx_fit_image *canvas, const rx_residual_sky *where, int noise, rx_sky_mesh *sheet,
                         rx_error *err)
{
    rx_status status = rx_sky_mesh_open(canvas->width, canvas->height, where->cell, sheet, err);
    if (status != RX_OK)
        return status;
    const size_t count = (size_t)sheet->nx * (size_t)sheet->ny;
    const cells of = {where, canvas, noise, sheet};
    double *next = RX_NEW(double, count);
    status = next != NULL ? measure_all(&of, canvas, err) : rx_error_memory(err, count * sizeof *next);
    if (status == RX_OK)
        fill_holes(sheet, noise, next);
    else
        rx_sky_mesh_clear(sheet);
    free(next);
    return status;
}

rx_status rx_residual_sky_subtract(rx_fit_image *canvas, const rx_residual_sky *where, double *mean,
                                   rx_error *err)
{
    rx_sky_mesh sheet;
    RX_TRY(measure(canvas, where, 0, &sheet, err));
    double sum = 0;
    for (int i = 0; i < sheet.nx * sheet.ny; i++)
        sum += sheet.value[i];
    *mean = sum / (sheet.nx * sheet.ny);
    return rx_fit_image_subtract(canvas, &sheet, err);
}

rx_status rx_residual_sky_rescale(rx_fit_image *canvas, const rx_residual_sky *where, rx_error *err)
{
    rx_sky_mesh sheet;
    RX_TRY(measure(canvas, where, 1, &sheet, err));
    rx_fit_image_rescale(canvas, &sheet);
    return RX_OK;
}
