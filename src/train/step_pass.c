/* RESTORE and PSF with stretch, Tikhonov copy and Richardson-Lucy step, there and back. */
#include "train/step_pass.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/deblur.h"
#include "nn/rl_step.h"
#include "nn/runner.h"
#include "num/convolve.h"

struct rx_pass {
    const rx_model *model;
    int side;
    size_t pixels;
    float fwhm;             /* channel of the sample's PSF */
    rx_runner *restore;     /* owned */
    rx_runner *psf;         /* owned; NULL without */
    float *restore_sum;     /* [pixels] base + network of the last RESTORE: s(v) */
    float *psf_sum;         /* the same of PSF */
    const float *x, *w, *y; /* of the last forward */
    int own_w;              /* w was made here */
    float *filtered;        /* [pixels] that w */
    float *slope;           /* [pixels] gradient by v, by w */
    /* INFORMED only: */
    rx_fft *fft;
    int steps; /* Richardson-Lucy steps after the network */
    rx_rl_step *rl[RX_FRONT_STEPS];
    float *kernel;          /* K' cut to the patch */
    int kernel_size;        /* at most RX_SAMPLE_KERNEL */
    float *tikhonov, *half; /* complex planes */
    float *data, *work;     /* real planes of fft: x and what comes out */
    float *inside;          /* real plane: 1 where the light of the sample's x is that of its y, else 0 */
    const float *weight;    /* of the last forward: inside, or NULL */
    float *sharp[RX_FRONT_STEPS]; /* real planes: what each step begins with */
    float *back, *other;          /* real planes: gradients */
};

/* ---- making ---- */

static int odd_at_most(int n)
{
    return n % 2 == 1 ? n : n - 1;
}

static rx_status new_optics(rx_pass *pass, rx_error *err)
{
    rx_status status = rx_fft_new(pass->side, pass->side, 1, &pass->fft, err);
    pass->steps = pass->model->front.rl_steps;
    for (int i = 0; i < pass->steps && status == RX_OK; i++)
        status = rx_rl_step_new(pass->fft, &pass->rl[i], err);
    if (status != RX_OK)
        return status;
    const int largest = odd_at_most(pass->side);
    pass->kernel_size = largest < RX_SAMPLE_KERNEL ? largest : RX_SAMPLE_KERNEL;
    pass->kernel = RX_NEW(float, (size_t)pass->kernel_size *(size_t)pass->kernel_size);
    pass->tikhonov = rx_fft_complex(pass->fft);
    pass->half = rx_fft_complex(pass->fft);
    float **planes[] = {&pass->data, &pass->work, &pass->inside, &pass->back, &pass->other};
    int bad = pass->kernel == NULL || pass->tikhonov == NULL || pass->half == NULL;
    for (size_t i = 0; i < sizeof planes / sizeof planes[0]; i++) {
        *planes[i] = rx_fft_real(pass->fft);
        bad |= *planes[i] == NULL;
    }
    for (int i = 0; i < pass->steps; i++) {
        pass->sharp[i] = rx_fft_real(pass->fft);
        bad |= pass->sharp[i] == NULL;
    }
    return bad ? rx_error_memory(err, pass->pixels * 10 * sizeof(float)) : RX_OK;
}

static rx_status new_parts(rx_pass *pass, int with_psf, rx_error *err)
{
    const rx_model *model = pass->model;
    pass->restore_sum = RX_NEW(float, pass->pixels);
    pass->psf_sum = RX_NEW(float, pass->pixels);
    pass->filtered = RX_NEW(float, pass->pixels);
    pass->slope = RX_NEW(float, pass->pixels);
    if (pass->restore_sum == NULL || pass->psf_sum == NULL || pass->filtered == NULL || pass->slope == NULL)
        return rx_error_memory(err, pass->pixels * 4 * sizeof(float));
    RX_TRY(rx_runner_new(model->restore, pass->side, pass->side, &pass->restore, err));
    if (with_psf)
        RX_TRY(rx_runner_new(model->psf, pass->side, pass->side, &pass->psf, err));
    if (model->front.mode == RX_MODE_INFORMED)
        RX_TRY(new_optics(pass, err));
    return RX_OK;
}

static rx_status check(const rx_model *model, int side, int with_psf, rx_error *err)
{
    if (side < 4)
        return rx_error_set(err, RX_USAGE, "training images of %d pixels; give 4 or more", side);
    if (with_psf && model->psf == NULL)
        return rx_error_set(
            err, RX_USAGE,
            "this loss needs the PSF network, which the model does not have; set LOSS_IDT_PSF, "
            "LOSS_REC and LOSS_REC_PSF to 0");
    if (model->front.rl_steps < 0 || model->front.rl_steps > RX_FRONT_STEPS)
        return rx_error_set(err, RX_USAGE, "training through %d Richardson-Lucy steps; give 0 to %d",
                            model->front.rl_steps, (int)RX_FRONT_STEPS);
    return RX_OK;
}

rx_status rx_pass_new(const rx_model *model, int side, int with_psf, rx_pass **dst, rx_error *err)
{
    *dst = NULL;
    RX_TRY(check(model, side, with_psf, err));
    rx_pass *pass = RX_NEW(rx_pass, 1);
    if (pass == NULL)
        return rx_error_memory(err, sizeof *pass);
    pass->model = model;
    pass->side = side;
    pass->pixels = (size_t)side * (size_t)side;
    rx_status status = new_parts(pass, with_psf, err);
    if (status != RX_OK) {
        rx_pass_free(pass);
        return status;
    }
    *dst = pass;
    return RX_OK;
}

void rx_pass_free(rx_pass *pass)
{
    if (pass == NULL)
        return;
    rx_runner_free(pass->restore);
    rx_runner_free(pass->psf);
    for (int i = 0; i < RX_FRONT_STEPS; i++) {
        rx_rl_step_free(pass->rl[i]);
        free(pass->sharp[i]);
    }
    rx_fft_free(pass->fft);
    float *const owned[] = {pass->restore_sum, pass->psf_sum,  pass->filtered, pass->slope,
                            pass->kernel,      pass->tikhonov, pass->half,     pass->data,
                            pass->work,        pass->inside,   pass->back,     pass->other};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++)
        free(owned[i]);
    free(pass);
}

void rx_pass_load(rx_pass *pass)
{
    rx_runner_load(pass->restore, pass->model->restore->params);
    if (pass->psf != NULL)
        rx_runner_load(pass->psf, pass->model->psf->params);
}

/* ---- planes ---- */

static void to_plane(const rx_pass *pass, const float *dense, float *plane)
{
    const size_t n = (size_t)pass->side, stride = (size_t)rx_fft_stride_real(pass->fft);
    for (size_t y = 0; y < n; y++)
        memcpy(plane + y * stride, dense + y * n, n * sizeof *dense);
}

static void from_plane(const rx_pass *pass, const float *plane, float *dense)
{
    const size_t n = (size_t)pass->side, stride = (size_t)rx_fft_stride_real(pass->fft);
    for (size_t y = 0; y < n; y++)
        memcpy(dense + y * n, plane + y * stride, n * sizeof *dense);
}

static void cut_kernel(rx_pass *pass, const float *kernel)
{
    const int n = pass->kernel_size, skip = (RX_SAMPLE_KERNEL - n) / 2;
    double sum = 0;
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
            const float value = kernel[(size_t)(j + skip) * RX_SAMPLE_KERNEL + (size_t)(i + skip)];
            pass->kernel[(size_t)j * (size_t)n + (size_t)i] = value;
            sum += value;
        }
    for (size_t k = 0; skip > 0 && k < (size_t)n * (size_t)n; k++)
        pass->kernel[k] = (float)(pass->kernel[k] / sum);
}

/* Light from beyond the patch, and what the cyclic domain brings round, is a difference between the blurred
 * field and the blurred patch; an error of the PSF that is given makes a small one as well. */
static void find_inside(rx_pass *pass, const rx_sample *sample)
{
    const float faint = 0.5f, share = 0.25f; /* noise sigmas; of the pixel's light */
    const size_t n = (size_t)pass->side, stride = (size_t)rx_fft_stride_real(pass->fft);
    to_plane(pass, sample->y, pass->work);
    rx_rl_step_blur(pass->rl[0], pass->work, pass->work);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            const float light = sample->blurred[y * n + x], own = pass->work[y * stride + x];
            pass->inside[y * stride + x] = fabsf(light - own) <= faint + share * fabsf(light) ? 1 : 0;
        }
}

rx_status rx_pass_optics(rx_pass *pass, const rx_sample *sample, int with_filter, rx_error *err)
{
    const rx_front *front = &pass->model->front;
    pass->fwhm = rx_front_fwhm(sample->fwhm);
    if (front->mode != RX_MODE_INFORMED)
        return RX_OK;
    cut_kernel(pass, sample->kernel);
    for (int i = 0; i < pass->steps; i++)
        rx_rl_step_kernel(pass->rl[i], pass->kernel, pass->kernel_size);
    if (pass->steps > 0)
        find_inside(pass, sample);
    if (!with_filter)
        return RX_OK;
    return rx_deblur_tikhonov(pass->fft, pass->kernel, pass->kernel_size,
                              &(rx_tikhonov){front->target_fwhm, front->tikhonov, 1}, pass->tikhonov, err);
}

/* ---- RESTORE ---- */

static void fill_restore(rx_pass *pass)
{
    float *input = rx_runner_input(pass->restore);
    if (pass->model->front.mode == RX_MODE_BLIND) {
        for (size_t k = 0; k < pass->pixels; k++)
            input[k] = rx_stretch(pass->x[k]);
        return;
    }
    for (size_t k = 0; k < pass->pixels; k++) {
        input[3 * k] = rx_stretch(pass->x[k]);
        input[3 * k + 1] = rx_stretch(pass->w[k]);
        input[3 * k + 2] = pass->fwhm;
    }
}

/* The copy of x where none was given. */
static void set_inputs(rx_pass *pass, const float *x, const float *w)
{
    pass->x = x;
    pass->w = w;
    pass->own_w = w == NULL && pass->model->front.mode == RX_MODE_INFORMED;
    if (!pass->own_w)
        return;
    to_plane(pass, x, pass->work);
    rx_convolve(pass->fft, pass->tikhonov, pass->work, pass->half, pass->work);
    from_plane(pass, pass->work, pass->filtered);
    pass->w = pass->filtered;
}

void rx_pass_restore(rx_pass *pass, const float *x, const float *w, float *out)
{
    set_inputs(pass, x, w);
    fill_restore(pass);
    rx_runner_forward(pass->restore);
    const float *net = rx_runner_output(pass->restore);
    const float *base = pass->model->front.mode == RX_MODE_INFORMED ? pass->w : pass->x;
    for (size_t k = 0; k < pass->pixels; k++) {
        pass->restore_sum[k] = rx_stretch(base[k]) + net[k];
        out[k] = rx_unstretch(pass->restore_sum[k]);
    }
    if (pass->steps == 0)
        return;
    pass->weight = w != NULL ? pass->inside : NULL;
    to_plane(pass, x, pass->data);
    to_plane(pass, out, pass->sharp[0]);
    for (int i = 0; i < pass->steps; i++)
        rx_rl_step_forward(pass->rl[i], pass->sharp[i], pass->data, pass->weight, pass->model->front.pedestal,
                           i + 1 < pass->steps ? pass->sharp[i + 1] : pass->work);
    from_plane(pass, pass->work, out);
}

/* slope = gradient by v; *dx += gradient by the data of the steps, NULL: not wanted. */
static void back_through_steps(rx_pass *pass, const float *dout, float *dx)
{
    if (pass->steps == 0) {
        memcpy(pass->slope, dout, pass->pixels * sizeof *dout);
        return;
    }
    to_plane(pass, dout, pass->work);
    for (int i = pass->steps - 1; i >= 0; i--) {
        rx_rl_step_backward(pass->rl[i], pass->work, pass->back, dx != NULL ? pass->other : NULL);
        if (dx != NULL) {
            from_plane(pass, pass->other, pass->slope);
            for (size_t k = 0; k < pass->pixels; k++)
                dx[k] += pass->slope[k];
        }
        float *done = pass->work;
        pass->work = pass->back;
        pass->back = done;
    }
    from_plane(pass, pass->work, pass->slope);
}

/* dx += the gradients by the network's input planes and by base + network (in slope). */
static void collect_restore(rx_pass *pass, float *dx)
{
    const float *input = rx_runner_input_gradient(pass->restore);
    if (pass->model->front.mode == RX_MODE_BLIND) {
        for (size_t k = 0; k < pass->pixels; k++)
            dx[k] += (input[k] + pass->slope[k]) * rx_stretch_slope(pass->x[k]);
        return;
    }
    for (size_t k = 0; k < pass->pixels; k++) {
        pass->slope[k] = (input[3 * k + 1] + pass->slope[k]) * rx_stretch_slope(pass->w[k]);
        dx[k] += input[3 * k] * rx_stretch_slope(pass->x[k]);
    }
    if (pass->own_w) {
        to_plane(pass, pass->slope, pass->work);
        rx_correlate(pass->fft, pass->tikhonov, pass->work, pass->half, pass->work);
        from_plane(pass, pass->work, pass->slope);
        for (size_t k = 0; k < pass->pixels; k++)
            dx[k] += pass->slope[k];
    }
}

void rx_pass_restore_back(rx_pass *pass, const float *dout, float *gradient, float *dx)
{
    if (dx != NULL)
        memset(dx, 0, pass->pixels * sizeof *dx);
    back_through_steps(pass, dout, dx);
    float *dnet = rx_runner_output_gradient(pass->restore);
    for (size_t k = 0; k < pass->pixels; k++) {
        pass->slope[k] *= rx_unstretch_slope(pass->restore_sum[k]);
        dnet[k] = pass->slope[k];
    }
    rx_runner_backward(pass->restore, gradient, dx != NULL);
    if (dx != NULL)
        collect_restore(pass, dx);
}

/* ---- PSF ---- */

void rx_pass_blur(rx_pass *pass, const float *y, float *out)
{
    pass->y = y;
    float *input = rx_runner_input(pass->psf);
    for (size_t k = 0; k < pass->pixels; k++) {
        input[RX_PSF_CHANNELS * k] = rx_stretch(y[k]);
        input[RX_PSF_CHANNELS * k + 1] = pass->fwhm;
    }
    rx_runner_forward(pass->psf);
    const float *net = rx_runner_output(pass->psf);
    for (size_t k = 0; k < pass->pixels; k++) {
        pass->psf_sum[k] = rx_stretch(y[k]) + net[k];
        out[k] = rx_unstretch(pass->psf_sum[k]);
    }
}

void rx_pass_blur_back(rx_pass *pass, const float *dout, float *gradient, float *dy)
{
    float *dnet = rx_runner_output_gradient(pass->psf);
    for (size_t k = 0; k < pass->pixels; k++) {
        pass->slope[k] = dout[k] * rx_unstretch_slope(pass->psf_sum[k]);
        dnet[k] = pass->slope[k];
    }
    rx_runner_backward(pass->psf, gradient, dy != NULL);
    if (dy == NULL)
        return;
    const float *input = rx_runner_input_gradient(pass->psf);
    for (size_t k = 0; k < pass->pixels; k++)
        dy[k] = (input[RX_PSF_CHANNELS * k] + pass->slope[k]) * rx_stretch_slope(pass->y[k]);
}
