/* One sample through PSF-NET and back: the paper's joint loss and its gradient.
 *
 *   L_idt = d(RESTORE(x), y) + d(PSF(y), x)
 *   L_rec = d(RESTORE(PSF(y)), y) + d(PSF(RESTORE(x)), x)
 *   L_ffl = focal frequency loss of RESTORE(x) against y
 *
 * and one of our own, of the light of RESTORE(x) against y (train/loss.h).
 *
 * d is the pixel loss of train/loss.h, its weights from the input: x for d(RESTORE(x), y) and
 * d(PSF(RESTORE(x)), x), y for the other two. Terms of weight 0 are not computed. RESTORE includes what
 * stands around the network (nn/front.h): stretch, Tikhonov copy (of PSF(y): made on the patch), second stage,
 * Richardson-Lucy steps; the gradient goes through all of it. */
#ifndef RX_TRAIN_STEP_H
#define RX_TRAIN_STEP_H

#include "nn/model.h"
#include "train/loss.h"
#include "train/sample.h"

typedef struct rx_step_params {
    rx_loss_kind kind;
    double idt_restore, idt_psf, rec_restore, rec_psf, light, ffl; /* weights of the terms, >= 0 */
    double floor;                                                  /* of rx_loss_weights() */
    int margin;                                                    /* pixels */
    double clip; /* largest norm of a sample's gradient; 0: any (train/learner.h) */
} rx_step_params;

typedef struct rx_step_values {
    double total, idt_restore, idt_psf, rec_restore, rec_psf, light,
        ffl; /* unweighted terms; total weighted */
} rx_step_values;

/* Scratch, runners and plans for samples of one side; one per thread. The model's networks are read and must
 * live as long; call rx_step_load() after their parameters changed. Errors: RX_USAGE (side, margin, a term
 * that needs a PSF network that the model lacks, front.rl_steps above RX_FRONT_STEPS), RX_SYSTEM. */
typedef struct rx_step rx_step;
rx_status rx_step_new(const rx_model *model, const rx_step_params *par, int side, rx_step **dst,
                      rx_error *err);
void rx_step_free(rx_step *step); /* NULL is fine */
void rx_step_load(rx_step *step);

/* gradient[rx_model_params()] +=, network after network; NULL: only values are wanted. Errors: RX_INPUT (a sample of
 * another side, a kernel that is not finite), RX_SYSTEM. */
rx_status rx_step_run(rx_step *step, const rx_sample *sample, float *gradient, rx_step_values *values,
                      rx_error *err);

/* RESTORE(x) of the last run, [side][side]; NULL when no term needs it. */
const float *rx_step_restored(const rx_step *step);

#endif
