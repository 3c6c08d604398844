/* Batches of windows. */
#include "template/windows.h"

#include <omp.h>
#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "num/stats.h"

enum { TOGETHER = 8 }; /* pieces that a thread takes at once */

/* Their order: by first row, so that what lies together is taken together. */
static rx_status sort_windows(const rx_window *windows, int n, int in_order, int *order, rx_error *err)
{
    rx_ranked *starts = RX_NEW(rx_ranked, (size_t)n);
    if (starts == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *starts);
    for (int i = 0; i < n; i++)
        starts[i] = (rx_ranked){windows[i].y0, i};
    if (!in_order)
        rx_rank(starts, (size_t)n);
    for (int i = 0; i < n; i++)
        order[i] = starts[i].index;
    free(starts);
    return RX_OK;
}

/* End of the batch that begins at `first`: all that lies within so many rows, at least one. */
static int end_of_batch(const rx_window *windows, const int *order, int n, int first, int rows)
{
    int from = 0, to = 0;
    for (int k = first; k < n; k++) {
        const rx_window *w = &windows[order[k]];
        if (w->y1 <= w->y0 || w->x1 <= w->x0)
            continue;
        const int y0 = to > from && from < w->y0 ? from : w->y0, y1 = to > w->y1 ? to : w->y1;
        if (to > from && y1 - y0 > rows)
            return k;
        from = y0;
        to = y1;
    }
    return n;
}

/* The k-th of a batch. To ask for signals takes longer than many a piece. */
static rx_status take_one(rx_window_job turn, void *user, int k, const int *order, int thread, rx_error *err)
{
    const rx_status status = k % TOGETHER == 0 ? rx_interrupt_check(err) : RX_OK;
    return status == RX_OK ? turn(user, order[k], thread, err) : status;
}

static rx_status take_batch(int nthreads, const int *order, int n, rx_window_job turn, void *user,
                            rx_error *err)
{
    rx_status failed = RX_OK;
#pragma omp parallel for schedule(dynamic, TOGETHER) num_threads(nthreads)
    for (int k = 0; k < n; k++) {
        rx_error own = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
        const rx_status status = take_one(turn, user, k, order, omp_get_thread_num(), &own);
        if (status != RX_OK) {
#pragma omp critical(rx_windows_failure)
            {
                failed = status;
                rx_error_take(err, &own);
            }
        }
    }
    return failed;
}

rx_status rx_windows_run(rx_fit_image *image, const rx_window *windows, int n, int in_order,
                         rx_window_job turn, void *user, rx_error *err)
{
    const int rows = rx_fit_image_rows(image);
    int *order = RX_NEW(int, (size_t)n), *batch = RX_NEW(int, (size_t)n + 1), batches = 0;
    rx_status status = order == NULL || batch == NULL ? rx_error_memory(err, 2 * (size_t)n * sizeof *order)
                                                      : sort_windows(windows, n, in_order, order, err);
    if (status != RX_OK)
        goto exit;
    while (batch[batches] < n) {
        batch[batches + 1] = end_of_batch(windows, order, n, batch[batches], rows);
        batches++;
    }
    /* from the end that is in memory */
    const int upwards = !in_order && image->top > 0;
    for (int k = 0; k < batches && status == RX_OK; k++) {
        const int b = upwards ? batches - 1 - k : k, m = batch[b + 1] - batch[b];
        const int *own = order + batch[b];
        status = rx_fit_image_load(image, windows, own, m, err);
        if (status == RX_OK && !in_order)
            status = take_batch(image->nthreads, own, m, turn, user, err);
        for (int i = 0; in_order && i < m && status == RX_OK; i++)
            status = take_one(turn, user, i, own, 0, err);
    }
exit:
    free(order);
    free(batch);
    return status;
}
