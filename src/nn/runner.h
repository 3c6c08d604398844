/* A network at work on planes of one size, forward and (in training) backward, on oneDNN.
 *
 * A runner belongs to one caller at a time and never uses more than the thread that calls it, whatever OpenMP
 * would allow (nn/dnn.h): several cores take several runners, each in its own thread, OpenMP's or not; one
 * thread may make a runner and another use it. Values do not depend on how many there are.
 *
 * Nor does a pixel's value depend on the plane around it: two planes that agree within rx_net_halo() of a
 * block give it the same bits, if they lie on the same multiples of 2^levels, whatever their sizes. That
 * holds because every operation of the forward pass is one convolution in the library's plain direction,
 * whose kernels sum over channels and places in an order that the size does not change; the transposed
 * direction does not have that property on all processors, so TRANSPOSED runs folded. Held by
 * tests/unit/nn/test_psfnet.c.
 *
 * Memory without gradients: the planes alive at the same time, 52 to 72 bytes per pixel for a PSF-NET of
 * width 8 in single precision, 92 to 124 for width 16; with gradients all planes, 264 for width 8.
 */
#ifndef RX_NN_RUNNER_H
#define RX_NN_RUNNER_H

#include "nn/net.h"

typedef struct rx_runner rx_runner;

/* height, width: multiples of 2^levels. backward: keeps what the gradient needs (RX_F32 only). The net is
 * only read, and must live as long. Errors: RX_INPUT (size), RX_SYSTEM (memory, or the library says no),
 * RX_USAGE (bfloat16 that this processor or library does not offer). */
rx_status rx_runner_new(const rx_net *net, int height, int width, int backward, rx_precision precision,
                        rx_runner **dst, rx_error *err);
void rx_runner_free(rx_runner *runner); /* NULL is fine */

int rx_runner_has_bf16(void); /* 1 where RX_BF16 works on this machine */

/* Take params [net->nparams] into use (after each change of theirs; rx_runner_new() takes net->params). */
rx_status rx_runner_load(rx_runner *runner, const float *params, rx_error *err);

float *rx_runner_input(rx_runner *runner); /* [height][width][channels of node 0], to be filled */
rx_status rx_runner_forward(rx_runner *runner, rx_error *err);
const float *rx_runner_output(const rx_runner *runner); /* [height'][width'][channels] of the last node */

/* After a forward: fill the gradient of the loss by the output (it is overwritten), then run; param_gradient
 * [nparams] += (NULL: not wanted), and where wanted the gradient by the input appears. */
float *rx_runner_output_gradient(rx_runner *runner);
rx_status rx_runner_backward(rx_runner *runner, float *param_gradient, int want_input, rx_error *err);
const float *rx_runner_input_gradient(const rx_runner *runner);

#endif
