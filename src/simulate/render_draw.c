/* All objects of a scene on one grid of cells. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "simulate/render_parts.h"

/* Boxes are drawn and added in batches of so many cells, or of one box per thread where these are larger. */
enum { BATCH_CELLS = 1 << 22, STRIP = 64 };

/* Cells of a grid around an extended object. */
struct box {
    long object;
    int i0, j0, width, height;
    size_t offset; /* of its cells among those of its batch */
};

static size_t box_cells(const struct box *b)
{
    return (size_t)b->width * (size_t)b->height;
}

rx_status rx_drawing_open(rx_drawing *d, rx_error *err)
{
    const rx_scene *scene = d->scene;
    d->reach = RX_NEW(double, (size_t)scene->n);
    d->box = rx_alloc((size_t)scene->n, sizeof *d->box);
    if (d->reach == NULL || d->box == NULL)
        return rx_error_memory(err, (size_t)scene->n * sizeof *d->box);
#pragma omp parallel for schedule(static) num_threads(d->nthreads)
    for (long k = 0; k < scene->n; k++)
        d->reach[k] = rx_object_reach(&scene->objects[k], scene->templates) * d->cells;
    return RX_OK;
}

void rx_drawing_close(rx_drawing *d)
{
    free(d->reach);
    free(d->box);
}

/* 0 when nothing of it is inside. */
static int find_box(const rx_drawing *d, long k, long column, long row, const rx_fine_grid *grid,
                    struct box *dst)
{
    const rx_object *o = &d->scene->objects[k];
    double reach = d->reach[k] + 2.0, u = o->x * d->cells - column, v = o->y * d->cells - row;
    double left = fmax(floor(u - reach), 0.0), right = fmin(ceil(u + reach), grid->width - 1.0);
    double bottom = fmax(floor(v - reach), 0.0), top = fmin(ceil(v + reach), grid->height - 1.0);
    if (!(left <= right && bottom <= top))
        return 0;
    *dst = (struct box){k, (int)left, (int)bottom, (int)(right - left) + 1, (int)(top - bottom) + 1, 0};
    return 1;
}

/* Drawn by itself first, so that objects can be drawn at the same time and yet be added in their order.
 * Returns whether memory was missing. */
static int draw_alone(const rx_drawing *d, const struct box *b, const rx_fine_grid *grid, float *cells)
{
    rx_fine_grid part = {.width = b->width,
                         .height = b->height,
                         .x0 = grid->x0 + b->i0 * grid->step,
                         .y0 = grid->y0 + b->j0 * grid->step,
                         .step = grid->step,
                         .cells = cells,
                         .stride = (size_t)b->width};
    memset(cells, 0, box_cells(b) * sizeof *cells);
    const rx_object *o = &d->scene->objects[b->object];
    if (o->type == RX_OBJECT_GALAXY)
        return rx_galaxy_draw(o, &part, NULL) != RX_OK;
    rx_template_draw(o, &d->scene->templates->list[o->template_index], &part);
    return 0;
}

/* Of a box what lies in the rows first .. first + STRIP - 1 of the grid. */
static void add_box(const float *cells, const struct box *b, int first, rx_fine_grid *grid)
{
    int from = first > b->j0 ? first - b->j0 : 0;
    int end = first + STRIP - b->j0 < b->height ? first + STRIP - b->j0 : b->height;
    for (int j = from; j < end; j++) {
        float *row = grid->cells + (size_t)(b->j0 + j) * grid->stride + b->i0;
        const float *add = cells + (size_t)j * (size_t)b->width;
        for (int i = 0; i < b->width; i++)
            row[i] += add[i];
    }
}

/* Where the batch that begins with that box ends; the cells of its boxes. */
static long cut_batch(const rx_drawing *d, long first, long n, size_t *cells)
{
    long k = first;
    *cells = 0;
    while (k < n && (k - first < d->nthreads || *cells + box_cells(&d->box[k]) <= BATCH_CELLS)) {
        d->box[k].offset = *cells;
        *cells += box_cells(&d->box[k++]);
    }
    return k;
}

static rx_status draw_boxes(const rx_drawing *d, long n, rx_fine_grid *grid, rx_error *err)
{
    float *work = NULL;
    size_t room = 0, cells;
    for (long first = 0, end; first < n; first = end) {
        end = cut_batch(d, first, n, &cells);
        if (cells > room) {
            free(work);
            work = RX_NEW(float, cells);
            room = cells;
        }
        if (work == NULL)
            return rx_error_memory(err, cells * sizeof *work);
        int missing = 0;
#pragma omp parallel num_threads(d->nthreads)
        {
#pragma omp for schedule(dynamic) reduction(| : missing)
            for (long k = first; k < end; k++)
                missing |= draw_alone(d, &d->box[k], grid, work + d->box[k].offset);
#pragma omp for schedule(static)
            for (int row = 0; row < grid->height; row += STRIP)
                for (long k = first; k < end; k++)
                    add_box(work + d->box[k].offset, &d->box[k], row, grid);
        }
        if (missing) {
            free(work);
            return rx_error_memory(err, 0);
        }
    }
    free(work);
    return RX_OK;
}

rx_status rx_drawing_part(const rx_drawing *d, long column, long row, rx_fine_grid *grid, rx_error *err)
{
    const rx_scene *scene = d->scene;
    long n = 0;
    for (long k = 0; k < scene->n; k++) {
        const rx_object *o = &scene->objects[k];
        if (o->type == RX_OBJECT_STAR)
            rx_star_draw(d->kernel, o->x * d->cells, o->y * d->cells, o->flux, column, row, grid);
        else
            n += find_box(d, k, column, row, grid, &d->box[n]);
    }
    return draw_boxes(d, n, grid, err);
}
