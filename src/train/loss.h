/* Terms of the training loss, each a mean over the inner window of a patch, with its gradient.
 *
 *   pixels   mean of weight (out - truth)^2            LINEAR: weight = 1/s^2, s from the input only (below)
 *                                                      PLAIN: weight = 1
 *                                                      STRETCHED: s(out), s(truth) of nn/front.h, weight = 1
 *   light    mean of weight (S out - S truth)^2        S: Gauss of sigma 1.5 px, nothing outside the window. A
 *            sharp image errs most in where light lies, by fractions of a pixel; this term is of how much there is
 *   FFL      focal frequency loss (Jiang et al. 2021, ICCV; alpha = 1) of D = F(s(out)) - F(s(truth)) on the
 *            window, F the orthonormal 2-D DFT: mean of w |D|^2, w = |D| / max |D|, clipped to 0..1, constant
 *            for the gradient 2/M F^-1(w D) (then times the slope of the stretch)
 *
 * The window leaves `margin` pixels on each side out: there the light of neighbours is missing. */
#ifndef RX_TRAIN_LOSS_H
#define RX_TRAIN_LOSS_H

#include "base/error.h"

typedef enum rx_loss_kind { RX_LOSS_LINEAR, RX_LOSS_PLAIN, RX_LOSS_STRETCHED } rx_loss_kind;

/* weight[side][side] = floor^2 / (floor^2 + m^2), m = local brightness: the largest value of
 * Gauss(sigma 1.5 px, normalised inside the patch) * max(input, 0) in the 7 x 7 neighbourhood. floor in noise
 * units, > 0. The relative weights of a faint and a bright star depend on the input alone, so that the
 * minimum stays the conditional mean of the flux. work[2 side^2] is overwritten; weight may not be input. */
void rx_loss_weights(const float *input, int side, double floor, float *work, float *weight);

typedef struct rx_loss {
    rx_loss_kind kind;
    int side, margin;
    const float *weight; /* [side][side], of LINEAR only */
} rx_loss;

/* value += scale * term; gradient[side][side] += its gradient by out (NULL: not requested). */
void rx_loss_pixels(const rx_loss *loss, const float *out, const float *truth, double scale, double *value,
                    float *gradient);

/* The same of the light; weight as there, 1 without (STRETCHED, too, is of fluxes here). work[2 side^2] is overwritten. */
void rx_loss_light(const rx_loss *loss, const float *out, const float *truth, double scale, float *work,
                   double *value, float *gradient);

/* Plans and scratch, for a margin that leaves something; one caller at a time. Errors: RX_SYSTEM. */
typedef struct rx_ffl rx_ffl;
rx_status rx_ffl_new(int side, int margin, rx_ffl **dst, rx_error *err);
void rx_ffl_free(rx_ffl *ffl); /* NULL is fine */
/* value += scale * term; gradient[side][side] += its gradient by out (NULL: not wanted). Allocates nothing. */
void rx_ffl_add(rx_ffl *ffl, const float *out, const float *truth, double scale, double *value,
                float *gradient);

#endif
