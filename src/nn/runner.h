/* A network in training, on planes of one size: forward and backward. The forward pass gives the values of nn/stream.h,
 * which runs a trained network, within rounding.
 *
 * A runner belongs to one caller at a time and never uses more than the thread that calls it: several cores take
 * several runners, each in its own thread. Values do not depend on how many there are.
 *
 * An image of 128 x 128 pixels through a PSF-NET of 6 blocks, forward and backward, with the parameters of a batch of 8
 * loaded, takes these milliseconds (one core of an AMD EPYC with AVX-512), and took those by oneDNN 2.6:
 *
 *   width   4     5     8     16
 *   here    1.6   3.0   3.6   12.1
 *   oneDNN  1.5   2.9   4.3   15.3
 *
 * Memory: all planes and their gradients. */
#ifndef RX_NN_RUNNER_H
#define RX_NN_RUNNER_H

#include "nn/net.h"

typedef struct rx_runner rx_runner;

/* height, width: multiples of 2^levels. The net is only read, and must live as long. Errors: RX_INPUT (size),
 * RX_SYSTEM (memory). */
rx_status rx_runner_new(const rx_net *net, int height, int width, rx_runner **dst, rx_error *err);
void rx_runner_free(rx_runner *runner); /* NULL is fine */

/* Take params [net->nparams] into use (after each change of theirs; rx_runner_new() takes net->params). */
void rx_runner_load(rx_runner *runner, const float *params);

float *rx_runner_input(rx_runner *runner); /* [height][width][channels of node 0], to be filled */
void rx_runner_forward(rx_runner *runner);
const float *rx_runner_output(const rx_runner *runner); /* [height'][width'][channels] of the last node */

/* After a forward: fill the gradient of the loss by the output (it is overwritten), then run; param_gradient
 * [nparams] += (NULL: not wanted), and where wanted the gradient by the input appears. */
float *rx_runner_output_gradient(rx_runner *runner);
void rx_runner_backward(rx_runner *runner, float *param_gradient, int want_input);
const float *rx_runner_input_gradient(const rx_runner *runner);

#endif
