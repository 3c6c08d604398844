/* All objects of a scene on one grid of cells. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "simulate/render_parts.h"

/* Cells around an extended object, clipped to the grid. */
typedef struct box {
    int i0, j0, width, height;
} box;

/* 0 when nothing of it is inside. */
static int find_box(const rx_object *o, const rx_templates *templates, int cells, long column, long row,
                    const rx_fine_grid *grid, box *dst)
{
    double reach = rx_object_reach(o, templates) * cells + 2.0, u = o->x * cells - column,
           v = o->y * cells - row;
    double left = fmax(floor(u - reach), 0.0), right = fmin(ceil(u + reach), grid->width - 1.0);
    double bottom = fmax(floor(v - reach), 0.0), top = fmin(ceil(v + reach), grid->height - 1.0);
    if (!(left <= right && bottom <= top))
        return 0;
    *dst = (box){(int)left, (int)bottom, (int)(right - left) + 1, (int)(top - bottom) + 1};
    return 1;
}

static void draw_extended(const rx_object *o, const rx_templates *templates, rx_fine_grid *grid)
{
    if (o->type == RX_OBJECT_GALAXY)
        rx_galaxy_draw(o, grid);
    else
        rx_template_draw(o, &templates->list[o->template_index], grid);
}

/* Drawn by itself first, so that objects can be drawn at the same time and yet be added in their order. */
static float *draw_alone(const rx_object *o, const rx_templates *templates, const rx_fine_grid *grid,
                         const box *b)
{
    float *cells = RX_NEW(float, (size_t)b->width *(size_t)b->height);
    rx_fine_grid part = {.width = b->width,
                         .height = b->height,
                         .x0 = grid->x0 + b->i0 * grid->step,
                         .y0 = grid->y0 + b->j0 * grid->step,
                         .step = grid->step,
                         .cells = cells,
                         .stride = (size_t)b->width};
    if (cells != NULL)
        draw_extended(o, templates, &part);
    return cells;
}

static void add_box(const float *cells, const box *b, rx_fine_grid *grid)
{
    for (int j = 0; j < b->height; j++) {
        float *row = grid->cells + (size_t)(b->j0 + j) * grid->stride + b->i0;
        const float *add = cells + (size_t)j * (size_t)b->width;
        for (int i = 0; i < b->width; i++)
            row[i] += add[i];
    }
}

rx_status rx_scene_draw(const rx_scene *scene, const rx_star_kernel *kernel, int cells, long column, long row,
                        int nthreads, rx_fine_grid *grid, rx_error *err)
{
    int failed = 0;
    for (long k = 0; k < scene->n; k++)
        if (scene->objects[k].type == RX_OBJECT_STAR)
            rx_star_draw(kernel, scene->objects[k].x * cells, scene->objects[k].y * cells,
                         scene->objects[k].flux, column, row, grid);
#pragma omp parallel for ordered schedule(dynamic) num_threads(nthreads)
    for (long k = 0; k < scene->n; k++) {
        const rx_object *o = &scene->objects[k];
        float *drawn = NULL;
        box b;
        int inside = o->type != RX_OBJECT_STAR && find_box(o, scene->templates, cells, column, row, grid, &b);
        if (inside)
            drawn = draw_alone(o, scene->templates, grid, &b);
#pragma omp ordered
        {
            if (drawn != NULL)
                add_box(drawn, &b, grid);
            else if (inside)
                failed = 1;
        }
        free(drawn);
    }
    return failed ? rx_error_memory(err, 0) : RX_OK;
}
