/* The networks at work on many samples at a time: a step of train/step.h per thread, OpenMP over samples.
 *
 * Each sample's gradient has a buffer of its own, and these are added in the order of the samples, so that
 * the sums have the same bytes for any number of threads. */
#ifndef RX_TRAIN_LEARNER_H
#define RX_TRAIN_LEARNER_H

#include "train/stars.h"
#include "train/state.h"
#include "train/step.h"

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
/* sum[parameters of the network] += those of the n samples, one after the other: the bytes of the sum do not depend on
 * the threads, nor on how ranks share the samples. */
void rx_learner_add(const rx_learner *learner, int net, int n, float *sum);

/* Test any number of samples. */
rx_status rx_learner_test(rx_learner *learner, rx_sample *const *samples, int n, rx_test_image *dst,
                          rx_error *err);

#endif
