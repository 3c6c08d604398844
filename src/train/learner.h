/* The networks at work on many samples at a time: a step of train/step.h per thread, OpenMP over samples.
 *
 * Each sample's gradient has a buffer of its own, and these are added in the order of the samples, so that
 * the sums have the same bytes for any number of threads.
 *
 * How well a restored patch shows its stars, by a quick detection and plain fluxes, for the dictionary:
 *
 * Recall: of the listed stars of S/N above 5 whose centre is at least `margin` pixels from the border, the
 * share that is found. A detection is a pixel above 1.7 (noise of the input's sky: what the findings on
 * restored pixels give a precision of 0.95) that is larger than its eight neighbours; a star is found when
 * one of them lies within 1.5 pixels, brighter stars choosing first, the nearest one; each detection serves
 * one star.
 *
 * Flux: sums of the pixels within 2 FWHM of the target PSF of stars of S/N above 12, A(restored) / A(truth) -
 * 1; the circle must lie within the margin, and the star must be isolated: the truth in the circle exceeds
 * its own flux by less than 5 % (no more than a tenth falls outside or is missing). Nothing is tuned: noise
 * of the data is part of the scatter, sources that are not in the list part of both sums. */
#ifndef RX_TRAIN_LEARNER_H
#define RX_TRAIN_LEARNER_H

#include "train/step.h"

typedef struct rx_star_check {
    double stars, found; /* of S/N above 5, and those found */
    double ratios;       /* stars behind error[] */
    double error[RX_SAMPLE_STARS];
} rx_star_check;

/* restored[side][side] of that sample, as it is shown (nn/front.h). Errors: RX_SYSTEM. */
rx_status rx_star_check_run(const rx_sample *sample, const float *restored, int margin, double target_fwhm,
                            rx_star_check *dst, rx_error *err);

typedef struct rx_learner rx_learner;

/* What one test image says, numbers only, so that training ranks can share them by adding. */
typedef struct rx_test_image {
    double loss;  /* identity term of RESTORE */
    double input; /* the same of the blurred image itself */
    rx_star_check check;
} rx_test_image;
enum { RX_TEST_NUMBERS = sizeof(rx_test_image) / sizeof(double) };

/* For `most` samples at a time. The model is read, and must live as long. Errors: RX_SYSTEM. */
rx_status rx_learner_new(const rx_model *model, const rx_step_params *par, int side, int most, int nthreads,
                         rx_learner **dst, rx_error *err);
void rx_learner_free(rx_learner *learner); /* NULL is fine */

/* Take the model's parameters into use. */
void rx_learner_load(rx_learner *learner);

/* The gradients of n <= most samples, each kept in a place of its own; values[i]: terms of each sample. */
rx_status rx_learner_gradients(rx_learner *learner, rx_sample *const *samples, int n, rx_step_values *values,
                               rx_error *err);
/* sum[rx_model_params()] += those of the n samples, one after the other: the bytes of the sum do not depend on the
 * threads, nor on how ranks share the samples. */
void rx_learner_add(const rx_learner *learner, int n, float *sum);

/* Test any number of samples. */
rx_status rx_learner_test(rx_learner *learner, rx_sample *const *samples, int n, rx_test_image *dst,
                          rx_error *err);

/* Scale a gradient down so that its norm is at most `most` (0: leave it); returns the norm before. */
double rx_gradient_clip(float *gradient, long n, double most);

#endif
