/* Blocks of a tile, and work on all of them by several threads. */
#ifndef RX_RESTORE_NETWORK_BLOCKS_H
#define RX_RESTORE_NETWORK_BLOCKS_H

#include <stdint.h>

#include "base/error.h"
#include "base/log.h"

/* nx * ny blocks of width x height pixels; the first begins at tile pixel (x, y), both <= 0. Together they
 * cover the tile and may reach beyond it. */
typedef struct rx_blocks {
    int x, y;
    int width, height;
    int nx, ny;
    int team; /* threads that the run has; the caller's to set. Where fewer have work the others wait: a smaller
               * team of OpenMP's would end them, and the next would have to be given them anew */
} rx_blocks;

/* For a tile of width x height: at most `wide` x `high` pixels, multiples of `unit`, as even as that
 * allows; the grid begins shift_x, shift_y pixels (multiples of unit, >= 0) before the tile, without the
 * blocks that would have no pixel of it. */
rx_blocks rx_blocks_make(int width, int height, int wide, int high, int unit, int shift_x, int shift_y);

/* Of nthreads those that can have a block each: no scratch for the others. */
int rx_blocks_threads(const rx_blocks *blocks, int nthreads);

/* One block: it begins at tile pixel (x, y); thread 0 .. nthreads - 1. */
typedef rx_status (*rx_blocks_task)(void *user, int thread, int x, int y, rx_error *err);

/* Where to report progress: from `begin` to `end`, shares of the whole job. */
typedef struct rx_blocks_progress {
    rx_log *log;
    double begin, end;
} rx_blocks_progress;

/* `task` on every block, by nthreads threads. progress: NULL is fine. The error of the first block (in their
 * order) that failed; RX_INTERRUPTED after a signal. */
rx_status rx_blocks_run(const rx_blocks *blocks, int nthreads, rx_blocks_task task, void *user,
                        const rx_blocks_progress *progress, rx_error *err);

/* A plane of the tile that blocks read up to `halo` pixels around themselves, and none after them before it
 * is written again. */
typedef struct rx_blocks_spent {
    float *plane; /* from rx_alloc(), [height][width] of the tile */
    int width, halo;
} rx_blocks_spent;

/* The same; the memory of rows of that plane that only the blocks done have read is given back meanwhile, for
 * what is made in its stead. */
rx_status rx_blocks_run_spending(const rx_blocks *blocks, int nthreads, rx_blocks_task task, void *user,
                                 const rx_blocks_spent *spent, const rx_blocks_progress *progress,
                                 rx_error *err);

/* A part of a plane that begins at (x, y) and may reach beyond it; rows of its copy are `stride` apart. */
typedef struct rx_blocks_window {
    int x, y, width, height, stride;
} rx_blocks_window;

/* dst[height][stride] = 1 where that part of mask[plane_height][plane_width] is 0, 0 elsewhere and beyond;
 * returns how many are 0. */
long rx_blocks_good(const uint8_t *mask, int plane_width, int plane_height, const rx_blocks_window *window,
                    float *dst);

#endif
