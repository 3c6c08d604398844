/* Blocks of a tile. */
#include "restore/network_blocks.h"

#include <omp.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"

static int up_to(int n, int unit)
{
    return (n + unit - 1) / unit * unit;
}

static void divide(int length, int side, int unit, int shift, int *begin, int *size, int *n)
{
    const int whole = length + shift, most = side < unit ? unit : side / unit * unit;
    *n = (whole + most - 1) / most;
    *size = up_to((whole + *n - 1) / *n, unit);
    *begin = -(shift % *size);
    *n = (length - *begin + *size - 1) / *size;
}

rx_blocks rx_blocks_make(int width, int height, int wide, int high, int unit, int shift_x, int shift_y)
{
    rx_blocks blocks = {0};
    divide(width, wide, unit, shift_x, &blocks.x, &blocks.width, &blocks.nx);
    divide(height, high, unit, shift_y, &blocks.y, &blocks.height, &blocks.ny);
    return blocks;
}

int rx_blocks_threads(const rx_blocks *blocks, int nthreads)
{
    const int n = blocks->nx * blocks->ny;
    return nthreads < n ? nthreads : n;
}

/* The failure of the first block. */
typedef struct failure {
    int block;
    rx_error error;
} failure;

static int take_next(int *next)
{
    int taken;
#pragma omp atomic capture
    taken = (*next)++;
    return taken;
}

static rx_status run_some(const rx_blocks *blocks, int first, int last, int nthreads, rx_blocks_task task,
                          void *user, rx_error *err)
{
    failure worst = {.block = -1, .error = rx_error_part(NULL)};
    int next = first;
#pragma omp parallel num_threads(blocks->team > nthreads && nthreads > 1 ? blocks->team : nthreads)
    for (int b; omp_get_thread_num() < nthreads && (b = take_next(&next)) < last;) {
        rx_error why = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
        const int x = blocks->x + b % blocks->nx * blocks->width,
                  y = blocks->y + b / blocks->nx * blocks->height;
        const rx_status status = task(user, omp_get_thread_num(), x, y, &why);
        if (status == RX_OK)
            continue;
        why.status = status;
#pragma omp critical(rx_blocks_failure)
        if (worst.block < 0 || b < worst.block)
            worst = (failure){b, why};
    }
    if (worst.block < 0)
        return RX_OK;
    rx_error_take(err, &worst.error);
    return worst.error.status;
}

/* Rows from `given` on that no block from `next` on reads. Returns up to where there are none left. */
static int give_back(const rx_blocks *blocks, int next, const rx_blocks_spent *spent, int given)
{
    const int end = blocks->y + next / blocks->nx * blocks->height - spent->halo;
    const size_t row = (size_t)spent->width * sizeof *spent->plane;
    if (end <= given)
        return given;
    rx_memory_spend(spent->plane, (size_t)given * row, (size_t)end * row);
    return end;
}

rx_status rx_blocks_run_spending(const rx_blocks *blocks, int nthreads, rx_blocks_task task, void *user,
                                 const rx_blocks_spent *spent, const rx_blocks_progress *progress,
                                 rx_error *err)
{
    const int n = blocks->nx * blocks->ny, step = 4 * nthreads;
    int given = 0;
    rx_status status = RX_OK;
    for (int first = 0; first < n && status == RX_OK; first += step) {
        const int last = n - first < step ? n : first + step;
        if (spent != NULL)
            given = give_back(blocks, first, spent, given);
        status = run_some(blocks, first, last, nthreads, task, user, err);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
        if (progress != NULL)
            rx_log_progress(progress->log, "NET",
                            progress->begin + (progress->end - progress->begin) * last / n);
    }
    return status;
}

rx_status rx_blocks_run(const rx_blocks *blocks, int nthreads, rx_blocks_task task, void *user,
                        const rx_blocks_progress *progress, rx_error *err)
{
    return rx_blocks_run_spending(blocks, nthreads, task, user, NULL, progress, err);
}

/* Row `row` of the plane and columns x .. x + width - 1: how many of these lie before it, and in it. */
static int overlap(int plane_width, int x, int width, int *before)
{
    *before = x < 0 ? (-x < width ? -x : width) : 0;
    const int end = x + width < plane_width ? x + width : plane_width, n = end - (x + *before);
    return n > 0 ? n : 0;
}

static int good_row(const uint8_t *restrict mask, int n, float *restrict dst)
{
    int good = 0;
#pragma omp simd reduction(+ : good)
    for (int i = 0; i < n; i++) {
        dst[i] = mask[i] == 0 ? 1 : 0;
        good += mask[i] == 0;
    }
    return good;
}

long rx_blocks_good(const uint8_t *mask, int plane_width, int plane_height, const rx_blocks_window *window,
                    float *dst)
{
    const int x = window->x, y = window->y, width = window->width;
    int before = 0;
    long bad = 0;
    const int n = overlap(plane_width, x, width, &before);
    for (int j = 0; j < window->height; j++) {
        float *line = dst + (size_t)j * window->stride;
        const int inside = n > 0 && y + j >= 0 && y + j < plane_height;
        const uint8_t *m = inside ? mask + (size_t)(y + j) * plane_width + (x + before) : NULL;
        memset(line, 0, (size_t)width * sizeof *line);
        bad += width;
        bad -= inside ? good_row(m, n, line + before) : 0;
    }
    return bad;
}
