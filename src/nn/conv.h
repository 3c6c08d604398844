/* A convolution in training, forward and backward, on the kernels of nn/direct.h; planes are floats [height][width]
 * [channels] with 0 beyond the border, which a copy with a border stands in for.
 *
 *   y  = relu?(add? + b + sum w x)
 *   dx : the convolution of dy, 0 between its pixels where the stride is 2, with the kernel turned round
 *   dw = sum over pixels of x dy,  db = sum over pixels of dy      (dy by what is before sum and cut)
 *
 * One thread. An image of 128 x 128 pixels through a PSF-NET of 6 blocks, forward and backward, with the parameters
 * of a batch of 8 loaded, takes these milliseconds (one core of an AMD EPYC with AVX-512), and took those by oneDNN
 * 2.6:
 *
 *   width   4     5     8     16
 *   here    1.6   3.0   3.6   12.1
 *   oneDNN  1.5   2.9   4.3   15.3 */
#ifndef RX_NN_CONV_H
#define RX_NN_CONV_H

#include "base/error.h"
#include "nn/plane.h"

typedef struct rx_conv rx_conv;

/* fine: y is the plane of twice the size with the 2x2 pixels that are the 4 outputs, where the kernels can do that
 * (rx_conv_is_fine()). Errors: RX_SYSTEM (memory). */
rx_status rx_conv_new(const rx_conv_shape *shape, int fine, rx_conv **dst, rx_error *err);
void rx_conv_free(rx_conv *conv); /* NULL is fine */
int rx_conv_is_fine(const rx_conv *conv);

/* Floats of scratch that the functions below overwrite. */
size_t rx_conv_scratch(const rx_conv *conv);

/* weights [out][in][k][k], bias [out]; both are copied. */
void rx_conv_load(rx_conv *conv, const float *weights, const float *bias);

/* add: NULL without shape.sum */
void rx_conv_run(const rx_conv *conv, const float *x, const float *add, float *y, float *scratch);
void rx_conv_data(const rx_conv *conv, const float *dy, float *dx, float *scratch);

/* Afterwards *dweights [out][in][k][k] and *dbias [out] point into the object. */
void rx_conv_weights(rx_conv *conv, const float *x, const float *dy, float *scratch, const float **dweights,
                     const float **dbias);

#endif
