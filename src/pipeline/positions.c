/* Listed positions beside what was found on the tile. */
#include "pipeline/positions.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"

static const double ONE = 0.5, SAME = 0.01; /* FWHM: see the header */

/* Points by cells, whose side is the farthest that neighbours are looked for. */
typedef struct grid {
    double cell; /* pixels */
    int nx, ny;
    int *last,
        *next; /* [ny][nx], [points]: 1 + the last point of a cell, 1 + the one before a point; 0: none */
} grid;

static int along(double position, double cell, int n)
{
    return rx_min_int(rx_max_int((int)(position / cell), 0), n - 1);
}

static rx_status open_grid(const rx_tphot *tphot, double cell, int points, grid *dst, rx_error *err)
{
    *dst = (grid){.cell = cell, .nx = (int)(tphot->width / cell) + 1, .ny = (int)(tphot->height / cell) + 1};
    RX_TRY(RX_MAKE(dst->last, (size_t)dst->nx * (size_t)dst->ny, err));
    return RX_MAKE(dst->next, (size_t)points + 1, err);
}

static void close_grid(grid *g)
{
    free(g->last);
    free(g->next);
}

static void put(grid *g, int i, const double at[2])
{
    int *last = &g->last[along(at[1], g->cell, g->ny) * g->nx + along(at[0], g->cell, g->nx)];
    g->next[i] = *last;
    *last = i + 1;
}

/* The first of the points in row v, column u of the nine cells around a place, v and u -1 .. 1; 0: none. */
static int around(const grid *g, const double at[2], int k)
{
    const int x = along(at[0], g->cell, g->nx) + k % 3 - 1, y = along(at[1], g->cell, g->ny) + k / 3 - 1;
    return x >= 0 && x < g->nx && y >= 0 && y < g->ny ? g->last[y * g->nx + x] : 0;
}

/* The distinct position that it is, or -1. */
static int find_same(const grid *g, const rx_positions *positions, const int *row, const double at[2],
                     double apart)
{
    for (int k = 0; k < 9; k++)
        for (int j = around(g, at, k); j > 0; j = g->next[j - 1]) {
            const double *other = positions->at[row[j - 1]];
            if (hypot(other[0] - at[0], other[1] - at[1]) < apart)
                return j - 1;
        }
    return -1;
}

rx_status rx_positions_match(const rx_positions *positions, const rx_tphot *tphot, double fwhm,
                             rx_position_match *dst, rx_error *err)
{
    const size_t n = (size_t)positions->n + 1;
    grid listed = {0}, found = {0};
    rx_status status;
    *dst = (rx_position_match){0};
    RX_TRY_EXIT(open_grid(tphot, ONE * fwhm, positions->n, &listed, err));
    RX_TRY_EXIT(open_grid(tphot, ONE * fwhm, tphot->n, &found, err));
    RX_TRY_EXIT(RX_MAKE(dst->row, n, err));
    RX_TRY_EXIT(RX_MAKE(dst->of, n, err));
    RX_TRY_EXIT(RX_MAKE(dst->nearest, n, err));
    RX_TRY_EXIT(RX_MAKE(dst->replaced, n, err));
    RX_TRY_EXIT(RX_MAKE(dst->keep, (size_t)tphot->n + 1, err));
    for (int i = 0; i < tphot->n; i++) {
        dst->keep[i] = 1;
        put(&found, i, (const double[2]){tphot->list[i].x, tphot->list[i].y});
    }
    for (int i = 0; i < positions->n; i++) {
        const double *at = positions->at[i];
        dst->of[i] = -1;
        if (!(at[0] > -0.5 && at[0] < tphot->width - 0.5 && at[1] > -0.5 && at[1] < tphot->height - 0.5))
            continue;
        dst->of[i] = find_same(&listed, positions, dst->row, at, SAME * fwhm);
        if (dst->of[i] >= 0)
            continue;
        put(&listed, dst->n, at);
        dst->row[dst->n] = i;
        dst->of[i] = dst->n++;
    }
    for (int i = 0; i < dst->n; i++) {
        const double *at = positions->at[dst->row[i]];
        double least = ONE * fwhm;
        dst->nearest[i] = -1;
        for (int k = 0; k < 9; k++)
            for (int j = around(&found, at, k); j > 0; j = found.next[j - 1]) {
                const double apart = hypot(tphot->list[j - 1].x - at[0], tphot->list[j - 1].y - at[1]);
                if (!(apart < ONE * fwhm))
                    continue;
                dst->keep[j - 1] = 0;
                dst->replaced[i]++;
                if (apart < least)
                    dst->nearest[i] = j - 1;
                least = fmin(least, apart);
            }
    }
exit:
    close_grid(&listed);
    close_grid(&found);
    return status;
}

void rx_position_match_clear(rx_position_match *match)
{
    free(match->row);
    free(match->of);
    free(match->nearest);
    free(match->replaced);
    free(match->keep);
    *match = (rx_position_match){0};
}
