/* One piece of work after the other, or by several threads at once, each on its own window of the image. */
#ifndef RX_TEMPLATE_WINDOWS_H
#define RX_TEMPLATE_WINDOWS_H

#include "base/error.h"
#include "template/fit_image.h"

/* Piece i, by thread 0 .. image->nthreads - 1; what it may read of the image is its window. */
typedef rx_status (*rx_window_job)(void *user, int i, int thread, rx_error *err);

/* All n pieces, those whose windows fit in memory together at a time. in_order: one after the other, by one
 * thread, and the image may be added to; else in any order. Returns one of the errors of the pieces, or
 * RX_SYSTEM, or RX_INTERRUPTED. */
rx_status rx_windows_run(rx_fit_image *image, const rx_window *windows, int n, int in_order,
                         rx_window_job turn, void *user, rx_error *err);

#endif
