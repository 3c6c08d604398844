/* RESTORE in one stage or two, and PSF, with stretch, Tikhonov copy and Richardson-Lucy steps, there and back. */
#include "train/step_pass.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/deblur.h"
#include "nn/rl_step.h"
#include "nn/runner.h"
#include "num/convolve.h"

/* A network of RESTORE and the Richardson-Lucy steps after it. */
typedef struct stage {
    rx_runner *runner; /* owned; NULL: no such stage */
    float *sum;        /* [pixels] base + network: s(v) */
    rx_rl_step *rl[RX_FRONT_STEPS];
    float *sharp[RX_FRONT_STEPS]; /* real planes: what each step begins with */
} stage;

struct rx_pass {
    const rx_model *model;
    int side;
    size_t pixels;
    float fwhm;             /* channel of the sample's PSF */
    stage first, second;    /* of RESTORE */
    rx_runner *psf;         /* owned; NULL without */
    float *psf_sum;         /* [pixels] base + network of the last PSF */
    const float *x, *w, *y; /* of the last forward */
    int own_w;              /* w was made here */
    float *filtered;        /* [pixels] that w */
    float *slope;           /* [pixels] gradient by v, by w */
    float *made, *left;     /* [pixels] f of the first stage, x - K' max(f, 0); two stages only */
    float *by_made, *by_w;  /* [pixels] gradients by f and, from the second stage, by s(w) */
    /* INFORMED only: */
    rx_fft *fft;
    int steps;              /* Richardson-Lucy steps after each network */
    float *kernel;          /* K' cut to the patch */
    int kernel_size;        /* at most RX_SAMPLE_KERNEL */
    float *tikhonov, *half; /* complex planes */
    rx_rl_step *blur;       /* K' alone */
    float *data, *work;     /* real planes of fft: x and what comes out */
    float *inside;          /* real plane: 1 where the light of the sample's x is that of its y, else 0 */
    const float *weight;    /* of the last forward: inside, or NULL */
    float *back, *other;    /* real planes: gradients */
};

int rx_pass_stages(const rx_pass *pass)
{
    return pass->second.runner != NULL ? 2 : 1;
}

/* ---- making ---- */

static int odd_at_most(int n)
{
    return n % 2 == 1 ? n : n - 1;
}

static rx_status new_steps(const rx_pass *pass, stage *stage, rx_error *err)
{
    for (int i = 0; i < pass->steps && stage->runner != NULL; i++) {
        RX_TRY(rx_rl_step_new(pass->fft, &stage->rl[i], err));
        stage->sharp[i] = rx_fft_real(pass->fft);
        if (stage->sharp[i] == NULL)
            return rx_error_memory(err, pass->pixels * sizeof(float));
    }
    return RX_OK;
}

static rx_status new_optics(rx_pass *pass, rx_error *err)
{
    RX_TRY(rx_fft_new(pass->side, pass->side, 1, &pass->fft, err));
    pass->steps = pass->model->front.rl_steps;
    RX_TRY(new_steps(pass, &pass->first, err));
    RX_TRY(new_steps(pass, &pass->second, err));
    RX_TRY(rx_rl_step_new(pass->fft, &pass->blur, err));
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
    return bad ? rx_error_memory(err, pass->pixels * 10 * sizeof(float)) : RX_OK;
}

static rx_status new_stage(const rx_pass *pass, const rx_net *net, stage *stage, rx_error *err)
{
    RX_TRY(RX_MAKE(stage->sum, pass->pixels, err));
    return rx_runner_new(net, pass->side, pass->side, &stage->runner, err);
}

static rx_status new_parts(rx_pass *pass, int with_psf, rx_error *err)
{
    const rx_model *model = pass->model;
    float **planes[] = {&pass->psf_sum, &pass->filtered, &pass->slope, &pass->made,
                        &pass->left,    &pass->by_made,  &pass->by_w};
    const size_t few = model->second != NULL ? sizeof planes / sizeof planes[0] : 3;
    for (size_t i = 0; i < few; i++)
        RX_TRY(RX_MAKE(*planes[i], pass->pixels, err));
    RX_TRY(new_stage(pass, model->restore, &pass->first, err));
    if (model->second != NULL)
        RX_TRY(new_stage(pass, model->second, &pass->second, err));
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

static void free_stage(stage *stage)
{
    rx_runner_free(stage->runner);
    free(stage->sum);
    for (int i = 0; i < RX_FRONT_STEPS; i++) {
        rx_rl_step_free(stage->rl[i]);
        free(stage->sharp[i]);
    }
}

void rx_pass_free(rx_pass *pass)
{
    if (pass == NULL)
        return;
    free_stage(&pass->first);
    free_stage(&pass->second);
    rx_runner_free(pass->psf);
    rx_rl_step_free(pass->blur);
    rx_fft_free(pass->fft);
    float *const owned[] = {pass->psf_sum, pass->filtered, pass->slope,  pass->made,     pass->left,
                            pass->by_made, pass->by_w,     pass->kernel, pass->tikhonov, pass->half,
                            pass->data,    pass->work,     pass->inside, pass->back,     pass->other};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++)
        free(owned[i]);
    free(pass);
}

void rx_pass_load(rx_pass *pass)
{
    rx_runner_load(pass->first.runner, pass->model->restore->params);
    if (pass->second.runner != NULL)
        rx_runner_load(pass->second.runner, pass->model->second->params);
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
    rx_rl_step_blur(pass->blur, pass->work, pass->work);
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
    rx_rl_step_kernel(pass->blur, pass->kernel, pass->kernel_size);
    for (int i = 0; i < pass->steps; i++) {
        rx_rl_step_kernel(pass->first.rl[i], pass->kernel, pass->kernel_size);
        if (pass->second.runner != NULL)
            rx_rl_step_kernel(pass->second.rl[i], pass->kernel, pass->kernel_size);
    }
    if (pass->steps > 0)
        find_inside(pass, sample);
    if (!with_filter)
        return RX_OK;
    return rx_deblur_tikhonov(pass->fft, pass->kernel, pass->kernel_size,
                              &(rx_tikhonov){front->target_fwhm, front->tikhonov, 1}, pass->tikhonov, err);
}

/* ---- RESTORE ---- */

static void fill_first(rx_pass *pass)
{
    float *input = rx_runner_input(pass->first.runner);
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

/* Beside what the first stage was given: what it made, and what of x that leaves. */
static void fill_second(rx_pass *pass)
{
    const size_t n = (size_t)pass->side, stride = (size_t)rx_fft_stride_real(pass->fft);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++)
            pass->work[y * stride + x] = rx_rl_light(pass->made[y * n + x]);
    rx_rl_step_blur(pass->blur, pass->work, pass->work);
    from_plane(pass, pass->work, pass->left);
    float *input = rx_runner_input(pass->second.runner);
    for (size_t k = 0; k < pass->pixels; k++) {
        pass->left[k] = pass->x[k] - pass->left[k];
        input[5 * k] = rx_stretch(pass->x[k]);
        input[5 * k + 1] = rx_stretch(pass->w[k]);
        input[5 * k + 2] = pass->fwhm;
        input[5 * k + 3] = rx_stretch(pass->made[k]);
        input[5 * k + 4] = rx_stretch(pass->left[k]);
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

/* out = the steps after base + network */
static void run_stage(rx_pass *pass, stage *stage, const float *base, float *out)
{
    rx_runner_forward(stage->runner);
    const float *net = rx_runner_output(stage->runner);
    for (size_t k = 0; k < pass->pixels; k++) {
        stage->sum[k] = rx_stretch(base[k]) + net[k];
        out[k] = rx_unstretch(stage->sum[k]);
    }
    if (pass->steps == 0)
        return;
    to_plane(pass, out, stage->sharp[0]);
    for (int i = 0; i < pass->steps; i++)
        rx_rl_step_forward(stage->rl[i], stage->sharp[i], pass->data, pass->weight,
                           pass->model->front.pedestal,
                           i + 1 < pass->steps ? stage->sharp[i + 1] : pass->work);
    from_plane(pass, pass->work, out);
}

void rx_pass_restore(rx_pass *pass, const float *x, const float *w, float *out)
{
    const int informed = pass->model->front.mode == RX_MODE_INFORMED, two = pass->second.runner != NULL;
    set_inputs(pass, x, w);
    pass->weight = w != NULL ? pass->inside : NULL;
    if (informed)
        to_plane(pass, x, pass->data);
    fill_first(pass);
    run_stage(pass, &pass->first, informed ? pass->w : pass->x, two ? pass->made : out);
    if (!two)
        return;
    fill_second(pass);
    run_stage(pass, &pass->second, pass->made, out);
}

/* slope = gradient by v; *dx += gradient by the data of the steps, NULL: not wanted. */
static void back_through_steps(rx_pass *pass, stage *stage, const float *dout, float *dx)
{
    if (pass->steps == 0) {
        memcpy(pass->slope, dout, pass->pixels * sizeof *dout);
        return;
    }
    to_plane(pass, dout, pass->work);
    for (int i = pass->steps - 1; i >= 0; i--) {
        rx_rl_step_backward(stage->rl[i], pass->work, pass->back, dx != NULL ? pass->other : NULL);
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

/* Through steps and network: slope = gradient by the base's stretch. */
static void back_through_stage(rx_pass *pass, stage *stage, const float *dout, float *gradient,
                               int want_input, float *dx)
{
    back_through_steps(pass, stage, dout, dx);
    float *dnet = rx_runner_output_gradient(stage->runner);
    for (size_t k = 0; k < pass->pixels; k++) {
        pass->slope[k] *= rx_unstretch_slope(stage->sum[k]);
        dnet[k] = pass->slope[k];
    }
    rx_runner_backward(stage->runner, gradient, want_input);
}

/* by_made = gradient by f, which the second stage had as its base, as a plane, and in what is left of x; by_w. */
static void collect_second(rx_pass *pass, float *dx)
{
    const float *input = rx_runner_input_gradient(pass->second.runner);
    const size_t n = (size_t)pass->side, stride = (size_t)rx_fft_stride_real(pass->fft);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            const size_t k = y * n + x;
            const float left = input[5 * k + 4] * rx_stretch_slope(pass->left[k]);
            pass->other[y * stride + x] = left;
            pass->by_made[k] = (pass->slope[k] + input[5 * k + 3]) * rx_stretch_slope(pass->made[k]);
            pass->by_w[k] = input[5 * k + 1];
            if (dx != NULL)
                dx[k] += input[5 * k] * rx_stretch_slope(pass->x[k]) + left;
        }
    rx_rl_step_blur_back(pass->blur, pass->other, pass->other);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++)
            if (pass->made[y * n + x] > 0)
                pass->by_made[y * n + x] -= pass->other[y * stride + x];
}

/* dx += the gradients by the first network's input planes and by its base (in slope). */
static void collect_first(rx_pass *pass, float *dx)
{
    const float *input = rx_runner_input_gradient(pass->first.runner);
    const int two = pass->second.runner != NULL;
    if (pass->model->front.mode == RX_MODE_BLIND) {
        for (size_t k = 0; k < pass->pixels; k++)
            dx[k] += (input[k] + pass->slope[k]) * rx_stretch_slope(pass->x[k]);
        return;
    }
    for (size_t k = 0; k < pass->pixels; k++) {
        const float by_w = input[3 * k + 1] + pass->slope[k] + (two ? pass->by_w[k] : 0);
        pass->slope[k] = by_w * rx_stretch_slope(pass->w[k]);
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

void rx_pass_restore_back(rx_pass *pass, const float *dout, float *const gradient[RX_MODEL_NETS], float *dx)
{
    if (dx != NULL)
        memset(dx, 0, pass->pixels * sizeof *dx);
    if (pass->second.runner != NULL) {
        back_through_stage(pass, &pass->second, dout, gradient[RX_NET_SECOND], 1, dx);
        collect_second(pass, dx);
        dout = pass->by_made;
    }
    back_through_stage(pass, &pass->first, dout, gradient[RX_NET_RESTORE], dx != NULL, dx);
    if (dx != NULL)
        collect_first(pass, dx);
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
