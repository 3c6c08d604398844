/* A network at work on planes of one size, forward and (in training) backward, on oneDNN.
 *
 * A runner belongs to one thread at a time; to use several cores, several runners run at the same time, each
 * inside an OpenMP thread (or any other), where oneDNN then stays on one thread. Values do not depend on how
 * many there are, and those of a pixel not on the size of the plane (beyond the halo), to the bit.
 */
#ifndef RX_NN_RUNNER_H
#define RX_NN_RUNNER_H

#include "nn/net.h"

typedef enum rx_precision {
    RX_F32,
    RX_BF16 /* inner planes and weights bfloat16, sums float; input, output and what is added to them float */
} rx_precision;

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

/* After a forward: fill the gradient of the loss by the output, then run; param_gradient [nparams] += , and
 * where wanted the gradient by the input appears. */
float *rx_runner_output_gradient(rx_runner *runner);
rx_status rx_runner_backward(rx_runner *runner, float *param_gradient, int want_input, rx_error *err);
const float *rx_runner_input_gradient(const rx_runner *runner);

#endif
