/* A network of RESTORE on a tile: v = network(planes), in blocks, nn/stream.h on each. Planes are [height][width] of the
 * tile, in noise units. */
#ifndef RX_RESTORE_NETWORK_FORWARD_H
#define RX_RESTORE_NETWORK_FORWARD_H

#include "nn/model.h"
#include "nn/stream.h"
#include "restore/network_blocks.h"
#include "restore/network_optics.h"

typedef struct rx_network_forward {
    const char *model; /* its name, for messages */
    const rx_net *net;
    rx_precision precision;
    int width, height, nthreads;
    int nplanes;                             /* channels of the network */
    const float *planes[RX_SECOND_CHANNELS]; /* stretched into these (nn/front.h); NULL: the FWHM */
    const rx_network_optics *optics;         /* has the FWHM */
    const float *base;                       /* what the output is added to */
    float *v;
    float *spent; /* one of the planes, which is not read afterwards: its memory goes as v comes; else NULL */
    rx_stream_cost *cost; /* [nnodes], summed over threads; NULL: not measured */
} rx_network_forward;

/* Blocks of `side` columns at most and as many rows as fit, smaller ones where threads would have none or
 * there is no room (1 GiB for all threads together): of these the ones that end first. The grid begins at
 * (-shift_x, -shift_y), multiples of twice the network's stride. Neither the blocks nor the number of threads
 * change a bit. */
rx_blocks rx_network_forward_blocks(const rx_network_forward *forward, int side, int shift_x, int shift_y);

/* Errors: RX_INPUT (values that are not finite), RX_USAGE, RX_SYSTEM,
 * RX_INTERRUPTED. */
rx_status rx_network_forward_run(const rx_network_forward *forward, const rx_blocks *blocks,
                                 const rx_blocks_progress *progress, rx_error *err);

#endif
