/* Convolutions of a band of rows, forward and backward: the network's kernels. No plane is padded or rearranged,
 * nothing is compiled at run time, and only the pixels that are asked for are made, with sum, cut and rounding on the
 * way. Values do not depend on which pixels are asked for. For a band there is no border above and below: y has only
 * rows that see all theirs in x.
 *
 * The plain kernel, C by the definition with sums in double, is the fallback for every shape and every machine,
 * and what the others are compared with (tests/unit/nn/test_direct.c). These work on vectors of 4 floats (GCC's
 * vector extensions: NEON, SSE2), 8 (AVX2 with fused multiply-add) or 16 (AVX-512, and its instructions for
 * bfloat16), those of which outputs need the fewest:
 *
 *   - wide: registers hold the sums of pixels side by side, and a word of the input (one float or two bfloat16) is
 *     given to all lanes. Of floats the last vector may be filled in part; bfloat16 must fill it, or the plain kernel
 *     works.
 *   - Winograd's algorithm (arXiv 1509.09308) for 3x3 kernels on floats: 2.25 times fewer multiplications, the
 *     same bits only for areas that begin on the same multiples of two pixels.
 *   - fine: 4 outputs, which are the 2x2 pixels of a plane of one channel at twice the size. Lanes are
 *     inputs, summed up at the end.
 */
#ifndef RX_NN_DIRECT_H
#define RX_NN_DIRECT_H

#include "base/error.h"
#include "nn/plane.h"

typedef struct rx_direct_options {
    int fine;     /* rx_direct_can_fine() */
    int winograd; /* where it can be had */
    int lanes;    /* of vectors at most, 1: the plain kernel; 0: as the processor has them */
} rx_direct_options;

int rx_direct_can_fine(const rx_conv_shape *shape);

int rx_direct_has_bf16(void);     /* 1: this processor multiplies bfloat16 itself */
const char *rx_direct_name(void); /* of its widest vectors */

/* weights [out][in][k][k], bias [out]; both are copied. Errors: RX_SYSTEM (memory). */
rx_status rx_direct_new(const rx_conv_shape *shape, rx_direct_options options, const float *weights,
                        const float *bias, rx_direct **dst, rx_error *err);
void rx_direct_load(rx_direct *direct, const float *weights, const float *bias); /* others, of that shape */
void rx_direct_free(rx_direct *direct);                                          /* NULL is fine */
int rx_direct_lanes(const rx_direct *direct); /* of the vectors that it works on */

/* Columns [left, right) of rows [first, last) of y = relu?(add? + b + sum w x). The first row of x is the first
 * that row 0 of y reads. For fine, y is the plane of twice the size, while columns and rows are those of x. add may
 * not be y. The columns that are read must be there: left and right keep half a kernel from the borders of x. */
void rx_direct_run(const rx_direct *direct, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                   rx_direct_area area, float *scratch);
size_t rx_direct_scratch(void); /* floats */

/* Gradient by the weights: dweights[k][k][in][out] += sum over the outputs of x dy, floats. Column 0 and row 0 of x
 * are the first that output (0, 0) reads, whatever shape->before. lanes: as in rx_direct_options. The gradient by
 * x is a convolution of dy (nn/runner.c). */
void rx_direct_weights(const rx_conv_shape *shape, int lanes, const rx_plane *x, const rx_plane *dy,
                       float *dweights);

/* The same for dst = relu?(bilinear(src) + add?), to twice the size (rx_layer_up2(), and its bits); 0, and nothing done,
 * where the channels are no multiple of the lanes. src has a row more above and below; the columns of `area`, which
 * is one of dst, keep away from its left and right border. */
int rx_direct_up2(const rx_plane *src, const rx_plane *add, int relu, const rx_plane *dst,
                  rx_direct_area area);

/* What this machine convolves at most: the measure that a network's speed is compared with. *flops: additions and multiplications per second of one thread, the fastest of as many runs as fit into 50
 * ms of a 3x3 convolution (by the definition) of 64 to 64 channels on 56 x 56 pixels, whose planes
 * stay in the cache. Errors: RX_SYSTEM. */
rx_status rx_direct_peak(rx_real real, double *flops, rx_error *err);

#endif
