/* Convolutions of a band of rows on AVX-512, or on AVX2 with fused multiply-add (floats alone); bfloat16
 * needs the instructions for it.
 *
 * What oneDNN does, by the definition (nn/dnn.h), for shapes of a band whose channels fill vectors: no
 * planes to be padded or rearranged, nothing compiled at run time, and only the pixels that are asked for,
 * with their sum, cut and rounding on the way. The values agree with oneDNN's to rounding and do not depend
 * on which pixels are asked for.
 *
 *   - wide: outputs a multiple of a vector's lanes (16, 8). Registers hold the sums of pixels side by
 *     side, and a word of the input (one float or two bfloat16) is given to all lanes.
 *   - fine: 4 outputs, which are the 2x2 pixels of a plane of one channel at twice the size. Lanes are
 *     inputs, summed up at the end.
 */
#ifndef RX_NN_DIRECT_H
#define RX_NN_DIRECT_H

#include "nn/layers.h"

typedef struct rx_direct rx_direct; /* packed weights; only read when it runs */

/* Whether this processor does it (as far as oneDNN is let: ONEDNN_MAX_CPU_ISA), for a shape with `band` and
 * without `backward`; fine: as above. */
int rx_direct_can(const rx_conv_shape *shape, int fine);

/* weights [out][in][k][k], bias [out]; both are copied. Errors: RX_SYSTEM (memory). */
rx_status rx_direct_new(const rx_conv_shape *shape, int fine, const float *weights, const float *bias,
                        rx_direct **dst, rx_error *err);
void rx_direct_free(rx_direct *direct); /* NULL is fine */

/* Columns [left, right) of rows [first, last) of y = relu?(add? + b + sum w x). The first row of x is the
 * first that row 0 of y reads. For fine, y is the plane of twice the size, while columns and rows are those
 * of x. add may not be y. The columns that are read must be there: left and right keep half a kernel from the
 * borders of x. */
typedef struct rx_direct_area {
    int left, right, first, last;
} rx_direct_area;
void rx_direct_run(const rx_direct *direct, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                   rx_direct_area area, float *scratch);
size_t rx_direct_scratch(void); /* floats */

/* The same for dst = relu?(bilinear(src) + add?), to twice the size (rx_layer_up2(), and its bits), for
 * channels that are a multiple of the lanes. src has a row more above and below; the columns of `area`, which
 * is one of dst, keep away from its left and right border. */
int rx_direct_can_up2(const rx_plane *src, const rx_plane *dst);
void rx_direct_up2(const rx_plane *src, const rx_plane *add, int relu, const rx_plane *dst,
                   rx_direct_area area);

#endif
