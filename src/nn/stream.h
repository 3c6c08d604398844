/* A network that runs down a block of an image: rows of input go in at the top, a few at a time, and rows of
 * output come out, some rows behind. Every node keeps only the rows that later nodes still read, so that a
 * step's work stays in the processor's cache, no row is computed twice, and a block may be as high as the
 * image. Around the block only what it depends on is computed, by the kernels of nn/direct.h.
 *
 * The values are those of a runner's forward pass (runner.h, of training) on the block with its halo, within
 * rounding: some 1e-6 of the largest, with bfloat16 some 1e-2 (tests/unit/nn/test_stream.c). They do not depend on
 * the block as long as blocks begin on the same multiples of 2^(levels + 1). A stream belongs to one caller at a time
 * and never uses more than the thread that calls it.
 *
 * Memory: rx_stream_bytes(), 7 kB per pixel of width for a PSF-NET of width 8 in single precision. */
#ifndef RX_NN_STREAM_H
#define RX_NN_STREAM_H

#include "nn/net.h"

typedef struct rx_stream rx_stream;

/* Where rows come from and go to; row 0 and column 0 are those of the block. */
typedef struct rx_stream_ends {
    void *user;
    /* rows[n][width + 2 halo][channels] of the input, from row y and column -halo on, to be filled; y may be
     * -halo .. height + halo + what a step takes */
    void (*give)(void *user, int y, int n, float *rows);
    /* rows[n][width + 2 halo][channels] of the output, 0 <= y < height; only columns 0 .. width - 1 mean anything */
    void (*take)(void *user, int y, int n, const float *rows);
} rx_stream_ends;

/* What a node has cost so far. */
typedef struct rx_stream_cost {
    double seconds;
    double flops; /* additions and multiplications by the definition, of what it makes; 0 where it is no
                     convolution */
} rx_stream_cost;

/* width of the block: a multiple of 2^levels. The net is only read and must live as long. Errors: RX_INPUT,
 * RX_SYSTEM, RX_USAGE (bfloat16 that this processor does not offer). What takes time and memory is left to the first
 * run. */
rx_status rx_stream_new(const rx_net *net, int width, rx_precision precision, rx_stream **dst, rx_error *err);
void rx_stream_free(rx_stream *stream); /* NULL is fine */

/* One block, height a multiple of 2^levels. Errors: RX_SYSTEM. */
rx_status rx_stream_run(rx_stream *stream, int height, const rx_stream_ends *ends, rx_error *err);

/* From now on cost[net->nnodes] grows with each run; NULL: no clock is read. */
void rx_stream_measure(rx_stream *stream, rx_stream_cost *cost);

double rx_stream_bytes(const rx_net *net, int width, rx_precision precision); /* of its planes */

#endif
