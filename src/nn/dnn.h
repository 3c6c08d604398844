/* Convolutions of a fixed shape for training, forward and backward, on oneDNN: the only file that knows that
 * library (versions 2 and 3). Not in librextract: what runs a trained network are the kernels of nn/direct.h.
 *
 * Planes are floats, NHWC, batch 1: [height][width][channels], 64-byte aligned or not, with 0 beyond the border. Weights are [out][in][k][k] as
 * the user has them; they are repacked when loaded. Everything here runs on the calling thread alone, inside
 * an OpenMP region or not: the library asks OpenMP how many threads there are both when a primitive is made
 * and when it runs, so each call sets that number to one for its thread and puts it back. Scratch memory
 * belongs to the rx_dnn (never to a thread), so that an object made by one thread may be used by another.
 */
#ifndef RX_NN_DNN_H
#define RX_NN_DNN_H

#include "base/error.h"
#include "nn/plane.h"

typedef struct rx_dnn rx_dnn;   /* engine, stream, scratch memory: one caller at a time */
typedef struct rx_conv rx_conv; /* belongs to an rx_dnn, which outlives it */

/* Errors: RX_SYSTEM (memory, or the library refuses). */
rx_status rx_dnn_new(rx_dnn **dst, rx_error *err);
void rx_dnn_free(rx_dnn *dnn); /* NULL is fine */

rx_status rx_conv_new(rx_dnn *dnn, const rx_conv_shape *shape, rx_conv **dst, rx_error *err);
void rx_conv_free(rx_conv *conv); /* NULL is fine */

/* weights [out][in][k][k], bias [out]; both are copied. */
rx_status rx_conv_load(rx_conv *conv, const float *weights, const float *bias, rx_error *err);

/* y = relu?(add? + b + sum w x); add, with `sum` only, may be y */
rx_status rx_conv_run(rx_conv *conv, const void *x, const void *add, void *y, rx_error *err);

/* dx from dy, both by what is before sum and relu. */
rx_status rx_conv_data(rx_conv *conv, const void *dy, void *dx, rx_error *err);

/* Afterwards *dweights [out][in][k][k] and *dbias [out] point into the object. */
rx_status rx_conv_weights(rx_conv *conv, const void *x, const void *dy, const float **dweights,
                          const float **dbias, rx_error *err);

#endif
