/* One Richardson-Lucy step and its gradient. */
#include "nn/rl_step.h"

#include <stdlib.h>

#include "base/memory.h"
#include "num/convolve.h"

struct rx_rl_step {
    const rx_fft *fft;
    const rx_rl_kernel *kernel;
    size_t n;     /* floats of a plane; what lies beyond its width is of no meaning */
    float *half;  /* complex plane */
    float *model; /* m */
    float *back;  /* c = K'^T r */
    float *share; /* q = K'^T W; unused without weights */
    float *work;
    const float *f, *x, *weight; /* of the last forward */
    float pedestal;
};

void rx_rl_kernel_set(const rx_fft *fft, const float *stamp, int size, rx_rl_kernel *dst)
{
    double sum = 0;
    for (size_t k = 0; k < (size_t)size * (size_t)size; k++)
        sum += stamp[k];
    dst->sum = (float)sum;
    rx_convolve_spectrum(fft, stamp, size, dst->spectrum);
}

rx_status rx_rl_step_new(const rx_fft *fft, const rx_rl_kernel *kernel, rx_rl_step **dst, rx_error *err)
{
    rx_rl_step *step;
    *dst = NULL;
    RX_TRY(RX_MAKE(step, 1, err));
    step->fft = fft;
    step->kernel = kernel;
    step->n = (size_t)rx_fft_stride_real(fft) * (size_t)rx_fft_height(fft);
    step->half = rx_fft_complex(fft);
    step->model = rx_fft_real(fft);
    step->back = rx_fft_real(fft);
    step->share = rx_fft_real(fft);
    step->work = rx_fft_real(fft);
    if (step->half == NULL || step->model == NULL || step->back == NULL || step->share == NULL ||
        step->work == NULL) {
        const size_t bytes = 6 * step->n * sizeof(float);
        rx_rl_step_free(step);
        return rx_error_memory(err, bytes);
    }
    *dst = step;
    return RX_OK;
}

void rx_rl_step_free(rx_rl_step *step)
{
    if (step == NULL)
        return;
    free(step->half);
    free(step->model);
    free(step->back);
    free(step->share);
    free(step->work);
    free(step);
}

void rx_rl_step_forward(rx_rl_step *step, const float *f, const float *x, const float *weight,
                        double pedestal, float *out)
{
    const float p = (float)pedestal, *kernel = step->kernel->spectrum;
    step->f = f;
    step->x = x;
    step->weight = weight;
    step->pedestal = p;
    for (size_t k = 0; k < step->n; k++)
        step->work[k] = rx_rl_light(f[k]);
    rx_convolve(step->fft, kernel, step->work, step->half, step->model);
    for (size_t k = 0; k < step->n; k++)
        step->work[k] = rx_rl_ratio(x[k], step->model[k], weight != NULL ? weight[k] : 1, p);
    rx_correlate(step->fft, kernel, step->work, step->half, step->back);
    if (weight != NULL)
        rx_correlate(step->fft, kernel, weight, step->half, step->share);
    for (size_t k = 0; k < step->n; k++)
        out[k] = rx_rl_update(f[k], step->back[k], weight != NULL ? step->share[k] : step->kernel->sum);
}

void rx_rl_step_backward(rx_rl_step *step, const float *dout, float *df, float *dx)
{
    const float *f = step->f, *x = step->x, *weight = step->weight, *kernel = step->kernel->spectrum;
    const float p = step->pedestal;
    /* work = dout f / q, df = dout c / q */
    for (size_t k = 0; k < step->n; k++) {
        const float q = weight != NULL ? step->share[k] : step->kernel->sum;
        const int made = f[k] > 0 && q >= RX_RL_SHARE, most = !(step->back[k] < RX_RL_MOST * q);
        const float gain = most ? RX_RL_MOST : step->back[k] / q;
        const int least = !(gain > RX_RL_LEAST);
        step->work[k] = made && !most && !least ? dout[k] * f[k] / q : 0;
        if (df != NULL)
            df[k] = dout[k] * (!made ? 1 : least ? RX_RL_LEAST : gain);
    }
    rx_convolve(step->fft, kernel, step->work, step->half, step->work);
    for (size_t k = 0; k < step->n; k++) {
        const int free_model = step->model[k] + p > p / 4;
        const float model = free_model ? step->model[k] + p : p / 4;
        const float g = step->work[k] * (weight != NULL ? weight[k] : 1) / model;
        if (dx != NULL)
            dx[k] = g;
        step->work[k] = free_model ? -g * (x[k] + p) / model : 0;
    }
    if (df == NULL)
        return;
    rx_correlate(step->fft, kernel, step->work, step->half, step->work);
    for (size_t k = 0; k < step->n; k++)
        df[k] += f[k] > 0 ? step->work[k] : 0;
}
