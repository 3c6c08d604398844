/* Pixels rise out of the water one by one, the brightest first; what stands is a forest of trees. */
#include "detect/deblendable.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static const double ROUNDING = 1.0 - 1e-4; /* the deblender adds up in single precision */
enum { DIGITS = 4, RADIX = 256 };

static rx_status make_room(rx_deblendable *work, size_t n, rx_error *err)
{
    if (n <= work->room)
        return RX_OK;
    rx_deblendable_free(work);
    n += n / 2;
    work->values = RX_NEW(float, n);
    work->order = RX_NEW(uint64_t, n);
    work->spare = RX_NEW(uint64_t, n);
    work->parent = RX_NEW(int, n);
    work->size = RX_NEW(int, n);
    work->sum = RX_NEW(double, n);
    if (work->values == NULL || work->order == NULL || work->spare == NULL || work->parent == NULL ||
        work->size == NULL || work->sum == NULL) {
        rx_deblendable_free(work);
        return rx_error_memory(err, n * sizeof(double));
    }
    work->room = n;
    return RX_OK;
}

/* The group in its box; returns the sum of its values. */
static double cut(const rx_groups *groups, int group, int width, rx_deblendable *work)
{
    const rx_group *g = &groups->list[group];
    double sum = 0.0;
    memset(work->values, 0, (size_t)width * (size_t)(g->ymax - g->ymin + 3) * sizeof(float));
    for (const rx_span *s = groups->spans + g->first; s < groups->spans + g->first + g->nspans; s++) {
        const float *from = s->values;
        float *to = work->values + (size_t)(s->y - g->ymin + 1) * (size_t)width + (s->x0 - g->xmin + 1);
        memcpy(to, from, (size_t)(s->x1 - s->x0) * sizeof *to);
        for (int i = 0; i < s->x1 - s->x0; i++)
            sum += from[i];
    }
    return sum;
}

/* Places of the eight neighbours. */
static void set_around(int width, int around[8])
{
    const int places[8] = {-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1};
    memcpy(around, places, sizeof places);
}

/* Lists the pixels, and says whether two of them have no higher neighbour. */
static bool list_pixels(const rx_groups *groups, const rx_group *g, int width, rx_deblendable *work, int *n)
{
    int around[8], summits = 0;
    set_around(width, around);
    *n = 0;
    for (const rx_span *s = groups->spans + g->first; s < groups->spans + g->first + g->nspans; s++)
        for (int x = s->x0; x < s->x1; x++) {
            const int at = (s->y - g->ymin + 1) * width + (x - g->xmin + 1);
            const float *value = work->values + at;
            uint32_t bits;
            memcpy(&bits, value, sizeof bits); /* positive: in the order of the values */
            work->order[(*n)++] = (uint64_t)bits << 32 | (uint32_t)at;
            bool higher = false;
            for (int i = 0; i < 8; i++)
                higher |= value[around[i]] > *value;
            summits += !higher;
        }
    return summits > 1;
}

/* Ascending by the upper half, digit by digit. */
static void sort(rx_deblendable *work, int n)
{
    for (int digit = 0; digit < DIGITS; digit++) {
        const int shift = 32 + 8 * digit;
        int start[RADIX + 1] = {0};
        for (int i = 0; i < n; i++)
            start[(work->order[i] >> shift & (RADIX - 1)) + 1]++;
        for (int i = 0; i < RADIX; i++)
            start[i + 1] += start[i];
        for (int i = 0; i < n; i++)
            work->spare[start[work->order[i] >> shift & (RADIX - 1)]++] = work->order[i];
        uint64_t *swap = work->order;
        work->order = work->spare;
        work->spare = swap;
    }
}

static int find_root(int *parent, int i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

/* Does it count as a part of its own, at the threshold `level`? */
static bool stands(const rx_deblendable *work, int root, double level, int min_area, double flux)
{
    return work->size[root] >= min_area && work->sum[root] - level * work->size[root] > flux;
}

static bool flood(rx_deblendable *work, int n, int width, int min_area, double flux)
{
    int around[8];
    set_around(width, around);
    for (int i = 0; i < n; i++)
        work->parent[(uint32_t)work->order[i]] = -1;
    for (int i = n - 1; i >= 0; i--) {
        const int at = (int)(uint32_t)work->order[i];
        const double level = (double)work->values[at];
        int root = at;
        work->parent[at] = at;
        work->size[at] = 1;
        work->sum[at] = level;
        for (int k = 0; k < 8; k++) {
            const int near = at + around[k];
            if (!(work->values[near] > 0.0f) || work->parent[near] < 0)
                continue;
            const int other = find_root(work->parent, near);
            if (other == root)
                continue;
            if (stands(work, root, level, min_area, flux) && stands(work, other, level, min_area, flux))
                return true;
            const int large = work->size[other] > work->size[root] ? other : root;
            const int small = large == root ? other : root;
            work->parent[small] = large;
            work->size[large] += work->size[small];
            work->sum[large] += work->sum[small];
            root = large;
        }
    }
    return false;
}

rx_status rx_deblendable_test(const rx_groups *groups, int group, int min_area, double contrast,
                              rx_deblendable *work, int *splits, rx_error *err)
{
    const rx_group *g = &groups->list[group];
    const int width = g->xmax - g->xmin + 3, height = g->ymax - g->ymin + 3;
    int n = 0;
    rx_status status = make_room(work, (size_t)width * (size_t)height, err);
    *splits = 0;
    if (status != RX_OK)
        return status;
    const double sum = cut(groups, group, width, work);
    if (!list_pixels(groups, g, width, work, &n))
        return RX_OK;
    sort(work, n);
    *splits = flood(work, n, width, min_area, sum * contrast * ROUNDING);
    return RX_OK;
}

void rx_deblendable_free(rx_deblendable *work)
{
    free(work->values);
    free(work->order);
    free(work->spare);
    free(work->parent);
    free(work->size);
    free(work->sum);
    *work = (rx_deblendable){0};
}
