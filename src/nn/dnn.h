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

typedef struct rx_conv_shape {
    int height, width; /* of x; y has 1/stride of them */
    int in, out, kernel, stride;
    int before, after; /* pixels of 0 on the left and top, on the right and bottom */
    int band;          /* none on top and bottom: y has only rows that see all theirs in x */
    rx_real x, y;      /* of the planes; weights are bfloat16 where x is */
    int sum;           /* adds a plane */
    int relu;          /* cuts at 0, last */
    int backward;      /* gradients are wanted, too */
    int fast; /* may use Winograd's algorithm (arXiv 1509.09308): 2.25 times fewer multiplications, the
                 same bits only for planes that begin on the same multiples of two pixels */
} rx_conv_shape;

/* Errors: RX_SYSTEM (memory, or the library refuses). */
rx_status rx_dnn_new(rx_dnn **dst, rx_error *err);
void rx_dnn_free(rx_dnn *dnn); /* NULL is fine */

/* 1: this processor multiplies bfloat16 itself, has AVX-512 (F, BW, VL, DQ), has AVX2, and oneDNN may use it
 * (ONEDNN_MAX_CPU_ISA). */
int rx_dnn_has_bf16(void);
int rx_dnn_has_avx512(void);
int rx_dnn_has_avx2(void);

rx_status rx_conv_new(rx_dnn *dnn, const rx_conv_shape *shape, rx_conv **dst, rx_error *err);
void rx_conv_free(rx_conv *conv); /* NULL is fine */

/* weights [out][in][k][k], bias [out]; both are copied. */
rx_status rx_conv_load(rx_conv *conv, const float *weights, const float *bias, rx_error *err);

/* y = relu?(add? + b + sum w x); add, with `sum` only, may be y */
rx_status rx_conv_run(rx_conv *conv, const void *x, const void *add, void *y, rx_error *err);

/* Only with `backward`. dx from dy, both by what is before sum and relu. */
rx_status rx_conv_data(rx_conv *conv, const void *dy, void *dx, rx_error *err);

/* Only with `backward`. Afterwards *dweights [out][in][k][k] and *dbias [out] point into the object. */
rx_status rx_conv_weights(rx_conv *conv, const void *x, const void *dy, const float **dweights,
                          const float **dbias, rx_error *err);

/* Version of the library, and the instruction sets that it takes (bits of dnnl_cpu_isa_t). */
void rx_dnn_library(char *dst, size_t size);

#endif
