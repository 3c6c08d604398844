/* Convolutions of a fixed shape on oneDNN, the only file that knows that library (versions 2 and 3).
 *
 * Planes are NHWC, batch 1: [height][width][channels], 64-byte aligned or not. Weights are [out][in][k][k] as
 * the user has them; they are repacked when loaded. Everything here runs on the calling thread alone, inside
 * an OpenMP region or not: the library asks OpenMP how many threads there are both when a primitive is made
 * and when it runs, so each call sets that number to one for its thread and puts it back. Scratch memory
 * belongs to the rx_dnn (never to a thread), so that an object made by one thread may be used by another.
 */
#ifndef RX_NN_DNN_H
#define RX_NN_DNN_H

#include <stddef.h>

#include "base/error.h"

typedef struct rx_dnn rx_dnn;   /* engine, stream, scratch memory: one caller at a time */
typedef struct rx_conv rx_conv; /* belongs to an rx_dnn, which outlives it */

typedef enum rx_real { RX_REAL_F32, RX_REAL_BF16 } rx_real;
static inline size_t rx_real_bytes(rx_real real)
{
    return real == RX_REAL_F32 ? 4 : 2;
}

enum {                     /* what a convolution is to do, to be or-ed */
       RX_CONV_RUN = 1,    /* y = b + sum w x (the plain direction) */
       RX_CONV_DATA = 2,   /* dx from dy: the transposed direction, without bias */
       RX_CONV_WEIGHTS = 4 /* dw and db from x and dy */
};

typedef struct rx_conv_shape {
    int height, width; /* of x; y has 1/stride of them */
    int in, out, kernel, stride;
    int before, after; /* pixels of 0 on the left and top, on the right and bottom */
    rx_real x, y;      /* of the planes; weights are bfloat16 where x is (RX_CONV_DATA: where y is) */
    int bias;          /* RX_CONV_RUN adds a bias, RX_CONV_WEIGHTS gives its gradient */
    int sum;           /* RX_CONV_RUN adds what y held before */
    int relu;          /* RX_CONV_RUN cuts at 0, last */
    int uses;          /* RX_CONV_.. */
} rx_conv_shape;

/* Errors: RX_SYSTEM (memory, or the library refuses). */
rx_status rx_dnn_new(rx_dnn **dst, rx_error *err);
void rx_dnn_free(rx_dnn *dnn); /* NULL is fine */

int rx_dnn_has_bf16(void); /* 1: this processor multiplies bfloat16 itself */

rx_status rx_conv_new(rx_dnn *dnn, const rx_conv_shape *shape, rx_conv **dst, rx_error *err);
void rx_conv_free(rx_conv *conv); /* NULL is fine */

/* weights [out][in][k][k], bias [out] (NULL where the shape has none); both are copied. */
rx_status rx_conv_load(rx_conv *conv, const float *weights, const float *bias, rx_error *err);

rx_status rx_conv_run(rx_conv *conv, const void *x, void *y, rx_error *err);
rx_status rx_conv_data(rx_conv *conv, const void *dy, void *dx, rx_error *err);

/* Afterwards *dweights [out][in][k][k] and *dbias [out] (NULL without) point into the object. */
rx_status rx_conv_weights(rx_conv *conv, const void *x, const void *dy, const float **dweights,
                          const float **dbias, rx_error *err);

#endif
