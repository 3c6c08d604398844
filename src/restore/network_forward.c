/* The network on a tile, block by block. */
#include "restore/network_forward.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static const double BUDGET = 1073741824.0; /* bytes, of all threads' networks together */

/* ---- blocks ---- */

/* Threads that have a block, and room for its network, each. */
static int threads_of(const rx_network_forward *f, const rx_blocks *blocks)
{
    const double room = floor(BUDGET / rx_stream_bytes(f->net, blocks->width, f->precision));
    return rx_blocks_threads(blocks, room < 1 ? 1 : room < f->nthreads ? (int)room : f->nthreads);
}

rx_blocks rx_network_forward_blocks(const rx_network_forward *f, int side, int shift_x, int shift_y)
{
    enum { LEAST = 32, HIGHEST = 4096 };
    const int unit = 2 << rx_net_levels(f->net), halo = rx_net_halo(f->net);
    const int whole = (f->height + HIGHEST - 1) / HIGHEST;
    rx_blocks best = {0};
    for (double least = HUGE_VAL; best.nx == 0 || side >= LEAST; side /= 2)
        for (int parts = whole; parts <= whole * 2 * f->nthreads; parts++) {
            const int high = (f->height + parts - 1) / parts;
            const rx_blocks made = rx_blocks_make(f->width, f->height, side, high, unit, shift_x, shift_y);
            /* of the halo above and below half is computed, at both ends of a block */
            const double rounds = ceil((double)made.nx * made.ny / threads_of(f, &made)),
                         pixels = rounds * (made.width + 2 * halo) * (made.height + halo);
            const double bytes = rx_stream_bytes(f->net, made.width, f->precision);
            if ((bytes > BUDGET && side >= 2 * LEAST) || pixels >= least)
                continue;
            least = pixels;
            best = made;
        }
    return best;
}

/* ---- one block ---- */

/* What the ends of a stream are given. */
typedef struct ends {
    const rx_network_forward *forward;
    int x, y, width, halo; /* where the block begins, its width */
    float *line;           /* [width + 2 halo] */
    int sound;
} ends;

static void stretch(const float *restrict src, int n, float *restrict dst)
{
#pragma omp simd
    for (int i = 0; i < n; i++)
        dst[i] = rx_stretch(src[i]);
}

/* Stretched values of row y from column x on, 0 beyond the tile. */
static void stretch_row(const rx_network_forward *f, const float *plane, int y, int x, int n, float *dst)
{
    const int from = x < 0 ? (-x < n ? -x : n) : 0, to = x + n > f->width ? f->width - x : n;
    memset(dst, 0, (size_t)n * sizeof *dst);
    if (y >= 0 && y < f->height && from < to)
        stretch(plane + (size_t)y * f->width + (x + from), to - from, dst + from);
}

static void give(void *user, int y, int n, float *rows)
{
    const ends *e = user;
    const rx_network_forward *f = e->forward;
    const int width = e->width + 2 * e->halo, x = e->x - e->halo, planes = f->nplanes;
    float *line = e->line;
    for (int v = 0; v < n; v++)
        for (int c = 0; c < planes; c++) {
            const int row = e->y + y + v;
            float *dst = rows + (size_t)v * width * planes + c;
            if (f->planes[c] != NULL)
                stretch_row(f, f->planes[c], row, x, width, line);
            else
                rx_otf_fwhm_row(&f->optics->grid, row, x, width, line);
            for (int u = 0; u < width; u++)
                dst[(size_t)u * planes] = f->planes[c] != NULL ? line[u] : rx_front_fwhm(line[u]);
        }
}

/* Base plus correction, unstretched; whether all of it is finite. */
static int unstretch(const float *restrict base, const float *restrict correction, int n, float *restrict v)
{
    int sound = 1;
#pragma omp simd reduction(& : sound)
    for (int i = 0; i < n; i++) {
        v[i] = rx_unstretch(rx_stretch(base[i]) + correction[i]);
        sound &= fabsf(v[i]) <= FLT_MAX;
    }
    return sound;
}

static void take(void *user, int y, int n, const float *rows)
{
    ends *e = user;
    const rx_network_forward *f = e->forward;
    const int from = e->x < 0 ? -e->x : 0;
    const int to = e->x + e->width > f->width ? f->width - e->x : e->width;
    for (int v = 0; v < n && from < to; v++) {
        const int row = e->y + y + v;
        const size_t k = (size_t)row * f->width + (size_t)(e->x + from);
        const float *correction = rows + (size_t)v * (e->width + 2 * e->halo) + e->halo + from;
        if (row >= 0 && row < f->height)
            e->sound &= unstretch(f->base + k, correction, to - from, f->v + k);
    }
}

/* ---- all blocks ---- */

typedef struct job {
    const rx_network_forward *forward;
    const rx_blocks *blocks;
    rx_stream **streams;
} job;

static rx_status forward_block(void *user, int thread, int bx, int by, rx_error *err)
{
    const job *j = user;
    const int halo = rx_net_halo(j->forward->net), width = j->blocks->width + 2 * halo;
    ends e = {.forward = j->forward, .x = bx, .y = by, .width = j->blocks->width, .halo = halo, .sound = 1};
    RX_TRY(RX_MAKE(e.line, (size_t)width, err));
    const rx_stream_ends both = {.user = &e, .give = give, .take = take};
    rx_status status = rx_stream_run(j->streams[thread], j->blocks->height, &both, err);
    free(e.line);
    if (status == RX_OK && !e.sound)
        status = rx_error_set(err, RX_INPUT,
                              "the model %s makes values that are not finite at pixel %d,%d and around; "
                              "train it again or give another one by NET_MODEL",
                              j->forward->model, bx > 0 ? bx + 1 : 1, by > 0 ? by + 1 : 1);
    return status;
}

rx_status rx_network_forward_run(const rx_network_forward *f, const rx_blocks *blocks,
                                 const rx_blocks_progress *progress, rx_error *err)
{
    const int count = threads_of(f, blocks), nodes = f->net->nnodes;
    job j = {.forward = f, .blocks = blocks, .streams = RX_NEW(rx_stream *, (size_t)count)};
    rx_stream_cost *costs = f->cost != NULL ? RX_NEW(rx_stream_cost, (size_t)(count * nodes)) : NULL;
    rx_status status = RX_OK;
    if (j.streams == NULL || (f->cost != NULL && costs == NULL))
        RX_TRY_EXIT(rx_error_memory(err, 0));
    for (int i = 0; i < count && status == RX_OK; i++) {
        status = rx_stream_new(f->net, blocks->width, f->precision, &j.streams[i], err);
        if (status == RX_OK && costs != NULL)
            rx_stream_measure(j.streams[i], costs + (size_t)(i * nodes));
    }
    const rx_blocks_spent spent = {f->spent, f->width, rx_net_halo(f->net)};
    if (status == RX_OK)
        status = rx_blocks_run_spending(blocks, count, forward_block, &j, f->spent != NULL ? &spent : NULL,
                                        progress, err);
    for (int i = 0; costs != NULL && i < nodes * count; i++) {
        f->cost[i % nodes].seconds += costs[i].seconds;
        f->cost[i % nodes].flops += costs[i].flops;
    }
exit:
    for (int i = 0; i < count && j.streams != NULL; i++)
        rx_stream_free(j.streams[i]);
    free(j.streams);
    free(costs);
    return status;
}
