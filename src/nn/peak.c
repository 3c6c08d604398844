/* The speed of a large convolution. */
#include "nn/peak.h"

#include <stdlib.h>

#include "base/log.h"
#include "base/memory.h"
#include "nn/direct.h"

enum { SIDE = 56, CHANNELS = 64, KERNEL = 3 };
static const double PATIENCE = 0.05; /* seconds */

rx_status rx_peak_measure(rx_real real, double *flops, rx_error *err)
{
    const rx_conv_shape shape = {.height = SIDE + KERNEL - 1,
                                 .width = SIDE + KERNEL - 1,
                                 .in = CHANNELS,
                                 .out = CHANNELS,
                                 .kernel = KERNEL,
                                 .stride = 1,
                                 .before = KERNEL / 2,
                                 .after = KERNEL / 2,
                                 .x = real,
                                 .y = real};
    const rx_direct_area all = {KERNEL / 2, SIDE + KERNEL / 2, 0, SIDE};
    rx_plane x = {.real = real, .height = shape.height, .width = shape.width, .channels = CHANNELS}, y = x;
    const size_t weights = CHANNELS * CHANNELS * KERNEL * KERNEL;
    rx_direct *direct = NULL;
    float *w = RX_NEW(float, weights), *bias = RX_NEW(float, CHANNELS),
          *scratch = RX_NEW(float, rx_direct_scratch());
    x.data = rx_alloc(rx_plane_size(&x), rx_real_bytes(real));
    y.data = rx_alloc(rx_plane_size(&y), rx_real_bytes(real));
    double best = PATIENCE;
    *flops = 0;
    rx_status status = RX_OK;
    if (w == NULL || bias == NULL || scratch == NULL || x.data == NULL || y.data == NULL)
        status = rx_error_memory(err, 2 * rx_plane_bytes(&x));
    if (status == RX_OK)
        status = rx_direct_new(&shape, (rx_direct_options){0}, w, bias, &direct, err);
    const double begun = rx_seconds();
    for (int run = 0; status == RX_OK && (run < 2 || rx_seconds() - begun < PATIENCE); run++) {
        const double from = rx_seconds();
        rx_direct_run(direct, &x, NULL, &y, all, scratch);
        const double spent = rx_seconds() - from;
        if (run == 0 || spent < best)
            best = spent;
    }
    if (status == RX_OK)
        *flops = 2.0 * (double)(weights * SIDE * SIDE) / best;
    rx_direct_free(direct);
    free(w);
    free(bias);
    free(scratch);
    free(x.data);
    free(y.data);
    return status;
}
