/* train/step: the joint loss by its own definition, its gradient through both networks by finite differences.
 */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "../small_net.h"
#include "base/memory.h"
#include "base/random.h"
#include "nn/deblur.h"
#include "num/convolve.h"
#include "train/step.h"

enum { SIDE = 32, MARGIN = 4, INNER = SIDE - 2 * MARGIN, PIXELS = SIDE * SIDE };
static const double PI = 3.14159265358979323846;

/* ---- a small model and a small sky ---- */

static rx_model *small_model(rx_mode mode, int rl_steps)
{
    rx_model *model = rx_model_new();
    assert_non_null(model);
    model->front.mode = mode;
    model->front.rl_steps = rl_steps;
    model->restore = small_net(rx_front_channels(mode), 1);
    model->psf = small_net(RX_PSF_CHANNELS, 1);
    rx_net_initialise(model->restore, 1, 1, 0.5, 0.1);
    rx_net_initialise(model->psf, 1, 2, 0.5, 0.1);
    return model;
}

/* Gaussian of that FWHM, sum 1, off centre: a filter is not its own adjoint */
static void gauss_stamp(double fwhm, int size, float *stamp)
{
    double sum = 0;
    const double s = fwhm / 2.3548200450309493;
    for (int k = 0; k < size * size; k++) {
        const double x = k % size - size / 2 - 0.7, y = k / size - size / 2 + 0.4;
        sum += stamp[k] = (float)exp(-(x * x + y * y) / (2 * s * s));
    }
    for (int k = 0; k < size * size; k++)
        stamp[k] = (float)(stamp[k] / sum);
}

/* Three stars through a Gaussian: dst += */
static void stars(double fwhm, float *dst)
{
    static const double star[3][3] = {{9.3, 12.1, 900}, {20.6, 17.4, 250}, {16.2, 24.8, 2500}};
    const double s = fwhm / 2.3548200450309493;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < PIXELS; k++) {
            const double x = k % SIDE - star[i][0], y = k / SIDE - star[i][1];
            dst[k] += (float)(star[i][2] / (2 * PI * s * s) * exp(-(x * x + y * y) / (2 * s * s)));
        }
}

static rx_sample *small_sample(void)
{
    rx_sample *sample = NULL;
    assert_int_equal(rx_sample_new(SIDE, &sample, NULL), RX_OK);
    float psf[RX_SAMPLE_KERNEL * RX_SAMPLE_KERNEL];
    sample->fwhm = sample->true_fwhm = 3.5f;
    gauss_stamp(3.5, RX_SAMPLE_KERNEL, psf);
    assert_int_equal(rx_deblur_relative(psf, RX_SAMPLE_KERNEL, 2, RX_SAMPLE_KERNEL, 1, sample->kernel, NULL),
                     RX_OK);
    memset(sample->y, 0, PIXELS * sizeof(float));
    memset(sample->x, 0, PIXELS * sizeof(float));
    memset(sample->w, 0, PIXELS * sizeof(float));
    stars(2, sample->y);
    memset(sample->blurred, 0, PIXELS * sizeof(float));
    stars(3.5, sample->x);
    stars(3.5,
          sample->blurred); /* not where the kernel puts them: some pixels are as if lit from elsewhere */
    stars(2.4, sample->w);
    for (int k = 0; k < PIXELS; k++) {
        sample->x[k] += (float)rx_random_normal(5, 1, (uint64_t)k);
        sample->w[k] += (float)rx_random_normal(5, 2, (uint64_t)k);
    }
    return sample;
}

static const rx_step_params all_terms = {.kind = RX_LOSS_LINEAR,
                                         .idt_restore = 1,
                                         .idt_psf = 0.5,
                                         .rec_restore = 0.7,
                                         .rec_psf = 0.3,
                                         .light = 0.6,
                                         .ffl = 0.4,
                                         .floor = 10,
                                         .margin = MARGIN};

/* ---- finite differences ---- */

typedef struct rx_bench {
    rx_model *model;
    rx_sample *sample;
    rx_step *step;
    float *gradient; /* of all networks, one after the other */
} rx_bench;

static void bench_new(rx_bench *b, rx_mode mode, int rl_steps, int stages, const rx_step_params *par)
{
    rx_step_values values;
    b->model = small_model(mode, rl_steps);
    if (stages == 2) {
        b->model->second = small_net(RX_SECOND_CHANNELS, 1);
        rx_net_initialise(b->model->second, 1, 3, 0.5, 0.1);
    }
    b->sample = small_sample();
    b->gradient = RX_NEW(float, rx_model_params(b->model));
    assert_int_equal(rx_step_new(b->model, par, SIDE, &b->step, NULL), RX_OK);
    assert_int_equal(rx_step_run(b->step, b->sample, b->gradient, &values, NULL), RX_OK);
}

static void bench_free(rx_bench *b)
{
    rx_step_free(b->step);
    free(b->sample);
    rx_model_free(b->model);
    free(b->gradient);
}

static double loss(rx_bench *b)
{
    rx_step_values values;
    rx_step_load(b->step);
    assert_int_equal(rx_step_run(b->step, b->sample, NULL, &values, NULL), RX_OK);
    return values.total;
}

/* Loss with `params` moved by `by` along direction[n]. */
static double moved(rx_bench *b, rx_net *net, const double *direction, double by)
{
    float *kept = RX_NEW(float, net->nparams);
    memcpy(kept, net->params, (size_t)net->nparams * sizeof(float));
    for (long i = 0; i < net->nparams; i++)
        net->params[i] = (float)(kept[i] + by * direction[i]);
    const double value = loss(b);
    memcpy(net->params, kept, (size_t)net->nparams * sizeof(float));
    free(kept);
    return value;
}

/* d/dt L(params + t direction): central differences at h and 2h, extrapolated to h = 0. */
static double slope(rx_bench *b, rx_net *net, const double *direction, double h)
{
    const double one = (moved(b, net, direction, h) - moved(b, net, direction, -h)) / (2 * h);
    const double two = (moved(b, net, direction, 2 * h) - moved(b, net, direction, -2 * h)) / (4 * h);
    return (4 * one - two) / 3;
}

static void hold(const char *what, int which, double expected, double found, double scale, double share)
{
    if (!(fabs(expected - found) <= share * scale))
        fail_msg("%s %d: gradient %.9g, finite differences %.9g (scale %.3g)", what, which, found, expected,
                 scale);
}

/* Along the gradient with something random, then for the parameters of each node that matter most. Tolerances
 * are shares of the gradient's norm: a cut at 0 that flips inside of the step is an error that every finite
 * difference has. */
static void check_directions(rx_bench *b, rx_net *net, const float *gradient, double norm, const char *what)
{
    double *direction = RX_NEW(double, net->nparams);
    for (int trial = 0; trial < 3; trial++) {
        double dot = 0;
        for (long i = 0; i < net->nparams; i++) {
            direction[i] = gradient[i] / norm * (trial - 1) +
                           rx_random_normal(7, (uint64_t)trial, (uint64_t)i) / sqrt((double)net->nparams);
            dot += direction[i] * gradient[i];
        }
        hold(what, trial, slope(b, net, direction, 5e-4), dot, norm, 0.005);
    }
    free(direction);
}

static long largest(const float *gradient, long first, long n)
{
    long most = first;
    for (long i = first; i < first + n; i++)
        if (fabsf(gradient[i]) > fabsf(gradient[most]))
            most = i;
    return most;
}

static void check_net(rx_bench *b, rx_net *net, const float *gradient, const char *what)
{
    double *direction = RX_NEW(double, net->nparams), norm = 0;
    for (long i = 0; i < net->nparams; i++)
        norm += (double)gradient[i] * gradient[i];
    norm = sqrt(norm);
    assert_true(isfinite(norm));
    assert_true(norm > 0);
    check_directions(b, net, gradient, norm, what);
    for (int i = 0; i < net->nnodes; i++) {
        const rx_node *node = &net->node[i];
        if (node->weight < 0)
            continue;
        const long one[2] = {largest(gradient, node->weight, node->nweights),
                             largest(gradient, node->bias, node->channels)};
        for (int k = 0; k < 2; k++) {
            memset(direction, 0, (size_t)net->nparams * sizeof *direction);
            direction[one[k]] = 1;
            hold(what, (int)one[k], slope(b, net, direction, 1e-3), gradient[one[k]],
                 norm + 20 * fabs((double)gradient[one[k]]), 5e-4);
        }
    }
    free(direction);
}

/* Without the frequencies, whose gradient is not that of their value (test_loss.c). */
static void check_gradient(rx_mode mode, int rl_steps, int stages, rx_step_params par)
{
    rx_bench b;
    par.ffl = 0;
    bench_new(&b, mode, rl_steps, stages, &par);
    check_net(&b, b.model->restore, b.gradient, "RESTORE");
    check_net(&b, b.model->psf, b.gradient + b.model->restore->nparams, "PSF");
    if (stages == 2)
        check_net(&b, b.model->second, b.gradient + b.model->restore->nparams + b.model->psf->nparams,
                  "SECOND");
    bench_free(&b);
}

/* A chain of steps: each one's gradient through those after it. */
static void gradients(void **state)
{
    check_gradient(RX_MODE_BLIND, 0, 1, all_terms);
    check_gradient(RX_MODE_INFORMED, 0, 1, all_terms);
    check_gradient(RX_MODE_INFORMED, 1, 1, all_terms);
    check_gradient(RX_MODE_INFORMED, 3, 1, all_terms);
}

/* The first stage's through the second, where it is base, plane of its own, and taken from the data. */
static void gradients_of_two_stages(void **state)
{
    check_gradient(RX_MODE_INFORMED, 0, 2, all_terms);
    check_gradient(RX_MODE_INFORMED, 1, 2, all_terms);
}

static void gradients_of_other_losses(void **state)
{
    (void)state;
    rx_step_params par = all_terms;
    par.kind = RX_LOSS_PLAIN;
    check_gradient(RX_MODE_INFORMED, 1, 1, par);
    par.kind = RX_LOSS_STRETCHED;
    check_gradient(RX_MODE_INFORMED, 1, 1, par);
}

/* ---- values ---- */

static double squares(const float *a, const float *b, const float *weight)
{
    double sum = 0;
    for (int y = MARGIN; y < SIDE - MARGIN; y++)
        for (int x = MARGIN; x < SIDE - MARGIN; x++) {
            const double d = (double)a[y * SIDE + x] - b[y * SIDE + x];
            sum += (weight != NULL ? weight[y * SIDE + x] : 1) * d * d;
        }
    return sum / (INNER * INNER);
}

/* dst = Tikhonov(y) on the patch, K' cut to it as the step does */
static void filter(const rx_sample *sample, const float *y, float *dst)
{
    enum { CUT = SIDE - 1, SKIP = (RX_SAMPLE_KERNEL - CUT) / 2 };
    float kernel[CUT * CUT];
    double sum = 0;
    rx_fft *fft = NULL;
    assert_int_equal(rx_fft_new(SIDE, SIDE, 1, &fft, NULL), RX_OK);
    float *plane = rx_fft_real(fft), *spectrum = rx_fft_complex(fft), *half = rx_fft_complex(fft);
    for (int k = 0; k < CUT * CUT; k++)
        sum += kernel[k] = sample->kernel[(k / CUT + SKIP) * RX_SAMPLE_KERNEL + k % CUT + SKIP];
    for (int k = 0; k < CUT * CUT; k++)
        kernel[k] = (float)(kernel[k] / sum);
    assert_int_equal(rx_deblur_tikhonov(fft, kernel, CUT, &(rx_tikhonov){2, 0.02, 1}, spectrum, NULL), RX_OK);
    assert_int_equal(rx_fft_stride_real(fft), SIDE);
    memcpy(plane, y, PIXELS * sizeof *y);
    rx_convolve(fft, spectrum, plane, half, plane);
    memcpy(dst, plane, PIXELS * sizeof *y);
    rx_fft_free(fft);
    free(plane);
    free(spectrum);
    free(half);
}

static void near(const char *what, double expected, double found)
{
    if (!(fabs(expected - found) <= 2e-5 * fabs(expected)))
        fail_msg("%s: %.9g instead of %.9g", what, found, expected);
}

/* Networks that say nothing: RESTORE is the Tikhonov copy, PSF changes nothing. */
static void values_of_silent_networks(void **state)
{
    rx_model *model = small_model(RX_MODE_INFORMED, 0);
    rx_sample *s = small_sample();
    rx_step *step = NULL;
    rx_step_values v;
    rx_ffl *ffl = NULL;
    double light = 0, frequencies = 0;
    static float weight_x[PIXELS], weight_y[PIXELS], work[2 * PIXELS], copy[PIXELS];
    memset(model->restore->params, 0, (size_t)model->restore->nparams * sizeof(float));
    memset(model->psf->params, 0, (size_t)model->psf->nparams * sizeof(float));
    assert_int_equal(rx_step_new(model, &all_terms, SIDE, &step, NULL), RX_OK);
    assert_int_equal(rx_step_run(step, s, NULL, &v, NULL), RX_OK);
    rx_loss_weights(s->x, SIDE, 10, work, weight_x);
    rx_loss_weights(s->y, SIDE, 10, work, weight_y);
    filter(s, s->y, copy);
    near("RESTORE(x), y", squares(s->w, s->y, weight_x), v.idt_restore);
    near("PSF(y), x", squares(s->y, s->x, weight_y), v.idt_psf);
    near("RESTORE(PSF(y)), y", squares(copy, s->y, weight_y), v.rec_restore);
    near("PSF(RESTORE(x)), x", squares(s->w, s->x, weight_x), v.rec_psf);
    rx_loss_light(&(rx_loss){RX_LOSS_LINEAR, SIDE, MARGIN, weight_x}, s->w, s->y, 1, work, &light, NULL);
    near("light", light, v.light);
    assert_int_equal(rx_ffl_new(SIDE, MARGIN, &ffl, NULL), RX_OK);
    rx_ffl_add(ffl, s->w, s->y, 1, &frequencies, NULL);
    near("frequencies", frequencies, v.ffl);
    rx_ffl_free(ffl);
    near("total",
         v.idt_restore + 0.5 * v.idt_psf + 0.7 * v.rec_restore + 0.3 * v.rec_psf + 0.6 * v.light +
             0.4 * v.ffl,
         v.total);
    rx_step_free(step);
    free(s);
    rx_model_free(model);
}

/* dst = K' * y on the cyclic domain */
static void blur(const rx_sample *s, const float *y, float *dst)
{
    const int n = RX_SAMPLE_KERNEL;
    for (int p = 0; p < PIXELS; p++) {
        double sum = 0;
        for (int k = 0; k < n * n; k++) {
            const int x = p % SIDE - (k % n - n / 2), v = p / SIDE - (k / n - n / 2);
            sum += (double)s->kernel[k] * y[(v + 4 * SIDE) % SIDE * SIDE + (x + 4 * SIDE) % SIDE];
        }
        dst[p] = (float)sum;
    }
}

/* A faint star beside a bright one beyond the border: the steps do not feed one from the other. */
static void light_from_beyond_is_no_data(void **state)
{
    enum { WING = 16 * SIDE + 7 }; /* of the faint star, towards the bright one */
    rx_model *model = small_model(RX_MODE_INFORMED, 2);
    rx_sample *s = small_sample();
    rx_step *step = NULL;
    rx_step_values v;
    static float own[PIXELS];
    float restored[2];
    memset(model->restore->params, 0, (size_t)model->restore->nparams * sizeof(float));
    for (int p = 0; p < PIXELS; p++) {
        const int dx = p % SIDE - 9, dy = p / SIDE - 16, beyond = p % SIDE + 2;
        s->y[p] = s->w[p] = (float)(30 * exp(-(dx * dx + dy * dy) / 1.5));
        s->x[p] = (float)(2500 * exp(-(beyond * beyond + dy * dy) / 13.0));
    }
    blur(s, s->y, own);
    for (int p = 0; p < PIXELS; p++)
        s->x[p] += own[p];
    rx_step_params par = all_terms;
    par.idt_psf = par.rec_restore = par.rec_psf = 0;
    assert_int_equal(rx_step_new(model, &par, SIDE, &step, NULL), RX_OK);
    const float *blurred[] = {s->x, own}; /* what it is, and as if all light were the patch's own */
    for (int i = 0; i < 2; i++) {
        memcpy(s->blurred, blurred[i], PIXELS * sizeof(float));
        assert_int_equal(rx_step_run(step, s, NULL, &v, NULL), RX_OK);
        restored[i] = rx_step_restored(step)[WING];
    }
    assert_true(fabsf(restored[0] / s->y[WING] - 1) < 0.3f);
    assert_true(restored[1] > 10 * s->y[WING]);
    rx_step_free(step);
    free(s);
    rx_model_free(model);
}

/* The same bytes after another sample; gradients are added; values do not depend on whether they are wanted. */
static void runs_repeat(void **state)
{
    rx_bench b;
    rx_step_values one, two;
    bench_new(&b, RX_MODE_INFORMED, 1, 1, &all_terms);
    const long n = rx_model_params(b.model);
    float *again = RX_NEW(float, n);
    rx_sample *turned = small_sample();
    assert_int_equal(rx_sample_turn(turned, 3, NULL), RX_OK);
    turned->fwhm = 5;
    assert_int_equal(rx_step_run(b.step, b.sample, NULL, &one, NULL), RX_OK);
    assert_int_equal(rx_step_run(b.step, turned, NULL, &two, NULL), RX_OK);
    assert_true(two.total != one.total);
    assert_int_equal(rx_step_run(b.step, b.sample, again, &two, NULL), RX_OK);
    assert_memory_equal(&one, &two, sizeof one);
    assert_memory_equal(again, b.gradient, (size_t)n * sizeof(float));
    assert_int_equal(rx_step_run(b.step, b.sample, again, &two, NULL), RX_OK);
    for (long i = 0; i < n; i++)
        assert_true(fabsf(again[i] - 2 * b.gradient[i]) <= 1e-4f * fabsf(again[i]) + 1e-4f);
    free(again);
    free(turned);
    bench_free(&b);
}

/* What has no weight is neither computed nor needed: no PSF network, or no RESTORE(x). */
static void terms_without_weight(void **state)
{
    rx_model *model = small_model(RX_MODE_INFORMED, 1);
    rx_sample *sample = small_sample();
    rx_step *step = NULL;
    rx_step_values v;
    rx_error err = RX_ERROR_NONE;
    rx_step_params par = {.kind = RX_LOSS_LINEAR, .idt_psf = 0.5, .floor = 10, .margin = MARGIN};
    assert_int_equal(rx_step_new(model, &par, SIDE, &step, NULL), RX_OK);
    assert_int_equal(rx_step_run(step, sample, NULL, &v, NULL), RX_OK);
    assert_true(v.idt_psf > 0);
    assert_true(v.total == 0.5 * v.idt_psf);
    assert_null(rx_step_restored(step));
    rx_step_free(step);
    rx_net_free(model->psf);
    model->psf = NULL;
    assert_int_equal(rx_step_new(model, &par, SIDE, &step, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "PSF network"));
    assert_null(step);
    par.idt_psf = 0;
    par.idt_restore = 1;
    assert_int_equal(rx_step_new(model, &par, SIDE, &step, &err), RX_OK);
    assert_int_equal(rx_step_run(step, sample, NULL, &v, &err), RX_OK);
    assert_true(v.idt_restore > 0);
    assert_true(v.total == v.idt_restore);
    rx_step_free(step);
    free(sample);
    rx_model_free(model);
}

static void what_cannot_be_is_said(void **state)
{
    rx_model *model = small_model(RX_MODE_INFORMED, 1);
    rx_sample *sample = small_sample();
    rx_step_params par = all_terms;
    rx_step_values v;
    rx_step *step = NULL;
    rx_error err = RX_ERROR_NONE;
    par.margin = SIDE / 2;
    assert_int_equal(rx_step_new(model, &par, SIDE, &step, &err), RX_USAGE);
    model->front.rl_steps = RX_FRONT_STEPS + 1;
    assert_int_equal(rx_step_new(model, &all_terms, SIDE, &step, &err), RX_USAGE);
    model->front.rl_steps = 1;
    assert_int_equal(rx_step_new(model, &all_terms, SIDE, &step, &err), RX_OK);
    sample->kernel[RX_SAMPLE_KERNEL * RX_SAMPLE_KERNEL / 2] = NAN;
    assert_int_equal(rx_step_run(step, sample, NULL, &v, &err), RX_INPUT);
    sample->side = SIDE + 4;
    assert_int_equal(rx_step_run(step, sample, NULL, &v, &err), RX_INPUT);
    sample->side = SIDE;
    rx_step_free(step);
    free(sample);
    rx_model_free(model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_of_silent_networks),
        cmocka_unit_test(light_from_beyond_is_no_data),
        cmocka_unit_test(runs_repeat),
        cmocka_unit_test(terms_without_weight),
        cmocka_unit_test(what_cannot_be_is_said),
        cmocka_unit_test(gradients),
        cmocka_unit_test(gradients_of_two_stages),
        cmocka_unit_test(gradients_of_other_losses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
