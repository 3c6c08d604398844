/* The networks of PSF-NET on patches of one side, with what stands around them (nn/front.h), forward and
 * backward. Patches are dense [side][side] planes. A network keeps what its last forward needs for the
 * gradient, so a chain of both is walked back before either is used again. */
#ifndef RX_TRAIN_STEP_PASS_H
#define RX_TRAIN_STEP_PASS_H

#include "nn/model.h"
#include "train/sample.h"

typedef struct rx_pass rx_pass;

/* with_psf: the PSF network too. Allocates all that is ever needed. Errors: RX_USAGE (side, the model has no
 * PSF network, front.rl_steps above RX_FRONT_STEPS), RX_SYSTEM. */
rx_status rx_pass_new(const rx_model *model, int side, int with_psf, rx_pass **dst, rx_error *err);
void rx_pass_free(rx_pass *pass);        /* NULL is fine */
int rx_pass_stages(const rx_pass *pass); /* of RESTORE: 1 or 2 */

/* The model's parameters as they are now. */
void rx_pass_load(rx_pass *pass);

/* The PSF of the sample: width, K' (cut to the patch and of sum 1 where it is larger), and, where
 * rx_pass_restore() will make `w`, the Tikhonov filter, O = K' * (target PSF). And which of its pixels the
 * Richardson-Lucy steps may use: those whose light comes from inside the patch, as nothing there can explain
 * the wings of a bright star beyond its border. Errors: RX_INPUT (a kernel that is not finite). */
rx_status rx_pass_optics(rx_pass *pass, const rx_sample *sample, int with_filter, rx_error *err);

/* out = RESTORE(x). w: Tikhonov copy of x (not used by BLIND networks), which was cut from a larger field, as
 * x was; NULL: x is complete in itself, w is made here, on the patch's cyclic domain. x, w must stay until
 * the gradient. */
void rx_pass_restore(rx_pass *pass, const float *x, const float *w, float *out);
/* gradient[k][parameters of network k], of those that restore, += from dout; dx (NULL: not wanted) = gradient by x, through the Tikhonov
 * copy too when that was made here. */
void rx_pass_restore_back(rx_pass *pass, const float *dout, float *const gradient[RX_MODEL_NETS], float *dx);

/* out = PSF(y); y must stay until the gradient. */
void rx_pass_blur(rx_pass *pass, const float *y, float *out);
void rx_pass_blur_back(rx_pass *pass, const float *dout, float *gradient, float *dy);

#endif
