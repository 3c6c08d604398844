/* A network in training, on planes of one size: forward and backward, on oneDNN (nn/dnn.h says why not on the
 * kernels of inference, nn/direct.h). The forward pass gives the values of nn/stream.h within rounding.
 *
 * A runner belongs to one caller at a time and never uses more than the thread that calls it, whatever OpenMP
 * would allow: several cores take several runners, each in its own thread, OpenMP's or not; one thread may
 * make a runner and another use it. Values do not depend on how many there are.
 *
 * Memory: all planes, 264 bytes per pixel for a PSF-NET of width 8 in single precision.
 */
#ifndef RX_NN_RUNNER_H
#define RX_NN_RUNNER_H

#include "nn/net.h"

typedef struct rx_runner rx_runner;

/* height, width: multiples of 2^levels. The net is only read, and must live as long. Errors: RX_INPUT (size),
 * RX_SYSTEM (memory, or the library says no). */
rx_status rx_runner_new(const rx_net *net, int height, int width, rx_runner **dst, rx_error *err);
void rx_runner_free(rx_runner *runner); /* NULL is fine */

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
