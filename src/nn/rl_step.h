/* One Richardson-Lucy step with the known PSF, after the network and inside its training:
 *
 *   m  = K' max(f, 0)
 *   r  = W (x + p) / max(m + p, p/4)
 *   f' = f min(max(K'^T r / K'^T W, 1/4), 4)   where f > 0, else f
 *
 *   f   sharp plane, x: data, both in noise units above the sky
 *   K'  relative PSF (nn/deblur.h)
 *   W   weights: 1, 0 under the mask and beyond the border; NULL: all 1 and K'^T W = the sum of K'
 *   p   pedestal (front.h)
 *
 * Multiplicative on f alone: where the network says sky (0) it stays sky, where it says source the flux
 * returns to what the data have. Where K'^T W < RX_RL_SHARE (hardly any data) f stays. A step at
 * most makes four times as much of a pixel: beside a bright star that the network missed r is in the
 * thousands, and a faint neighbour is not to become that star. Nor does it leave less than a quarter: near the
 * target's own FWHM K' has negative lobes (nn/deblur.h), whose r of the thousands would turn a bright star
 * over (FWHM 1.8: 6000 became -2e7, a training loss of 2e6 and a gradient of 7e7 in one image). Planes are
 * real planes of an rx_fft (cyclic domain).
 *
 * Light is not negative: a network's negative values, such as the rings of a filter around a bright star, are
 * not light that a blur could spread, and next to such a star r is so large that a step would make them the
 * brightest pixels of the image (an untrained network: mean loss 13 instead of 2, the largest gradient of 25
 * samples 13,000 instead of 130).
 *
 * Gradients, with c = K'^T r, q = K'^T W, g = K'(dout f / q), all terms but `dout` only where f > 0:
 *
 *   dL/df = dout c / q - K'^T [ g W (x + p) / (m + p)^2 ]   (second term only where m + p > p/4)
 *           dout                                            where f <= 0
 *           dout 4 or dout / 4, and g without it            where c / q is beyond these
 *   dL/dx = g W / max(m + p, p/4) */
#ifndef RX_NN_RL_STEP_H
#define RX_NN_RL_STEP_H

#include "base/error.h"
#include "num/fft.h"

/* least share of K' on pixels with data, where the step is made */
#define RX_RL_SHARE 0.02f
/* least and most that a step makes of a pixel, as factors */
#define RX_RL_LEAST 0.25f
#define RX_RL_MOST 4.0f

/* r of one pixel, for callers that blur by other means */
static inline float rx_rl_ratio(float x, float m, float weight, float pedestal)
{
    const float model = m + pedestal, least = pedestal / 4;
    return weight * (x + pedestal) / (model > least ? model : least);
}
/* the light in f, which m is made of */
static inline float rx_rl_light(float f)
{
    return f > 0 ? f : 0;
}
/* f' from f, c and q; without branches, for loops on vectors */
static inline float rx_rl_update(float f, float c, float q)
{
    const int enough = q >= RX_RL_SHARE, made = (f > 0) & enough;
    const float ratio = c / (enough ? q : 1), least = ratio > RX_RL_LEAST ? ratio : RX_RL_LEAST;
    const float gain = c < RX_RL_MOST * q ? least : RX_RL_MOST;
    return made ? f * gain : f;
}

/* K' as the steps take it: its spectrum, a complex plane of the fft that is the caller's, and its sum. */
typedef struct rx_rl_kernel {
    float *spectrum;
    float sum;
} rx_rl_kernel;

/* From stamp[size][size], odd, not larger than the domain; dst->spectrum is there. */
void rx_rl_kernel_set(const rx_fft *fft, const float *stamp, int size, rx_rl_kernel *dst);

typedef struct rx_rl_step rx_rl_step;

/* Scratch for steps with a constant K', which may be another one in each forward. One object, one caller at a time; `fft`
 * and `kernel` must outlive it. Errors: RX_SYSTEM. */
rx_status rx_rl_step_new(const rx_fft *fft, const rx_rl_kernel *kernel, rx_rl_step **dst, rx_error *err);
void rx_rl_step_free(rx_rl_step *step); /* NULL is fine */

/* out = f'; keeps m, K'^T r and K'^T W for the gradient, until which f, x and weight must stay. out may not be f.
 * Allocates nothing. */
void rx_rl_step_forward(rx_rl_step *step, const float *f, const float *x, const float *weight,
                        double pedestal, float *out);

/* Of the last forward: gradients df by f and dx by x (planes, set; NULL: not requested) from dout = gradient by f'.
 * df, dx may not be dout, nor each other. */
void rx_rl_step_backward(rx_rl_step *step, const float *dout, float *df, float *dx);

#endif
