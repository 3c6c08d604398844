/* The speed of a large convolution. */
#include "nn/peak.h"

#include <stdlib.h>

#include "base/log.h"
#include "base/memory.h"

enum { SIDE = 56, CHANNELS = 64, KERNEL = 3 };
static const double PATIENCE = 0.05; /* seconds */

static rx_status fastest(rx_conv *conv, const void *x, void *y, double *seconds, rx_error *err)
{
    const double begun = rx_seconds();
    rx_status status = RX_OK;
    *seconds = PATIENCE;
    for (int run = 0; status == RX_OK && (run < 2 || rx_seconds() - begun < PATIENCE); run++) {
        const double from = rx_seconds();
        status = rx_conv_run(conv, x, NULL, y, err);
        const double spent = rx_seconds() - from;
        if (run == 0 || spent < *seconds)
            *seconds = spent;
    }
    return status;
}

rx_status rx_peak_measure(rx_real real, double *flops, rx_error *err)
{
    const rx_conv_shape shape = {.height = SIDE,
                                 .width = SIDE,
                                 .in = CHANNELS,
                                 .out = CHANNELS,
                                 .kernel = KERNEL,
                                 .stride = 1,
                                 .before = KERNEL / 2,
                                 .after = KERNEL / 2,
                                 .x = real,
                                 .y = real};
    const size_t weights = CHANNELS * CHANNELS * KERNEL * KERNEL, size = SIDE * SIDE * CHANNELS;
    rx_dnn *dnn = NULL;
    rx_conv *conv = NULL;
    float *w = RX_NEW(float, weights), *bias = RX_NEW(float, CHANNELS);
    void *x = rx_alloc(size, rx_real_bytes(real)), *y = rx_alloc(size, rx_real_bytes(real));
    double seconds = 0;
    *flops = 0;
    rx_status status = RX_OK;
    if (w == NULL || bias == NULL || x == NULL || y == NULL) {
        status = rx_error_memory(err, size * sizeof(float));
        goto exit;
    }
    status = rx_dnn_new(&dnn, err);
    if (status == RX_OK)
        status = rx_conv_new(dnn, &shape, &conv, err);
    if (status == RX_OK)
        status = rx_conv_load(conv, w, bias, err);
    if (status == RX_OK)
        status = fastest(conv, x, y, &seconds, err);
    if (status == RX_OK)
        *flops = 2.0 * (double)(weights * SIDE * SIDE) / seconds;
exit:
    rx_conv_free(conv);
    rx_dnn_free(dnn);
    free(w);
    free(bias);
    free(x);
    free(y);
    return status;
}
