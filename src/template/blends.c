/* Neighbours by a grid of cells, groups by a union of sets. */
#include "template/blends.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "template/patch.h"

enum { CELL = 48 }; /* pixels */

typedef struct links {
    rx_blend_link *list;
    size_t n, room;
} links;

/* Cells that each footprint touches, as lists. */
typedef struct cells {
    int nx, ny;
    size_t *start; /* [nx * ny + 1] */
    int *member;
} cells;

static rx_status fill_cells(const rx_footprint *const *f, int n, int width, int height, cells *c,
                            rx_error *err)
{
    c->nx = (width + CELL - 1) / CELL;
    c->ny = (height + CELL - 1) / CELL;
    const size_t count = (size_t)c->nx * (size_t)c->ny;
    c->start = RX_NEW(size_t, count + 2);
    if (c->start == NULL)
        return rx_error_memory(err, (count + 2) * sizeof(size_t));
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < n; i++) {
            if (f[i]->width == 0)
                continue;
            for (int y = f[i]->y0 / CELL; y <= (f[i]->y0 + f[i]->height - 1) / CELL; y++)
                for (int x = f[i]->x0 / CELL; x <= (f[i]->x0 + f[i]->width - 1) / CELL; x++) {
                    size_t *next = &c->start[(size_t)y * (size_t)c->nx + (size_t)x + (pass == 0 ? 2 : 1)];
                    if (pass == 1)
                        c->member[*next] = i;
                    (*next)++;
                }
        }
        if (pass == 1)
            break;
        for (size_t k = 1; k <= count + 1; k++)
            c->start[k] += c->start[k - 1];
        c->member = RX_NEW(int, c->start[count + 1]);
        if (c->member == NULL)
            return rx_error_memory(err, c->start[count + 1] * sizeof(int));
    }
    return RX_OK;
}

/* Do the boxes meet, and is this the one cell that counts it: that of the intersection's first corner? */
static int meet(const rx_footprint *a, const rx_footprint *b, int cx, int cy)
{
    const int x0 = a->x0 > b->x0 ? a->x0 : b->x0, y0 = a->y0 > b->y0 ? a->y0 : b->y0;
    return x0 / CELL == cx && y0 / CELL == cy && x0 < a->x0 + a->width && x0 < b->x0 + b->width &&
           y0 < a->y0 + a->height && y0 < b->y0 + b->height;
}

static rx_status list_pairs(const rx_footprint *const *f, const cells *c, links *l, rx_error *err)
{
    for (int y = 0; y < c->ny; y++)
        for (int x = 0; x < c->nx; x++) {
            const size_t cell = (size_t)y * (size_t)c->nx + (size_t)x;
            for (size_t a = c->start[cell]; a < c->start[cell + 1]; a++)
                for (size_t b = a + 1; b < c->start[cell + 1]; b++) {
                    const int i = c->member[a], j = c->member[b];
                    if (!meet(f[i], f[j], x, y))
                        continue;
                    if (l->n == l->room) {
                        const size_t room = 2 * l->room + 1024;
                        rx_blend_link *more = rx_regrow(l->list, room, sizeof *more);
                        if (more == NULL)
                            return rx_error_memory(err, room * sizeof *more);
                        l->list = more;
                        l->room = room;
                    }
                    l->list[l->n++] = (rx_blend_link){i < j ? i : j, i < j ? j : i, 0};
                }
        }
    return RX_OK;
}

static int by_strength(const void *a, const void *b)
{
    const rx_blend_link *p = a, *q = b;
    if (p->strength != q->strength)
        return p->strength > q->strength ? -1 : 1;
    if (p->i != q->i)
        return p->i < q->i ? -1 : 1;
    return p->j < q->j ? -1 : p->j > q->j;
}

static int root(int *parent, int i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

/* Sets grow along the links, strongest first. */
static void tie(const links *l, double link, int limit, int *parent, int *members, int *cut)
{
    for (size_t k = 0; k < l->n && l->list[k].strength > link; k++) {
        const int i = l->list[k].i, j = l->list[k].j;
        int a = root(parent, i), b = root(parent, j);
        if (a == b)
            continue;
        if (members[a] + members[b] > limit) {
            cut[i] = cut[j] = 1;
            continue;
        }
        if (a > b) { /* the smallest number stays the root */
            const int swap = a;
            a = b;
            b = swap;
        }
        parent[b] = a;
        members[a] += members[b];
    }
}

static void number(int *parent, rx_blends *blends)
{
    for (int i = 0; i < blends->n; i++) {
        const int r = root(parent, i);
        if (r == i)
            blends->group[i] = blends->ngroups++;
        else
            blends->group[i] = blends->group[r];
        blends->start[blends->group[i] + 1]++;
    }
    for (int g = 0; g < blends->ngroups; g++) {
        if (blends->start[g + 1] > blends->largest)
            blends->largest = blends->start[g + 1];
        blends->start[g + 1] += blends->start[g];
    }
}

static void list_members(rx_blends *blends, int *at)
{
    for (int g = 0; g < blends->ngroups; g++)
        at[g] = blends->start[g];
    for (int i = 0; i < blends->n; i++)
        blends->member[at[blends->group[i]]++] = i;
}

rx_status rx_blends_find(const rx_tphot_params *par, const rx_footprint *const *footprints, int n, int width,
                         int height, rx_blends *blends, rx_error *err)
{
    const size_t room = (size_t)n + 1;
    cells c = {0};
    links l = {0};
    *blends = (rx_blends){.n = n,
                          .group = RX_NEW(int, room),
                          .start = RX_NEW(int, room),
                          .member = RX_NEW(int, room),
                          .cut = RX_NEW(int, room),
                          .divided = RX_NEW(int, room)};
    int *parent = RX_NEW(int, room), *members = RX_NEW(int, room);
    double *power = RX_NEW(double, room);
    rx_status status = RX_OK;
    if (blends->group == NULL || blends->start == NULL || blends->member == NULL || blends->cut == NULL ||
        blends->divided == NULL || parent == NULL || members == NULL || power == NULL)
        status = rx_error_memory(err, 6 * room * sizeof(int));
    if (status == RX_OK)
        status = fill_cells(footprints, n, width, height, &c, err);
    if (status == RX_OK)
        status = list_pairs(footprints, &c, &l, err);
    if (status != RX_OK)
        goto exit;
    for (int i = 0; i < n; i++) {
        parent[i] = i;
        members[i] = 1;
        power[i] = rx_footprint_product(footprints[i], footprints[i], NULL);
    }
#pragma omp parallel for schedule(dynamic, 64) num_threads(par->nthreads > 0 ? par->nthreads : 1)
    for (size_t k = 0; k < l.n; k++) {
        rx_blend_link *p = &l.list[k];
        const double norm = power[p->i] * power[p->j];
        const double product = rx_footprint_product(footprints[p->i], footprints[p->j], NULL);
        p->strength = norm > 0 && isfinite(product) ? product / sqrt(norm) : 0;
    }
    if (l.n > 0)
        qsort(l.list, l.n, sizeof *l.list, by_strength);
    tie(&l, par->link, par->group_limit > 1 ? par->group_limit : 1, parent, members, blends->cut);
    number(parent, blends);
    list_members(blends, members);
    for (int i = 0; i < n; i++)
        if (blends->cut[i] && !blends->divided[blends->group[i]]) {
            blends->divided[blends->group[i]] = 1;
            blends->ndivided++;
        }
exit:
    free(c.start);
    free(c.member);
    free(l.list);
    free(parent);
    free(members);
    free(power);
    if (status != RX_OK)
        rx_blends_clear(blends);
    return status;
}

void rx_blends_clear(rx_blends *blends)
{
    free(blends->group);
    free(blends->start);
    free(blends->member);
    free(blends->cut);
    free(blends->divided);
    *blends = (rx_blends){0};
}
