/* Shelves: the highest groups first, from left to right, then the next shelf. */
#include "detect/cutouts.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { RING = 1, LEAST_WIDTH = 64 };
static const float NOTHING = 1e30f;         /* noise where there is no pixel */
static const float ROUNDING = 1.0f + 2e-6f; /* of threshold * (lowest / threshold) in float */

static int width_of(const rx_group *g)
{
    return g->xmax - g->xmin + 1 + 2 * RING;
}

static int height_of(const rx_group *g)
{
    return g->ymax - g->ymin + 1 + 2 * RING;
}

long rx_cutout_area(const rx_group *group)
{
    return (long)width_of(group) * height_of(group);
}

/* Height first, then the order of the list: the same layout on every machine. */
typedef struct item {
    int height, group;
} item;

static int by_height(const void *left, const void *right)
{
    const item *a = left, *b = right;
    return a->height != b->height ? (a->height < b->height) - (a->height > b->height)
                                  : (a->group > b->group) - (a->group < b->group);
}

/* A group alone stands at those borders of its image at which it stands in the tile: sep flags what is cut
 * off there. Not where noise beyond the right and the upper border would be read. */
static void place_alone(const rx_threshold *image, const rx_group *g, int group, rx_cutouts *dst)
{
    const bool open = image->sigma == NULL;
    const int left = g->xmin > 0 ? RING : 0, low = g->ymin > 0 ? RING : 0;
    const int right = g->xmax == image->width - 1 && open ? 0 : RING;
    const int high = g->ymax == image->height - 1 && open ? 0 : RING;
    dst->list[0] = (rx_cutout){group, left, low};
    dst->width = left + g->xmax - g->xmin + 1 + right;
    dst->height = low + g->ymax - g->ymin + 1 + high;
}

/* Places for the groups and the size of the image. */
static void lay_out(const rx_groups *groups, const item *items, rx_cutouts *dst)
{
    double area = 0.0;
    int widest = LEAST_WIDTH, x = 0, y = 0, height = 0;
    for (int i = 0; i < dst->n; i++) {
        const rx_group *g = &groups->list[items[i].group];
        area += (double)rx_cutout_area(g);
        widest = width_of(g) > widest ? width_of(g) : widest;
    }
    dst->width = sqrt(area) > widest ? (int)sqrt(area) : widest;
    for (int i = 0; i < dst->n; i++) {
        const rx_group *g = &groups->list[items[i].group];
        if (x + width_of(g) > dst->width) {
            y += height;
            x = height = 0;
        }
        height = items[i].height > height ? items[i].height : height;
        dst->list[i] = (rx_cutout){items[i].group, x + RING, y + RING};
        x += width_of(g);
    }
    dst->height = y + height;
}

static void index_shelves(const rx_groups *groups, rx_cutouts *dst)
{
    for (int i = 0; i < dst->n; i++) {
        const int y = dst->list[i].y - RING;
        if (i > 0 && dst->list[i - 1].y == dst->list[i].y)
            continue;
        /* the first of a shelf is its highest */
        for (int v = y > 0 ? y : 0; v < y + height_of(&groups->list[dst->list[i].group]) && v < dst->height;
             v++)
            dst->shelf[v] = i;
    }
}

static void fill(const rx_threshold *image, const float *sigma, const rx_groups *groups, const rx_cutout *cut,
                 rx_cutouts *dst)
{
    const rx_group *g = &groups->list[cut->group];
    const size_t row = (size_t)dst->width;
    /* where thresholds are relative */
    const float around = image->sigma != NULL ? g->lowest / image->limit * ROUNDING : NOTHING;
    for (int v = cut->y - RING; v <= cut->y + g->ymax - g->ymin + RING && sigma != NULL; v++)
        for (int u = cut->x - RING; u <= cut->x + g->xmax - g->xmin + RING; u++)
            if (u >= 0 && v >= 0 && u < dst->width && v < dst->height)
                dst->noise[(size_t)v * row + (size_t)u] = around;
    for (const rx_span *s = groups->spans + g->first; s < groups->spans + g->first + g->nspans; s++) {
        const size_t from = (size_t)s->y * (size_t)image->width + (size_t)s->x0;
        const size_t to = (size_t)(cut->y + s->y - g->ymin) * row + (size_t)(cut->x + s->x0 - g->xmin);
        const size_t bytes = (size_t)(s->x1 - s->x0) * sizeof(float);
        memcpy(dst->pixels + to, image->filtered + from, bytes);
        if (sigma != NULL)
            memcpy(dst->noise + to, sigma + from, bytes);
    }
}

rx_status rx_cutouts_make(const rx_threshold *image, const float *sigma, const rx_groups *groups,
                          const int *wanted, int n, rx_cutouts *dst, rx_error *err)
{
    rx_status status = RX_OK;
    *dst = (rx_cutouts){.n = n};
    item *items = RX_NEW(item, (size_t)n);
    dst->list = RX_NEW(rx_cutout, (size_t)n);
    if (items == NULL || dst->list == NULL) {
        status = rx_error_memory(err, (size_t)n * sizeof *items);
        goto exit;
    }
    for (int i = 0; i < n; i++)
        items[i] = (item){height_of(&groups->list[wanted[i]]), wanted[i]};
    qsort(items, (size_t)n, sizeof *items, by_height);
    if (n == 1)
        place_alone(image, &groups->list[items[0].group], items[0].group, dst);
    else
        lay_out(groups, items, dst);
    const size_t area = (size_t)dst->width * (size_t)dst->height;
    dst->pixels = RX_NEW(float, area);
    dst->shelf = RX_NEW(int, (size_t)dst->height);
    if (sigma != NULL)
        dst->noise = RX_NEW(float, area);
    if (dst->pixels == NULL || dst->shelf == NULL || (sigma != NULL && dst->noise == NULL)) {
        status = rx_error_memory(err, area * sizeof(float));
        goto exit;
    }
    for (size_t k = 0; k < area && sigma != NULL; k++)
        dst->noise[k] = NOTHING;
    index_shelves(groups, dst);
    for (int i = 0; i < n; i++)
        fill(image, sigma, groups, &dst->list[i], dst);
exit:
    free(items);
    return status;
}

const rx_cutout *rx_cutouts_at(const rx_cutouts *cutouts, int x, int y)
{
    int i = cutouts->shelf[y];
    while (i + 1 < cutouts->n && cutouts->list[i + 1].y == cutouts->list[i].y &&
           cutouts->list[i + 1].x - RING <= x)
        i++;
    return &cutouts->list[i];
}

void rx_cutouts_free(rx_cutouts *cutouts)
{
    free(cutouts->pixels);
    free(cutouts->noise);
    free(cutouts->list);
    free(cutouts->shelf);
    *cutouts = (rx_cutouts){0};
}
