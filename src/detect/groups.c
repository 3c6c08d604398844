/* Groups as spans of rows: strips find spans, a union of spans that touch makes groups. */
#include "detect/groups.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "detect/threshold_noise.h"

enum { STRIP = 64, BLOCK = 32 };

/* Spans of one strip, in scan order, and their values. */
typedef struct strip {
    rx_span *spans;
    long n, room, above;
    float *values;
    size_t nvalues, room_values;
    bool failed; /* no memory */
} strip;

/* A row of the filtered image, and of the noise where it varies: after the filter and before. */
typedef struct row {
    int y, width;
    const float *filtered, *sigma, *noise;
    float limit;
    bool relative;
} row;

static bool is_above(const row *r, int x)
{
    return r->filtered[x] > (r->relative ? r->limit * r->sigma[x] : r->limit);
}

/* Is any of the BLOCK pixels from x above its threshold? Most of a tile is not. */
static bool any_above(const row *r, int x)
{
    const float *filtered = r->filtered + x, limit = r->limit;
    int any = 0;
    if (r->relative) {
        const float *sigma = r->sigma + x;
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

static bool make_room(strip *dst, size_t values)
{
    if (dst->n == dst->room) {
        const long room = dst->room > 0 ? 2 * dst->room : 256;
        rx_span *spans = rx_regrow(dst->spans, (size_t)room, sizeof *spans);
        if (spans == NULL)
            return false;
        dst->spans = spans;
        dst->room = room;
    }
    if (dst->nvalues + values > dst->room_values) {
        const size_t room = 2 * dst->room_values + values + 1024;
        float *all = rx_regrow(dst->values, room, sizeof *all);
        if (all == NULL)
            return false;
        dst->values = all;
        dst->room_values = room;
    }
    return true;
}

static void add_span(const row *r, int x0, int x1, strip *dst)
{
    const size_t n = (size_t)(x1 - x0);
    if (!make_room(dst, 3 * n)) {
        dst->failed = true;
        return;
    }
    const float *rows[] = {r->filtered, r->sigma, r->noise};
    for (int i = 0; i < 3 && rows[i] != NULL; i++, dst->nvalues += n)
        memcpy(dst->values + dst->nvalues, rows[i] + x0, n * sizeof(float));
    dst->spans[dst->n++] = (rx_span){.y = r->y, .x0 = x0, .x1 = x1};
    dst->above += x1 - x0;
}

static void scan_row(const row *r, strip *dst)
{
    int start = -1; /* of the open span */
    for (int x = 0; x < r->width && !dst->failed;) {
        if (start < 0 && x + BLOCK <= r->width && !any_above(r, x)) {
            x += BLOCK;
            continue;
        }
        const int last = x + BLOCK < r->width ? x + BLOCK : r->width;
        for (; x < last; x++) {
            const bool above = is_above(r, x);
            if (above && start < 0)
                start = x;
            if (!above && start >= 0) {
                add_span(r, start, x, dst);
                start = -1;
            }
        }
    }
    if (start >= 0 && !dst->failed)
        add_span(r, start, r->width, dst);
}

/* The rows from y0 on; spans get their values when these do not move any more. */
static void scan_strip(const rx_threshold *t, int y0, rx_noise_strip *noise, strip *dst)
{
    const int y1 = y0 + STRIP < t->height ? y0 + STRIP : t->height, kinds = t->noise != NULL ? 3 : 1;
    row r = {.width = t->width, .limit = t->limit, .relative = t->relative != 0};
    if (t->noise != NULL)
        rx_noise_strip_make(t->noise, y0, y1, noise);
    for (r.y = y0; r.y < y1 && !dst->failed; r.y++) {
        r.filtered = t->filtered + (size_t)r.y * (size_t)t->width;
        if (t->noise != NULL) {
            rx_noise_strip_filter(t->noise, r.y, noise);
            r.sigma = noise->sigma;
            r.noise = rx_noise_strip_row(noise, r.y);
        }
        scan_row(&r, dst);
    }
    const float *values = dst->values;
    for (long i = 0; i < dst->n && !dst->failed; i++) {
        dst->spans[i].values = values;
        values += (ptrdiff_t)kinds * (dst->spans[i].x1 - dst->spans[i].x0);
    }
}

/* All strips, each thread with the noise of one at a time. */
static void scan_strips(const rx_threshold *t, int nstrips, int nthreads, strip *strips)
{
#pragma omp parallel num_threads(nthreads > 0 ? nthreads : 1)
    {
        rx_noise_strip noise = {0};
        const bool room = t->noise == NULL || rx_noise_strip_new(t->noise, STRIP, &noise);
#pragma omp for schedule(static)
        for (int s = 0; s < nstrips; s++) {
            strips[s].failed = !room;
            if (room)
                scan_strip(t, s * STRIP, &noise, &strips[s]);
        }
        rx_noise_strip_free(&noise);
    }
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
    float lowest = t->limit;
    for (int x = span->x0; x < span->x1 && t->relative; x++) {
        const float own = t->limit * rx_span_sigma(span, x);
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
    if (found == NULL || places == NULL || rank == NULL || dst->list == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)dst->n * sizeof *found));
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
    RX_TRY(RX_MAKE(dst->spans, (size_t)dst->nspans, err));
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

/* The strips' spans one after the other in spans[n]; their values go to the groups. */
static void join(strip *strips, int nstrips, rx_span *spans, rx_groups *dst)
{
    long n = 0;
    for (int s = 0; s < nstrips; n += strips[s++].n) {
        if (strips[s].n > 0)
            memcpy(spans + n, strips[s].spans, (size_t)strips[s].n * sizeof *spans);
        free(strips[s].spans);
        strips[s].spans = NULL;
        dst->blocks[dst->nblocks++] = strips[s].values;
        strips[s].values = NULL;
    }
}

rx_status rx_groups_find(const rx_threshold *threshold, int nthreads, rx_groups *dst, rx_error *err)
{
    const int nstrips = (threshold->height + STRIP - 1) / STRIP;
    rx_status status = RX_OK;
    rx_span *spans = NULL;
    long *parent = NULL;
    bool failed = false;
    *dst = (rx_groups){0};
    strip *strips;
    RX_TRY(RX_MAKE(strips, (size_t)nstrips, err));
    scan_strips(threshold, nstrips, nthreads, strips);
    for (int s = 0; s < nstrips; s++) {
        failed |= strips[s].failed;
        dst->nspans += strips[s].n;
        dst->above += strips[s].above;
    }
    spans = RX_NEW(rx_span, (size_t)dst->nspans);
    parent = RX_NEW(long, (size_t)dst->nspans);
    dst->blocks = RX_NEW(float *, (size_t)nstrips);
    if (failed || spans == NULL || parent == NULL || dst->blocks == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)dst->nspans * sizeof *spans));
    join(strips, nstrips, spans, dst);
    connect(spans, dst->nspans, parent);
    RX_TRY_EXIT(make_list(threshold, spans, parent, dst, err));
    status = gather(spans, parent, dst, err);
exit:
    for (int s = 0; s < nstrips; s++) {
        free(strips[s].spans);
        free(strips[s].values);
    }
    free(strips);
    free(spans);
    free(parent);
    return status;
}

void rx_groups_free(rx_groups *groups)
{
    for (int i = 0; i < groups->nblocks; i++)
        free(groups->blocks[i]);
    free(groups->blocks);
    free(groups->list);
    free(groups->spans);
    *groups = (rx_groups){0};
}

const rx_span *rx_groups_span(const rx_groups *groups, int group, const rx_span *last, int x, int y)
{
    if (last != NULL && last->y == y && last->x0 <= x && x < last->x1)
        return last;
    const rx_group *g = &groups->list[group];
    const rx_span *spans = groups->spans + g->first;
    int low = 0, high = g->nspans; /* the last one that does not begin behind the pixel */
    while (high - low > 1) {
        const int middle = low + (high - low) / 2;
        const rx_span *s = &spans[middle];
        if (s->y < y || (s->y == y && s->x0 <= x))
            low = middle;
        else
            high = middle;
    }
    return spans[low].y == y && spans[low].x0 <= x && x < spans[low].x1 ? &spans[low] : NULL;
}
