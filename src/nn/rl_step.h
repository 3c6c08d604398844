/* One Richardson-Lucy step with the known PSF, after the network and inside its training:
 *
 *   m  = K' f,   r = W (x + p) / max(m + p, p/4),   f' = f  K'^T r / K'^T W
 *
 * f: sharp plane, x: data, both in noise units above the sky, K': relative PSF (nn/deblur.h), W: weights (1,
 * 0 under the mask and beyond the border; NULL: all 1 and K'^T W = 1), p: pedestal (front.h). Multiplicative
 * on f alone: where the network says sky (0) it stays sky, where it says source the flux returns to what the
 * data have. Planes are real planes of an rx_fft (cyclic domain). */
#ifndef RX_NN_RL_STEP_H
#define RX_NN_RL_STEP_H

#include "base/error.h"
#include "num/fft.h"

typedef struct rx_rl_step rx_rl_step;

/* Scratch and kernel for one constant K' (stamp[size][size]). One object, one caller at a time. `fft` must
 * outlive it. */
rx_status rx_rl_step_new(const rx_fft *fft, rx_rl_step **dst, rx_error *err);
void rx_rl_step_kernel(rx_rl_step *step, const float *stamp, int size);
void rx_rl_step_free(rx_rl_step *step);

/* out = f'; keeps m and K'^T r for the gradient. out may not be f. */
void rx_rl_step_forward(rx_rl_step *step, const float *f, const float *x, const float *weight,
                        double pedestal, float *out);
/* After forward, with the same f, x, weight: df [plane] = gradient by f from dout = gradient by f'. */
void rx_rl_step_backward(rx_rl_step *step, const float *f, const float *x, const float *weight,
                         double pedestal, const float *dout, float *df);

#endif
