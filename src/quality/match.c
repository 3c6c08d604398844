/* One-to-one matching: candidate pairs from a grid of cells, then greedy by distance. */
#include "quality/match.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"

enum { MAX_PAIRS = 5000000, MAX_CELLS = 1024 };

typedef struct pair {
    double distance2;
    long a, b;
} pair;

typedef struct pairs {
    pair *list;
    size_t n, capacity;
} pairs;

/* Sources of one list sorted into square cells: those of cell c are order[first[c] .. first[c+1]-1]. */
typedef struct grid {
    double x0, y0, cell;
    long nx, ny;
    long *first, *order;
} grid;

static bool usable(const rx_match_list *list, long i)
{
    return isfinite(list->x[i]) && isfinite(list->y[i]) && (list->use == NULL || list->use[i]);
}

/* Cell along one axis, held inside the grid, so that far outliers cost no memory. */
static long cell_of(double position, double origin, double cell, long n)
{
    double k = floor((position - origin) / cell);
    return k < 0 ? 0 : k >= (double)n ? n - 1 : (long)k;
}

static long grid_cell(const grid *g, double x, double y)
{
    return cell_of(y, g->y0, g->cell, g->ny) * g->nx + cell_of(x, g->x0, g->cell, g->nx);
}

static rx_status grid_make(const rx_match_list *list, double radius, grid *g, rx_error *err)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (long i = 0; i < list->n; i++) {
        if (!usable(list, i))
            continue;
        low[0] = fmin(low[0], list->x[i]);
        low[1] = fmin(low[1], list->y[i]);
        high[0] = fmax(high[0], list->x[i]);
        high[1] = fmax(high[1], list->y[i]);
    }
    double extent = fmax(high[0] - low[0], high[1] - low[1]);
    if (!(extent >= 0)) /* nothing usable */
        low[0] = low[1] = extent = 0;
    g->x0 = low[0];
    g->y0 = low[1];
    g->cell = fmax(radius, extent / MAX_CELLS);
    g->nx = (long)fmin(floor((high[0] > low[0] ? high[0] - low[0] : 0) / g->cell), MAX_CELLS) + 1;
    g->ny = (long)fmin(floor((high[1] > low[1] ? high[1] - low[1] : 0) / g->cell), MAX_CELLS) + 1;
    RX_TRY(RX_MAKE(g->first, (size_t)(g->nx * g->ny) + 2, err));
    RX_TRY(RX_MAKE(g->order, (size_t)list->n, err));
    /* counting sort: counts two places on, running sums, then each filling moves its cell's start */
    for (long i = 0; i < list->n; i++)
        if (usable(list, i))
            g->first[grid_cell(g, list->x[i], list->y[i]) + 2]++;
    for (long c = 2; c < g->nx * g->ny + 2; c++)
        g->first[c] += g->first[c - 1];
    for (long i = 0; i < list->n; i++)
        if (usable(list, i))
            g->order[g->first[grid_cell(g, list->x[i], list->y[i]) + 1]++] = i;
    return RX_OK;
}

static rx_status pairs_add(pairs *dst, double distance2, long a, long b, rx_error *err)
{
    if (dst->n == MAX_PAIRS)
        return rx_error_set(err, RX_USAGE,
                            "more than %d pairs lie within the match radius; give a smaller MATCH_RADIUS",
                            MAX_PAIRS);
    if (dst->n == dst->capacity) {
        const size_t capacity = dst->capacity > 0 ? 2 * dst->capacity : 1024;
        RX_TRY(RX_GROW(dst->list, capacity, err));
        dst->capacity = capacity;
    }
    dst->list[dst->n++] = (pair){distance2, a, b};
    return RX_OK;
}

/* All pairs of source i of a with the sources of b in the cells within reach. */
static rx_status pairs_of(const rx_match_list *a, long i, const rx_match_list *b, const grid *g,
                          double radius, pairs *dst, rx_error *err)
{
    long x0 = cell_of(a->x[i] - radius, g->x0, g->cell, g->nx);
    long x1 = cell_of(a->x[i] + radius, g->x0, g->cell, g->nx);
    long y0 = cell_of(a->y[i] - radius, g->y0, g->cell, g->ny);
    long y1 = cell_of(a->y[i] + radius, g->y0, g->cell, g->ny);
    for (long y = y0; y <= y1; y++)
        for (long k = g->first[y * g->nx + x0]; k < g->first[y * g->nx + x1 + 1]; k++) {
            long j = g->order[k];
            double dx = b->x[j] - a->x[i], dy = b->y[j] - a->y[i];
            if (dx * dx + dy * dy > radius * radius)
                continue;
            RX_TRY(pairs_add(dst, dx * dx + dy * dy, i, j, err));
        }
    return RX_OK;
}

static int by_distance(const void *left, const void *right)
{
    const pair *l = left, *r = right;
    if (l->distance2 != r->distance2)
        return l->distance2 < r->distance2 ? -1 : 1;
    if (l->a != r->a)
        return l->a < r->a ? -1 : 1;
    return (l->b > r->b) - (l->b < r->b);
}

rx_status rx_match(const rx_match_list *a, const rx_match_list *b, double radius, long *a_to_b, long *b_to_a,
                   rx_error *err)
{
    grid g = {0};
    pairs found = {0};
    if (!(radius > 0) || !isfinite(radius))
        return rx_error_set(err, RX_USAGE, "the match radius is %g pixels; give a positive MATCH_RADIUS",
                            radius);
    for (long i = 0; i < a->n; i++)
        a_to_b[i] = -1;
    for (long j = 0; j < b->n; j++)
        b_to_a[j] = -1;
    rx_status status;
    RX_TRY_EXIT(grid_make(b, radius, &g, err));
    for (long i = 0; i < a->n; i++)
        if (usable(a, i))
            RX_TRY_EXIT(pairs_of(a, i, b, &g, radius, &found, err));
    if (found.n > 1)
        qsort(found.list, found.n, sizeof *found.list, by_distance);
    for (size_t k = 0; k < found.n; k++) {
        const pair *p = &found.list[k];
        if (a_to_b[p->a] >= 0 || b_to_a[p->b] >= 0)
            continue;
        a_to_b[p->a] = p->b;
        b_to_a[p->b] = p->a;
    }
exit:
    free(found.list);
    free(g.first);
    free(g.order);
    return status;
}
