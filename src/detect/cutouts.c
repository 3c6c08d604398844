/* Shelves: the highest groups first, from left to right, then the next shelf. */
#include "detect/cutouts.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"

enum { LEAST_WIDTH = 64 };
static const float NOTHING = FLT_MAX;       /* noise where there is no pixel */
static const float ROUNDING = 1.0f + 2e-6f; /* of threshold * (lowest / threshold) in float */

static int width_of(const rx_group *g, int ring)
{
    return g->xmax - g->xmin + 1 + 2 * ring;
}

static int height_of(const rx_group *g, int ring)
{
    return g->ymax - g->ymin + 1 + 2 * ring;
}

long rx_cutout_area(const rx_group *group)
{
    return (long)width_of(group, 1) * height_of(group, 1);
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
static void place_alone(const rx_threshold *image, const rx_group *g, int group, bool noisy, rx_cutouts *dst)
{
    const bool open = !noisy;
    const int left = g->xmin > 0 ? dst->ring : 0, low = g->ymin > 0 ? dst->ring : 0;
    const int right = g->xmax == image->width - 1 && open ? 0 : dst->ring;
    const int high = g->ymax == image->height - 1 && open ? 0 : dst->ring;
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
        widest = width_of(g, dst->ring) > widest ? width_of(g, dst->ring) : widest;
    }
    dst->width = sqrt(area) > widest ? (int)sqrt(area) : widest;
    for (int i = 0; i < dst->n; i++) {
        const rx_group *g = &groups->list[items[i].group];
        if (x + width_of(g, dst->ring) > dst->width) {
            y += height;
            x = height = 0;
        }
        height = items[i].height > height ? items[i].height : height;
        dst->list[i] = (rx_cutout){items[i].group, x + dst->ring, y + dst->ring};
        x += width_of(g, dst->ring);
    }
    dst->height = y + height;
}

static void index_shelves(const rx_groups *groups, rx_cutouts *dst)
{
    for (int i = 0; i < dst->n; i++) {
        const int y = dst->list[i].y - dst->ring;
        if (i > 0 && dst->list[i - 1].y == dst->list[i].y)
            continue;
        /* the first of a shelf is its highest */
        for (int v = y > 0 ? y : 0;
             v < y + height_of(&groups->list[dst->list[i].group], dst->ring) && v < dst->height; v++)
            dst->shelf[v] = i;
    }
}

static void fill(const rx_threshold *image, const rx_groups *groups, const rx_cutout *cut, rx_cutouts *dst)
{
    const rx_group *g = &groups->list[cut->group];
    const size_t row = (size_t)dst->width;
    /* where thresholds are relative */
    const float around = image->relative ? g->lowest / image->limit * ROUNDING : NOTHING;
    for (int v = cut->y - 1; v <= cut->y + g->ymax - g->ymin + 1 && image->noise != NULL; v++)
        for (int u = cut->x - 1; u <= cut->x + g->xmax - g->xmin + 1; u++)
            if (u >= 0 && v >= 0 && u < dst->width && v < dst->height)
                dst->noise[(size_t)v * row + (size_t)u] = around;
    for (const rx_span *s = groups->spans + g->first; s < groups->spans + g->first + g->nspans; s++) {
        const size_t to = (size_t)(cut->y + s->y - g->ymin) * row + (size_t)(cut->x + s->x0 - g->xmin);
        const size_t n = (size_t)(s->x1 - s->x0);
        memcpy(dst->pixels + to, s->values, n * sizeof(float));
        if (image->noise != NULL)
            memcpy(dst->noise + to, s->values + n, n * sizeof(float));
    }
}

/* The pixels of a group's box before the filter, and the noise of its own. */
static void fill_unfiltered(const rx_threshold *image, const rx_groups *groups,
                            const rx_unfiltered *unfiltered, const rx_cutout *cut, rx_cutouts *dst)
{
    const rx_group *g = &groups->list[cut->group];
    const size_t row = (size_t)dst->width;
    const int dx = g->xmin - cut->x, dy = g->ymin - cut->y; /* from the packed image to the tile */
    const int left = rx_max_int(rx_max_int(cut->x - dst->ring, 0), -dx);
    const int right =
        rx_min_int(rx_min_int(cut->x + g->xmax - g->xmin + dst->ring + 1, dst->width), image->width - dx);
    const int low = rx_max_int(rx_max_int(cut->y - dst->ring, 0), -dy);
    const int high =
        rx_min_int(rx_min_int(cut->y + g->ymax - g->ymin + dst->ring + 1, dst->height), image->height - dy);
    for (int v = low; v < high; v++)
        memcpy(dst->pixels + (size_t)v * row + (size_t)left,
               unfiltered->pixels + (size_t)(v + dy) * (size_t)image->width + (size_t)(left + dx),
               (size_t)(right - left) * sizeof(float));
    for (const rx_span *s = groups->spans + g->first; s < groups->spans + g->first + g->nspans; s++) {
        float *noise = dst->noise + (size_t)(s->y - dy) * row;
        for (int x = s->x0; x < s->x1; x++)
            noise[x - dx] = image->noise != NULL ? rx_span_sigma(s, x) : unfiltered->noise_value;
    }
}

/* Around a group: what gives its lowest threshold, or as much more as keeps the neighbour below. */
static void fence(const rx_groups *groups, const rx_unfiltered *unfiltered, const rx_cutout *cut,
                  const float *filtered, rx_cutouts *dst)
{
    const rx_group *g = &groups->list[cut->group];
    const int dx = g->xmin - cut->x, dy = g->ymin - cut->y;
    for (const rx_span *s = groups->spans + g->first; s < groups->spans + g->first + g->nspans; s++)
        for (int v = rx_max_int(s->y - dy - 1, 0); v <= s->y - dy + 1 && v < dst->height; v++)
            for (int u = rx_max_int(s->x0 - dx - 1, 0); u <= s->x1 - dx && u < dst->width; u++) {
                const size_t k = (size_t)v * (size_t)dst->width + (size_t)u;
                if (dst->noise[k] == NOTHING)
                    dst->noise[k] = fmaxf(g->lowest, filtered[k]) / (float)unfiltered->threshold * ROUNDING;
            }
}

static rx_status fill_all_unfiltered(const rx_threshold *image, const rx_groups *groups,
                                     const rx_unfiltered *unfiltered, rx_cutouts *dst, rx_error *err)
{
    const size_t area = (size_t)dst->width * (size_t)dst->height;
    float *filtered;
    RX_TRY(RX_MAKE(filtered, area, err));
    for (int i = 0; i < dst->n; i++)
        fill_unfiltered(image, groups, unfiltered, &dst->list[i], dst);
    rx_filter_plane(unfiltered->kernel, dst->pixels, dst->width, dst->height, 1, filtered);
    for (int i = 0; i < dst->n; i++)
        fence(groups, unfiltered, &dst->list[i], filtered, dst);
    free(filtered);
    return RX_OK;
}

rx_status rx_cutouts_make(const rx_threshold *image, const rx_groups *groups, const rx_unfiltered *unfiltered,
                          const int *wanted, int n, rx_cutouts *dst, rx_error *err)
{
    rx_status status = RX_OK;
    const bool noisy = image->noise != NULL || unfiltered != NULL;
    *dst = (rx_cutouts){.n = n, .ring = 1};
    if (unfiltered != NULL)
        dst->ring += rx_max_int(unfiltered->kernel->width, unfiltered->kernel->height) / 2;
    item *items = RX_NEW(item, (size_t)n);
    dst->list = RX_NEW(rx_cutout, (size_t)n);
    if (items == NULL || dst->list == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)n * sizeof *items));
    for (int i = 0; i < n; i++)
        items[i] = (item){height_of(&groups->list[wanted[i]], dst->ring), wanted[i]};
    qsort(items, (size_t)n, sizeof *items, by_height);
    if (n == 1)
        place_alone(image, &groups->list[items[0].group], items[0].group,
                    unfiltered != NULL || image->relative, dst);
    else
        lay_out(groups, items, dst);
    const size_t area = (size_t)dst->width * (size_t)dst->height;
    dst->pixels = RX_NEW(float, area);
    dst->shelf = RX_NEW(int, (size_t)dst->height);
    if (noisy)
        dst->noise = RX_NEW(float, area);
    if (dst->pixels == NULL || dst->shelf == NULL || (noisy && dst->noise == NULL))
        RX_TRY_EXIT(rx_error_memory(err, area * sizeof(float)));
    for (size_t k = 0; k < area && noisy; k++)
        dst->noise[k] = NOTHING;
    index_shelves(groups, dst);
    if (unfiltered != NULL)
        status = fill_all_unfiltered(image, groups, unfiltered, dst, err);
    for (int i = 0; i < n && unfiltered == NULL; i++)
        fill(image, groups, &dst->list[i], dst);
exit:
    free(items);
    return status;
}

const rx_cutout *rx_cutouts_at(const rx_cutouts *cutouts, int x, int y)
{
    int i = cutouts->shelf[y];
    while (i + 1 < cutouts->n && cutouts->list[i + 1].y == cutouts->list[i].y &&
           cutouts->list[i + 1].x - cutouts->ring <= x)
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
