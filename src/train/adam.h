/* Adam (Kingma and Ba 2015, arXiv 1412.6980) on one array of parameters, and the learning rate's schedule. */
#ifndef RX_TRAIN_ADAM_H
#define RX_TRAIN_ADAM_H

#include "base/error.h"

typedef struct rx_adam {
    long n;
    float *mean, *square; /* [n], owned */
    long steps;
    double beta1, beta2, epsilon; /* [0.9, 0.99, 1e-8] */
} rx_adam;

rx_status rx_adam_new(long n, rx_adam **dst, rx_error *err);
void rx_adam_free(rx_adam *adam);

/* params -= rate mean' / (sqrt(square') + epsilon), with the usual bias corrections. */
void rx_adam_step(rx_adam *adam, const float *gradient, double rate, float *params);

/* Scale the gradients down so that their joint norm is at most `most` (0: leave them); returns the norm
 * before. */
double rx_gradient_clip(float *const *gradients, const long *n, int count, double most);

/* Fraction (0..1) of the highest rate at `progress` (0..1) of the training: linear warm-up, then a half
 * cosine down to 0. */
double rx_schedule(double progress, double warmup);

/* How many of the epochs from .. to - 1, counted from 0, of a training of that many begin on the way down and
 * below a tenth of the highest rate: where little is left to learn, and no improvement is news. */
long rx_schedule_low(long from, long to, int epochs, double warmup);

#endif
