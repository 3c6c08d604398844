/* Groups as spans of rows: strips find spans, a union of spans that touch makes groups. */
#include "detect/groups.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { STRIP = 64, BLOCK = 32 };

/* Spans of one strip, in scan order. */
typedef struct strip {
    rx_span *spans;
    long n, room, above;
    bool failed; /* no memory */
} strip;

static bool is_above(const rx_threshold *t, size_t k)
{
    return t->filtered[k] > (t->sigma != NULL ? t->limit * t->sigma[k] : t->limit);
}

/* Is any of the BLOCK pixels from k above its threshold? Most of a tile is not. */
static bool any_above(const rx_threshold *t, size_t k)
{
    const float *filtered = t->filtered + k, limit = t->limit;
    int any = 0;
    if (t->sigma != NULL) {
        const float *sigma = t->sigma + k;
#pragma omp simd reduction(| : any)
        for (int i = 0; i < BLOCK; i++)
            any |= filtered[i] > limit * sigma[i];
    } else {
#pragma omp simd reduction(| : any)
        for (int i = 0; i < BLOCK; i++)
            any |= filtered[i] > limit;
    }
    return any != 0;
}

static void add_span(strip *dst, int y, int x0, int x1)
{
    if (dst->n == dst->room) {
        long room = dst->room > 0 ? 2 * dst->room : 256;
        rx_span *spans = rx_regrow(dst->spans, (size_t)room, sizeof *spans);
        if (spans == NULL) {
            dst->failed = true;
            return;
        }
        dst->spans = spans;
        dst->room = room;
    }
    dst->spans[dst->n++] = (rx_span){.y = y, .x0 = x0, .x1 = x1};
    dst->above += x1 - x0;
}

static void scan_row(const rx_threshold *t, int y, strip *dst)
{
    const size_t row = (size_t)y * (size_t)t->width;
    int start = -1; /* of the open span */
    for (int x = 0; x < t->width && !dst->failed;) {
        if (start < 0 && x + BLOCK <= t->width && !any_above(t, row + (size_t)x)) {
            x += BLOCK;
            continue;
        }
        const int last = x + BLOCK < t->width ? x + BLOCK : t->width;
        for (; x < last; x++) {
            const bool above = is_above(t, row + (size_t)x);
            if (above && start < 0)
                start = x;
            if (!above && start >= 0) {
                add_span(dst, y, start, x);
                start = -1;
            }
        }
    }
    if (start >= 0 && !dst->failed)
        add_span(dst, y, start, t->width);
}

static long find_root(long *parent, long i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

/* The first span of a group is its root. */
static void unite(long *parent, long i, long j)
{
    i = find_root(parent, i);
    j = find_root(parent, j);
    if (i < j)
        parent[j] = i;
    else
        parent[i] = j;
}

/* Spans of neighbouring rows that touch, also over a corner. */
static void connect(const rx_span *spans, long n, long *parent)
{
    long below = 0; /* first span of the row before that may touch */
    for (long i = 0; i < n; i++) {
        parent[i] = i;
        while (below < i && (spans[below].y < spans[i].y - 1 ||
                             (spans[below].y == spans[i].y - 1 && spans[below].x1 < spans[i].x0)))
            below++;
        for (long j = below; j < i && spans[j].y == spans[i].y - 1 && spans[j].x0 <= spans[i].x1; j++)
            unite(parent, i, j);
    }
}

static float lowest_threshold(const rx_threshold *t, const rx_span *span)
{
    const size_t row = (size_t)span->y * (size_t)t->width;
    float lowest = t->limit;
    for (int x = span->x0; x < span->x1 && t->sigma != NULL; x++) {
        const float own = t->limit * t->sigma[row + (size_t)x];
        if (x == span->x0 || own < lowest)
            lowest = own;
    }
    return lowest;
}

static void extend(const rx_threshold *t, const rx_span *span, rx_group *group)
{
    const float lowest = lowest_threshold(t, span);
    if (group->size == 0)
        *group = (rx_group){.xmin = span->x0, .xmax = span->x1 - 1, .ymin = span->y, .lowest = lowest};
    group->size += span->x1 - span->x0;
    group->xmin = span->x0 < group->xmin ? span->x0 : group->xmin;
    group->xmax = span->x1 - 1 > group->xmax ? span->x1 - 1 : group->xmax;
    group->ymax = span->y;
    group->end = span->x1;
    group->lowest = lowest < group->lowest ? lowest : group->lowest;
    group->nspans++;
}

/* Number of a group in the list, and what it is sorted by. */
typedef struct place {
    int ymax, end, number;
} place;

static int by_completion(const void *left, const void *right)
{
    const place *a = left, *b = right;
    return a->ymax != b->ymax ? (a->ymax > b->ymax) - (a->ymax < b->ymax)
                              : (a->end > b->end) - (a->end < b->end);
}

/* Groups from the roots of spans, sorted; `parent` becomes the number of each span's group. */
static rx_status make_list(const rx_threshold *t, const rx_span *spans, long *parent, rx_groups *dst,
                           rx_error *err)
{
    rx_status status = RX_OK;
    rx_group *found = NULL;
    place *places = NULL;
    int *rank = NULL;
    for (long i = 0; i < dst->nspans; i++) /* -1 - number of the group; parents come first */
        parent[i] = parent[i] == i ? -1 - dst->n++ : parent[parent[i]];
    found = RX_NEW(rx_group, (size_t)dst->n);
    places = RX_NEW(place, (size_t)dst->n);
    rank = RX_NEW(int, (size_t)dst->n);
    dst->list = RX_NEW(rx_group, (size_t)dst->n);
    if (found == NULL || places == NULL || rank == NULL || dst->list == NULL) {
        status = rx_error_memory(err, (size_t)dst->n * sizeof *found);
        goto exit;
    }
    for (long i = 0; i < dst->nspans; i++)
        extend(t, &spans[i], &found[-1 - parent[i]]);
    for (int i = 0; i < dst->n; i++)
        places[i] = (place){found[i].ymax, found[i].end, i};
    qsort(places, (size_t)dst->n, sizeof *places, by_completion);
    for (int i = 0; i < dst->n; i++) {
        dst->list[i] = found[places[i].number];
        rank[places[i].number] = i;
    }
    for (long i = 0; i < dst->nspans; i++)
        parent[i] = rank[-1 - parent[i]];
exit:
    free(found);
    free(places);
    free(rank);
    return status;
}

/* Spans of a group next to each other. */
static rx_status gather(const rx_span *spans, const long *group, rx_groups *dst, rx_error *err)
{
    long first = 0;
    dst->spans = RX_NEW(rx_span, (size_t)dst->nspans);
    if (dst->spans == NULL)
        return rx_error_memory(err, (size_t)dst->nspans * sizeof *dst->spans);
    for (int i = 0; i < dst->n; i++) {
        dst->list[i].first = first;
        first += dst->list[i].nspans;
        dst->list[i].nspans = 0;
    }
    for (long i = 0; i < dst->nspans; i++) {
        rx_group *owner = &dst->list[group[i]];
        rx_span *span = &dst->spans[owner->first + owner->nspans++];
        *span = spans[i];
        span->group = (int)group[i];
    }
    return RX_OK;
}

rx_status rx_groups_find(const rx_threshold *threshold, int nthreads, rx_groups *dst, rx_error *err)
{
    const int nstrips = (threshold->height + STRIP - 1) / STRIP;
    rx_status status = RX_OK;
    rx_span *spans = NULL;
    long *parent = NULL, n = 0;
    bool failed = false;
    *dst = (rx_groups){0};
    strip *strips = RX_NEW(strip, (size_t)nstrips);
    if (strips == NULL)
        return rx_error_memory(err, (size_t)nstrips * sizeof *strips);
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1)
    for (int s = 0; s < nstrips; s++)
        for (int y = s * STRIP; y < (s + 1) * STRIP && y < threshold->height; y++)
            scan_row(threshold, y, &strips[s]);
    for (int s = 0; s < nstrips; s++) {
        failed |= strips[s].failed;
        dst->nspans += strips[s].n;
        dst->above += strips[s].above;
    }
    spans = RX_NEW(rx_span, (size_t)dst->nspans);
    parent = RX_NEW(long, (size_t)dst->nspans);
    if (failed || spans == NULL || parent == NULL) {
        status = rx_error_memory(err, (size_t)dst->nspans * sizeof *spans);
        goto exit;
    }
    for (int s = 0; s < nstrips; n += strips[s++].n)
        if (strips[s].n > 0)
            memcpy(spans + n, strips[s].spans, (size_t)strips[s].n * sizeof *spans);
    connect(spans, n, parent);
    status = make_list(threshold, spans, parent, dst, err);
    if (status == RX_OK)
        status = gather(spans, parent, dst, err);
exit:
    for (int s = 0; s < nstrips; s++)
        free(strips[s].spans);
    free(strips);
    free(spans);
    free(parent);
    return status;
}

void rx_groups_free(rx_groups *groups)
{
    free(groups->list);
    free(groups->spans);
    *groups = (rx_groups){0};
}
