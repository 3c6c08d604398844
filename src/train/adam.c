/* Adam and the learning rate's schedule. */
#include "train/adam.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

rx_status rx_adam_new(long n, rx_adam **dst, rx_error *err)
{
    rx_adam *adam = RX_NEW(rx_adam, 1);
    if (adam == NULL)
        return rx_error_memory(err, sizeof *adam);
    *adam = (rx_adam){.n = n, .beta1 = 0.9, .beta2 = 0.99, .epsilon = 1e-8};
    adam->mean = RX_NEW(float, (size_t)n);
    adam->square = RX_NEW(float, (size_t)n);
    if (adam->mean == NULL || adam->square == NULL) {
        rx_adam_free(adam);
        return rx_error_memory(err, 2 * (size_t)n * sizeof(float));
    }
    *dst = adam;
    return RX_OK;
}

void rx_adam_free(rx_adam *adam)
{
    if (adam == NULL)
        return;
    free(adam->mean);
    free(adam->square);
    free(adam);
}

void rx_adam_step(rx_adam *adam, const float *gradient, double rate, float *params)
{
    const double b1 = adam->beta1, b2 = adam->beta2;
    adam->steps++;
    const double unbias1 = 1 / (1 - pow(b1, (double)adam->steps));
    const double unbias2 = 1 / (1 - pow(b2, (double)adam->steps));
    for (long i = 0; i < adam->n; i++) {
        const double g = gradient[i];
        const double mean = b1 * adam->mean[i] + (1 - b1) * g;
        const double square = b2 * adam->square[i] + (1 - b2) * g * g;
        adam->mean[i] = (float)mean;
        adam->square[i] = (float)square;
        params[i] -= (float)(rate * unbias1 * mean / (sqrt(unbias2 * square) + adam->epsilon));
    }
}

double rx_gradient_clip(float *const *gradients, const long *n, int count, double most)
{
    double sum = 0;
    for (int k = 0; k < count; k++)
        for (long i = 0; i < n[k]; i++)
            sum += (double)gradients[k][i] * gradients[k][i];
    const double norm = sqrt(sum);
    if (most > 0 && norm > most)
        for (int k = 0; k < count; k++)
            for (long i = 0; i < n[k]; i++)
                gradients[k][i] = (float)(gradients[k][i] * (most / norm));
    return norm;
}

double rx_schedule(double progress, double warmup)
{
    const double pi = 3.14159265358979323846;
    if (progress >= 1)
        return 0;
    if (progress < warmup)
        return progress / warmup;
    return 0.5 * (1 + cos(pi * (progress - warmup) / (1 - warmup)));
}

long rx_schedule_low(long from, long to, int epochs, double warmup)
{
    const double low = 0.1;
    long n = 0;
    for (long e = from; e < to; e++) {
        const double progress = (double)e / epochs;
        n += progress >= warmup && rx_schedule(progress, warmup) < low;
    }
    return n;
}
