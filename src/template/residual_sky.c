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
    const rx_fit_image *image;
    int noise; /* not the sky */
    rx_sky_mesh *mesh;
} cells;

/* data - model of the free pixels of [x0, x1) x [y0, y1), or that over its error where models are faint; returns how many. */
static long gather(const cells *of, int x0, int x1, int y0, int y1, double *dst)
{
    const rx_fit_image *c = of->image;
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
    const rx_fit_image *c = of->image;
    rx_sky_mesh *m = of->mesh;
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
    const rx_sky_mesh *m = of->mesh;
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

/* *mesh is cleared after an error. */
static rx_status measure(rx_fit_image *image, const rx_residual_sky *where, int noise, rx_sky_mesh *mesh,
                         rx_error *err)
{
    rx_status status = rx_sky_mesh_open(image->width, image->height, where->cell, mesh, err);
    if (status != RX_OK)
        return status;
    const size_t count = (size_t)mesh->nx * (size_t)mesh->ny;
    const cells of = {where, image, noise, mesh};
    double *next = RX_NEW(double, count);
    status = next != NULL ? measure_all(&of, image, err) : rx_error_memory(err, count * sizeof *next);
    if (status == RX_OK)
        fill_holes(mesh, noise, next);
    else
        rx_sky_mesh_clear(mesh);
    free(next);
    return status;
}

rx_status rx_residual_sky_subtract(rx_fit_image *image, const rx_residual_sky *where, double *mean,
                                   rx_error *err)
{
    rx_sky_mesh mesh;
    RX_TRY(measure(image, where, 0, &mesh, err));
    double sum = 0;
    for (int i = 0; i < mesh.nx * mesh.ny; i++)
        sum += mesh.value[i];
    *mean = sum / (mesh.nx * mesh.ny);
    return rx_fit_image_subtract(image, &mesh, err);
}

rx_status rx_residual_sky_rescale(rx_fit_image *image, const rx_residual_sky *where, rx_error *err)
{
    rx_sky_mesh mesh;
    RX_TRY(measure(image, where, 1, &mesh, err));
    rx_fit_image_rescale(image, &mesh);
    return RX_OK;
}

/* rest = data - model, as it was before the level was taken off, and weight, of all pixels; weight 0 in the crowd. */
static rx_status copy_rest(rx_fit_image *image, const rx_crowding *crowd, const rx_sky_mesh *level,
                           float *rest, float *weight, rx_error *err)
{
    const int rows = rx_fit_image_rows(image), width = image->width;
    for (int top = 0; top < image->height; top += rows) {
        const int end = top + rows < image->height ? top + rows : image->height;
        RX_TRY(rx_fit_image_load_rows(image, top, end, err));
        for (int y = top; y < end; y++)
            for (int x = 0; x < width; x++) {
                const size_t k = rx_fit_image_row(image, y) + (size_t)x,
                             to = (size_t)y * (size_t)width + (size_t)x;
                const double before = level->nx > 0 ? rx_sky_mesh_at(level, x, y) : 0;
                rest[to] = (float)((double)image->data[k] - (double)image->model[k] + before);
                weight[to] = rx_crowding_at(crowd, x, y)
                                 ? 0.0f
                                 : rx_structure_weight(image->weight[k], image->model[k]);
            }
    }
    return RX_OK;
}

/* The level that was taken off before, if any, makes room for what is found now. */
static rx_status replace_level(rx_fit_image *image, rx_sky_mesh *before, const rx_sky_mesh *found,
                               rx_error *err)
{
    rx_sky_mesh change;
    RX_TRY(rx_sky_mesh_open(image->width, image->height, found->cell, &change, err));
    for (int i = 0; i < found->nx * found->ny; i++)
        change.value[i] = found->value[i] - (before->nx > 0 ? before->value[i] : 0);
    return rx_fit_image_subtract(image, &change, err);
}

rx_status rx_residual_sky_structure(rx_fit_image *image, const rx_psf *psf, const rx_crowding *crowd,
                                    rx_structure *structure, double *power, rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    rx_structure_view view = {.width = image->width, .height = image->height, .nthreads = image->nthreads};
    rx_structure found = {0};
    float *values = NULL, *rest = NULL, *weight = NULL;
    rx_status status = RX_OK;
    RX_TRY_EXIT(rx_structure_point(psf, &view, &values, err));
    const int side = 2 * view.half + 1;
    view.noise = rx_noise_factor(image->correlation, values, side, side);
    *power = 0;
    for (int i = 0; i < side * side; i++)
        *power += (double)values[i] * (double)values[i];
    RX_TRY_EXIT(RX_MAKE(rest, n, err));
    RX_TRY_EXIT(RX_MAKE(weight, n, err));
    RX_TRY_EXIT(copy_rest(image, crowd, &structure->level, rest, weight, err));
    view.rest = rest;
    view.weight = weight;
    RX_TRY_EXIT(rx_structure_measure(&view, &found, err));
    RX_TRY_EXIT(replace_level(image, &structure->level, &found.level, err));
    rx_structure_clear(structure);
    *structure = found;
    found = (rx_structure){0};
exit:
    rx_structure_clear(&found);
    free(values);
    free(rest);
    free(weight);
    return status;
}
