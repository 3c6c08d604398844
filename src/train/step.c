/* The joint loss of PSF-NET on one sample: the networks with what stands around them, there and back, then the terms of the
 * loss, first those that begin at the blurred image, then those from the sharp one.
 *
 * Patches are dense [side][side] planes, and real planes of an FFT where optics work on them. A network keeps what its last
 * forward needs for the gradient, so a chain of both is walked back before either is used again. */
#include "train/step.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/deblur.h"
#include "nn/layers.h"
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

struct rx_step {
    const rx_model *model;
    rx_step_params par;
    int side;
    size_t pixels;
    long at[RX_MODEL_NETS];       /* where a network's parameters begin in a gradient */
    int from_blurred, from_sharp; /* chains that have a term */
    rx_ffl *ffl;                  /* NULL without that term */

    float *dense;                   /* [pixels] planes, owned: */
    float *restored;                /* RESTORE(x) */
    float *blurred, *again;         /* PSF(RESTORE(x)) or PSF(y), RESTORE(PSF(y)) */
    float *gradient, *inner, *back; /* by the chain's first output, its second one, and what comes back */
    float *weight, *scratch;        /* of the loss; scratch: two planes */
    float *psf_sum;                 /* base + network of the last PSF */
    float *filtered;                /* Tikhonov copy that was made here */
    float *slope;                   /* gradient by v, by w */
    float *made, *left;             /* f of the first stage, x - K' max(f, 0); two stages only */
    float *by_made, *by_w;          /* gradients by f and, from the second stage, by s(w) */

    float fwhm;             /* channel of the sample's PSF */
    stage first, second;    /* of RESTORE */
    rx_runner *psf;         /* owned; NULL without */
    const float *x, *w, *y; /* of the last forward */
    int own_w;              /* w was made here */

    /* INFORMED only: */
    rx_fft *fft;
    int steps;              /* Richardson-Lucy steps after each network */
    float *stamp;           /* K' cut to the patch */
    int stamp_size;         /* at most RX_SAMPLE_KERNEL */
    rx_rl_kernel kernel;    /* the same */
    float *tikhonov, *half; /* complex planes */
    float *data, *work;     /* real planes of fft: x and what comes out */
    float *inside;          /* real plane: 1 where the light of the sample's x is that of its y, else 0 */
    const float *used;      /* of the last forward: inside, or NULL */
    float *before, *other;  /* real planes: gradients */
};

/* ---- making ---- */

static rx_status new_dense(rx_step *s, rx_error *err)
{
    float **const planes[] = {&s->restored, &s->blurred, &s->again,     &s->gradient,   &s->inner,  &s->back,
                              &s->weight,   &s->psf_sum, &s->filtered,  &s->slope,      &s->made,   &s->left,
                              &s->by_made,  &s->by_w,    &s->first.sum, &s->second.sum, &s->scratch};
    const size_t n = sizeof planes / sizeof planes[0];
    RX_TRY(RX_MAKE(s->dense, (n + 1) * s->pixels, err)); /* the last one is two */
    for (size_t i = 0; i < n; i++)
        *planes[i] = s->dense + i * s->pixels;
    return RX_OK;
}

static rx_status new_steps(const rx_step *s, stage *stage, rx_error *err)
{
    for (int i = 0; i < s->steps && stage->runner != NULL; i++) {
        RX_TRY(rx_rl_step_new(s->fft, &s->kernel, &stage->rl[i], err));
        stage->sharp[i] = rx_fft_real(s->fft);
        if (stage->sharp[i] == NULL)
            return rx_error_memory(err, s->pixels * sizeof(float));
    }
    return RX_OK;
}

static rx_status new_optics(rx_step *s, rx_error *err)
{
    const int largest = s->side % 2 == 1 ? s->side : s->side - 1;
    RX_TRY(rx_fft_new(s->side, s->side, 1, &s->fft, err));
    s->steps = s->model->front.rl_steps;
    RX_TRY(new_steps(s, &s->first, err));
    RX_TRY(new_steps(s, &s->second, err));
    s->stamp_size = largest < RX_SAMPLE_KERNEL ? largest : RX_SAMPLE_KERNEL;
    RX_TRY(RX_MAKE(s->stamp, (size_t)s->stamp_size * (size_t)s->stamp_size, err));
    float **const real[] = {&s->data, &s->work, &s->inside, &s->before, &s->other},
                  **const complex[] = {&s->kernel.spectrum, &s->tikhonov, &s->half};
    int bad = 0;
    for (int i = 0; i < 5; i++)
        bad |= (*real[i] = rx_fft_real(s->fft)) == NULL;
    for (int i = 0; i < 3; i++)
        bad |= (*complex[i] = rx_fft_complex(s->fft)) == NULL;
    return bad ? rx_error_memory(err, s->pixels * 11 * sizeof(float)) : RX_OK;
}

static rx_status check(const rx_model *model, const rx_step_params *par, int side, int uses_psf,
                       rx_error *err)
{
    if (par->margin < 0 || side - 2 * par->margin < 1)
        return rx_error_set(err, RX_USAGE,
                            "a margin of %d pixels leaves nothing of images of %d pixels; give a smaller one",
                            par->margin, side);
    if (side < 4)
        return rx_error_set(err, RX_USAGE, "training images of %d pixels; give 4 or more", side);
    if (uses_psf && model->psf == NULL)
        return rx_error_set(err, RX_USAGE,
                            "this loss needs the PSF network, which the model does not have; set "
                            "LOSS_IDT_PSF, LOSS_REC and LOSS_REC_PSF to 0");
    if (model->front.rl_steps < 0 || model->front.rl_steps > RX_FRONT_STEPS)
        return rx_error_set(err, RX_USAGE, "training through %d Richardson-Lucy steps; give 0 to %d",
                            model->front.rl_steps, (int)RX_FRONT_STEPS);
    return RX_OK;
}

static rx_status new_parts(rx_step *s, int uses_psf, rx_error *err)
{
    const rx_model *model = s->model;
    RX_TRY(new_dense(s, err));
    RX_TRY(rx_runner_new(model->restore, s->side, s->side, &s->first.runner, err));
    if (model->second != NULL)
        RX_TRY(rx_runner_new(model->second, s->side, s->side, &s->second.runner, err));
    if (uses_psf)
        RX_TRY(rx_runner_new(model->psf, s->side, s->side, &s->psf, err));
    if (model->front.mode == RX_MODE_INFORMED)
        RX_TRY(new_optics(s, err));
    return s->par.ffl > 0 ? rx_ffl_new(s->side, s->par.margin, &s->ffl, err) : RX_OK;
}

rx_status rx_step_new(const rx_model *model, const rx_step_params *par, int side, rx_step **dst,
                      rx_error *err)
{
    rx_net *nets[RX_MODEL_NETS];
    rx_step *s;
    const int from_sharp = par->idt_psf > 0 || par->rec_restore > 0,
              uses_psf = from_sharp || par->rec_psf > 0;
    *dst = NULL;
    RX_TRY(check(model, par, side, uses_psf, err));
    RX_TRY(RX_MAKE(s, 1, err));
    s->model = model;
    s->par = *par;
    s->side = side;
    s->pixels = (size_t)side * (size_t)side;
    s->from_blurred = par->idt_restore > 0 || par->light > 0 || par->ffl > 0 || par->rec_psf > 0;
    s->from_sharp = from_sharp;
    rx_model_nets(model, nets);
    for (int k = 1; k < RX_MODEL_NETS; k++)
        s->at[k] = s->at[k - 1] + (nets[k - 1] != NULL ? nets[k - 1]->nparams : 0);
    const rx_status status = new_parts(s, uses_psf, err);
    if (status == RX_OK)
        *dst = s;
    else
        rx_step_free(s);
    return status;
}

void rx_step_free(rx_step *s)
{
    if (s == NULL)
        return;
    for (stage *stage = &s->first; stage != NULL; stage = stage == &s->first ? &s->second : NULL) {
        rx_runner_free(stage->runner);
        for (int i = 0; i < RX_FRONT_STEPS; i++) {
            rx_rl_step_free(stage->rl[i]);
            free(stage->sharp[i]);
        }
    }
    rx_runner_free(s->psf);
    rx_ffl_free(s->ffl);
    rx_fft_free(s->fft);
    float *const owned[] = {s->dense, s->stamp, s->kernel.spectrum, s->tikhonov, s->half,
                            s->data,  s->work,  s->inside,          s->before,   s->other};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++)
        free(owned[i]);
    free(s);
}

void rx_step_load(rx_step *s)
{
    rx_runner_load(s->first.runner, s->model->restore->params);
    if (s->second.runner != NULL)
        rx_runner_load(s->second.runner, s->model->second->params);
    if (s->psf != NULL)
        rx_runner_load(s->psf, s->model->psf->params);
}

const float *rx_step_restored(const rx_step *s)
{
    return s->from_blurred ? s->restored : NULL;
}

/* ---- planes ---- */

static void to_plane(const rx_step *s, const float *dense, float *plane)
{
    const size_t n = (size_t)s->side, stride = (size_t)rx_fft_stride_real(s->fft);
    for (size_t y = 0; y < n; y++)
        memcpy(plane + y * stride, dense + y * n, n * sizeof *dense);
}

static void from_plane(const rx_step *s, const float *plane, float *dense)
{
    const size_t n = (size_t)s->side, stride = (size_t)rx_fft_stride_real(s->fft);
    for (size_t y = 0; y < n; y++)
        memcpy(dense + y * n, plane + y * stride, n * sizeof *dense);
}

static void cut_stamp(rx_step *s, const float *kernel)
{
    const int n = s->stamp_size, skip = (RX_SAMPLE_KERNEL - n) / 2;
    double sum = 0;
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
            const float value = kernel[(size_t)(j + skip) * RX_SAMPLE_KERNEL + (size_t)(i + skip)];
            s->stamp[(size_t)j * (size_t)n + (size_t)i] = value;
            sum += value;
        }
    for (size_t k = 0; skip > 0 && k < (size_t)n * (size_t)n; k++)
        s->stamp[k] = (float)(s->stamp[k] / sum);
}

/* Which pixels of the sample the Richardson-Lucy steps may use: those whose light comes from inside the patch, as nothing
 * there can explain the wings of a bright star beyond its border. Light from beyond the patch, and what the cyclic domain
 * brings round, is a difference between the blurred field and the blurred patch; an error of the PSF that is given makes a
 * small one as well. */
static void find_inside(rx_step *s, const rx_sample *sample)
{
    const float faint = 0.5f, share = 0.25f; /* noise sigmas; of the pixel's light */
    const size_t n = (size_t)s->side, stride = (size_t)rx_fft_stride_real(s->fft);
    to_plane(s, sample->y, s->work);
    rx_convolve(s->fft, s->kernel.spectrum, s->work, s->half, s->work);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            const float light = sample->blurred[y * n + x], own = s->work[y * stride + x];
            s->inside[y * stride + x] = fabsf(light - own) <= faint + share * fabsf(light) ? 1 : 0;
        }
}

/* The PSF of the sample: width, K' (cut to the patch and of sum 1 where it is larger), and, where RESTORE(PSF(y)) is wanted,
 * the Tikhonov filter, O = K' * (target PSF). */
static rx_status set_optics(rx_step *s, const rx_sample *sample, rx_error *err)
{
    const rx_front *front = &s->model->front;
    s->fwhm = rx_front_fwhm(sample->fwhm);
    if (front->mode != RX_MODE_INFORMED)
        return RX_OK;
    cut_stamp(s, sample->kernel);
    rx_rl_kernel_set(s->fft, s->stamp, s->stamp_size, &s->kernel);
    if (s->steps > 0)
        find_inside(s, sample);
    if (!(s->par.rec_restore > 0))
        return RX_OK;
    return rx_deblur_tikhonov(s->fft, s->stamp, s->stamp_size,
                              &(rx_tikhonov){front->target_fwhm, front->tikhonov, 1}, s->tikhonov, err);
}

/* ---- RESTORE ---- */

static void fill_first(rx_step *s)
{
    float *input = rx_runner_input(s->first.runner);
    if (s->model->front.mode == RX_MODE_BLIND) {
        for (size_t k = 0; k < s->pixels; k++)
            input[k] = rx_stretch(s->x[k]);
        return;
    }
    for (size_t k = 0; k < s->pixels; k++) {
        input[3 * k] = rx_stretch(s->x[k]);
        input[3 * k + 1] = rx_stretch(s->w[k]);
        input[3 * k + 2] = s->fwhm;
    }
}

/* Beside what the first stage was given: what it made, and what of x that leaves. */
static void fill_second(rx_step *s)
{
    const size_t n = (size_t)s->side, stride = (size_t)rx_fft_stride_real(s->fft);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++)
            s->work[y * stride + x] = rx_rl_light(s->made[y * n + x]);
    rx_convolve(s->fft, s->kernel.spectrum, s->work, s->half, s->work);
    from_plane(s, s->work, s->left);
    float *input = rx_runner_input(s->second.runner);
    for (size_t k = 0; k < s->pixels; k++) {
        s->left[k] = s->x[k] - s->left[k];
        input[5 * k] = rx_stretch(s->x[k]);
        input[5 * k + 1] = rx_stretch(s->w[k]);
        input[5 * k + 2] = s->fwhm;
        input[5 * k + 3] = rx_stretch(s->made[k]);
        input[5 * k + 4] = rx_stretch(s->left[k]);
    }
}

/* out = the steps after base + network */
static void run_stage(rx_step *s, stage *stage, const float *base, float *out)
{
    rx_runner_forward(stage->runner);
    const float *net = rx_runner_output(stage->runner);
    for (size_t k = 0; k < s->pixels; k++) {
        stage->sum[k] = rx_stretch(base[k]) + net[k];
        out[k] = rx_unstretch(stage->sum[k]);
    }
    if (s->steps == 0)
        return;
    to_plane(s, out, stage->sharp[0]);
    for (int i = 0; i < s->steps; i++)
        rx_rl_step_forward(stage->rl[i], stage->sharp[i], s->data, s->used, s->model->front.pedestal,
                           i + 1 < s->steps ? stage->sharp[i + 1] : s->work);
    from_plane(s, s->work, out);
}

/* out = RESTORE(x). w: Tikhonov copy of x (not used by BLIND networks), which was cut from a larger field, as x was; NULL: x
 * is complete in itself, w is made here, on the patch's cyclic domain. x, w must stay until the gradient. */
static void restore(rx_step *s, const float *x, const float *w, float *out)
{
    const int informed = s->model->front.mode == RX_MODE_INFORMED, two = s->second.runner != NULL;
    s->x = x;
    s->w = w;
    s->own_w = w == NULL && informed;
    s->used = w != NULL ? s->inside : NULL;
    if (s->own_w) {
        to_plane(s, x, s->work);
        rx_convolve(s->fft, s->tikhonov, s->work, s->half, s->work);
        from_plane(s, s->work, s->filtered);
        s->w = s->filtered;
    }
    if (informed)
        to_plane(s, x, s->data);
    fill_first(s);
    run_stage(s, &s->first, informed ? s->w : s->x, two ? s->made : out);
    if (!two)
        return;
    fill_second(s);
    run_stage(s, &s->second, s->made, out);
}

/* slope = gradient by v; *dx += gradient by the data of the steps, NULL: not wanted. */
static void back_through_steps(rx_step *s, stage *stage, const float *dout, float *dx)
{
    if (s->steps == 0) {
        memcpy(s->slope, dout, s->pixels * sizeof *dout);
        return;
    }
    to_plane(s, dout, s->work);
    for (int i = s->steps - 1; i >= 0; i--) {
        rx_rl_step_backward(stage->rl[i], s->work, s->before, dx != NULL ? s->other : NULL);
        if (dx != NULL) {
            from_plane(s, s->other, s->slope);
            rx_layer_add(s->slope, dx, s->pixels);
        }
        float *done = s->work;
        s->work = s->before;
        s->before = done;
    }
    from_plane(s, s->work, s->slope);
}

/* Through steps and network: slope = gradient by the base's stretch. */
static void back_through_stage(rx_step *s, stage *stage, const float *dout, float *gradient, int want_input,
                               float *dx)
{
    back_through_steps(s, stage, dout, dx);
    float *dnet = rx_runner_output_gradient(stage->runner);
    for (size_t k = 0; k < s->pixels; k++) {
        s->slope[k] *= rx_unstretch_slope(stage->sum[k]);
        dnet[k] = s->slope[k];
    }
    rx_runner_backward(stage->runner, gradient, want_input);
}

/* by_made = gradient by f, which the second stage had as its base, as a plane, and in what is left of x; by_w. */
static void collect_second(rx_step *s, float *dx)
{
    const float *input = rx_runner_input_gradient(s->second.runner);
    const size_t n = (size_t)s->side, stride = (size_t)rx_fft_stride_real(s->fft);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            const size_t k = y * n + x;
            const float left = input[5 * k + 4] * rx_stretch_slope(s->left[k]);
            s->other[y * stride + x] = left;
            s->by_made[k] = (s->slope[k] + input[5 * k + 3]) * rx_stretch_slope(s->made[k]);
            s->by_w[k] = input[5 * k + 1];
            if (dx != NULL)
                dx[k] += input[5 * k] * rx_stretch_slope(s->x[k]) + left;
        }
    rx_correlate(s->fft, s->kernel.spectrum, s->other, s->half, s->other);
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++)
            if (s->made[y * n + x] > 0)
                s->by_made[y * n + x] -= s->other[y * stride + x];
}

/* dx += the gradients by the first network's input planes and by its base (in slope). */
static void collect_first(rx_step *s, float *dx)
{
    const float *input = rx_runner_input_gradient(s->first.runner);
    const int two = s->second.runner != NULL;
    if (s->model->front.mode == RX_MODE_BLIND) {
        for (size_t k = 0; k < s->pixels; k++)
            dx[k] += (input[k] + s->slope[k]) * rx_stretch_slope(s->x[k]);
        return;
    }
    for (size_t k = 0; k < s->pixels; k++) {
        const float by_w = input[3 * k + 1] + s->slope[k] + (two ? s->by_w[k] : 0);
        s->slope[k] = by_w * rx_stretch_slope(s->w[k]);
        dx[k] += input[3 * k] * rx_stretch_slope(s->x[k]);
    }
    if (s->own_w) {
        to_plane(s, s->slope, s->work);
        rx_correlate(s->fft, s->tikhonov, s->work, s->half, s->work);
        from_plane(s, s->work, s->slope);
        rx_layer_add(s->slope, dx, s->pixels);
    }
}

/* gradient +=, of the networks that restore, from dout; dx (NULL: not wanted) = gradient by x, through the Tikhonov copy too
 * when that was made here. */
static void restore_back(rx_step *s, const float *dout, float *gradient, float *dx)
{
    if (dx != NULL)
        memset(dx, 0, s->pixels * sizeof *dx);
    if (s->second.runner != NULL) {
        back_through_stage(s, &s->second, dout, gradient + s->at[RX_NET_SECOND], 1, dx);
        collect_second(s, dx);
        dout = s->by_made;
    }
    back_through_stage(s, &s->first, dout, gradient + s->at[RX_NET_RESTORE], dx != NULL, dx);
    if (dx != NULL)
        collect_first(s, dx);
}

/* ---- PSF ---- */

/* blurred = PSF(y); y must stay until the gradient. */
static void blur(rx_step *s, const float *y)
{
    s->y = y;
    float *input = rx_runner_input(s->psf);
    for (size_t k = 0; k < s->pixels; k++) {
        input[RX_PSF_CHANNELS * k] = rx_stretch(y[k]);
        input[RX_PSF_CHANNELS * k + 1] = s->fwhm;
    }
    rx_runner_forward(s->psf);
    const float *net = rx_runner_output(s->psf);
    for (size_t k = 0; k < s->pixels; k++) {
        s->psf_sum[k] = rx_stretch(y[k]) + net[k];
        s->blurred[k] = rx_unstretch(s->psf_sum[k]);
    }
}

static void blur_back(rx_step *s, const float *dout, float *gradient, float *dy)
{
    float *dnet = rx_runner_output_gradient(s->psf);
    for (size_t k = 0; k < s->pixels; k++) {
        s->slope[k] = dout[k] * rx_unstretch_slope(s->psf_sum[k]);
        dnet[k] = s->slope[k];
    }
    rx_runner_backward(s->psf, gradient + s->at[RX_NET_PSF], dy != NULL);
    if (dy == NULL)
        return;
    const float *input = rx_runner_input_gradient(s->psf);
    for (size_t k = 0; k < s->pixels; k++)
        dy[k] = (input[RX_PSF_CHANNELS * k] + s->slope[k]) * rx_stretch_slope(s->y[k]);
}

/* ---- terms ---- */

/* d(out, truth) times `scale`: *term unweighted, *total weighted, gradient +=. */
static void add_pixels(const rx_step *s, double scale, const float *out, const float *truth, double *term,
                       double *total, float *gradient)
{
    double value = 0;
    rx_loss_pixels(&(rx_loss){s->par.kind, s->side, s->par.margin, s->weight}, out, truth, scale, &value,
                   gradient);
    *term = value / scale;
    *total += value;
}

static void set_weights(rx_step *s, const float *input)
{
    if (s->par.kind == RX_LOSS_LINEAR)
        rx_loss_weights(input, s->side, s->par.floor, s->scratch, s->weight);
}

static void clear(const rx_step *s, float *plane)
{
    memset(plane, 0, s->pixels * sizeof *plane);
}

/* RESTORE(x) against y, and PSF(RESTORE(x)) against x. */
static void run_blurred(rx_step *s, const rx_sample *sample, float *gradient, rx_step_values *values)
{
    const rx_step_params *par = &s->par;
    double value = 0;
    restore(s, sample->x, sample->w, s->restored);
    if (par->idt_restore > 0 || par->light > 0 || par->rec_psf > 0)
        set_weights(s, sample->x);
    clear(s, s->gradient);
    if (par->idt_restore > 0)
        add_pixels(s, par->idt_restore, s->restored, sample->y, &values->idt_restore, &values->total,
                   s->gradient);
    if (par->light > 0) {
        rx_loss_light(&(rx_loss){par->kind, s->side, par->margin, s->weight}, s->restored, sample->y,
                      par->light, s->scratch, &value, gradient != NULL ? s->gradient : NULL);
        values->light = value / par->light;
        values->total += value;
    }
    if (par->ffl > 0) {
        value = 0;
        rx_ffl_add(s->ffl, s->restored, sample->y, par->ffl, &value, gradient != NULL ? s->gradient : NULL);
        values->ffl = value / par->ffl;
        values->total += value;
    }
    if (par->rec_psf > 0) {
        blur(s, s->restored);
        clear(s, s->inner);
        add_pixels(s, par->rec_psf, s->blurred, sample->x, &values->rec_psf, &values->total, s->inner);
        if (gradient != NULL) {
            blur_back(s, s->inner, gradient, s->back);
            rx_layer_add(s->back, s->gradient, s->pixels);
        }
    }
    if (gradient != NULL)
        restore_back(s, s->gradient, gradient, NULL);
}

/* PSF(y) against x, and RESTORE(PSF(y)) against y. */
static void run_sharp(rx_step *s, const rx_sample *sample, float *gradient, rx_step_values *values)
{
    const rx_step_params *par = &s->par;
    blur(s, sample->y);
    set_weights(s, sample->y);
    clear(s, s->gradient);
    if (par->idt_psf > 0)
        add_pixels(s, par->idt_psf, s->blurred, sample->x, &values->idt_psf, &values->total, s->gradient);
    if (par->rec_restore > 0) {
        restore(s, s->blurred, NULL, s->again);
        clear(s, s->inner);
        add_pixels(s, par->rec_restore, s->again, sample->y, &values->rec_restore, &values->total, s->inner);
        if (gradient != NULL) {
            restore_back(s, s->inner, gradient, s->back);
            rx_layer_add(s->back, s->gradient, s->pixels);
        }
    }
    if (gradient != NULL)
        blur_back(s, s->gradient, gradient, NULL);
}

rx_status rx_step_run(rx_step *s, const rx_sample *sample, float *gradient, rx_step_values *values,
                      rx_error *err)
{
    *values = (rx_step_values){0};
    if (sample->side != s->side)
        return rx_error_set(err, RX_INPUT, "a training image of %d pixels instead of %d; make it anew",
                            sample->side, s->side);
    RX_TRY(set_optics(s, sample, err));
    if (s->from_blurred)
        run_blurred(s, sample, gradient, values);
    if (s->from_sharp)
        run_sharp(s, sample, gradient, values);
    return RX_OK;
}
