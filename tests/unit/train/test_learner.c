/* What a learner makes of samples: gradients that are clipped and added in their order, and the quick look at stars. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "../small_net.h"
#include "base/random.h"
#include "train/learner.h"

enum { SIDE = 64, MARGIN = 8, SAMPLES = 5 };

static rx_sample *new_sample(void)
{
    rx_sample *sample;
    assert_int_equal(rx_sample_new(SIDE, &sample, NULL), RX_OK);
    return sample;
}

/* Gaussian of FWHM 2 sampled at the pixels, sum flux. */
static void add_star(float *image, double x, double y, double flux)
{
    const double sigma = 2 / 2.3548200450309493;
    for (int v = 0; v < SIDE; v++)
        for (int u = 0; u < SIDE; u++) {
            const double r = ((u - x) * (u - x) + (v - y) * (v - y)) / (2 * sigma * sigma);
            image[v * SIDE + u] += (float)(flux / (2 * 3.141592653589793 * sigma * sigma) * exp(-r));
        }
}

static void list_star(rx_sample *sample, double x, double y, double flux, double snr)
{
    float *star = sample->star[sample->nstars++];
    star[0] = (float)x;
    star[1] = (float)y;
    star[2] = (float)flux;
    star[3] = (float)snr;
    add_star(sample->y, x, y, flux);
}

static void stars_are_found_and_measured(void **state)
{
    rx_star_check check;
    rx_sample *sample = new_sample();
    list_star(sample, 20.3, 20.7, 400, 50); /* 3 % too bright */
    list_star(sample, 44.0, 20.5, 300, 40); /* two pixels away: not the same star */
    list_star(sample, 20.0, 45.0, 100, 15); /* too near to the next one to be measured */
    list_star(sample, 24.0, 45.0, 90, 14);
    list_star(sample, 44.0, 44.0, 30, 6);  /* below the threshold */
    list_star(sample, 32.0, 32.0, 20, 4);  /* too faint to count */
    list_star(sample, 3.0, 30.0, 500, 60); /* in the margin */
    list_star(sample, 10.0, 32.0, 80, 13); /* found, but its circle touches the margin */
    float *restored = calloc(SIDE * SIDE, sizeof *restored);
    assert_non_null(restored);
    add_star(restored, 20.3, 20.7, 412);
    add_star(restored, 46.0, 20.5, 300);
    add_star(restored, 20.0, 45.0, 100);
    add_star(restored, 24.0, 45.0, 90);
    add_star(restored, 44.0, 44.0, 7);
    add_star(restored, 10.0, 32.0, 80);
    assert_int_equal(rx_star_check_run(sample, restored, MARGIN, 2, &check, NULL), RX_OK);
    assert_true(check.stars == 6);
    assert_true(check.found == 4);
    assert_true(check.ratios == 2); /* by S/N */
    assert_true(fabs(check.error[0] - 0.03) < 1e-4);
    assert_true(check.error[1] < -0.001);
    assert_true(check.error[1] > -0.1); /* a little lies outside */
    free(restored);
    free(sample);
}

/* One peak serves one star: the brighter one. */
static void a_blend_is_found_once(void **state)
{
    rx_star_check check;
    rx_sample *sample = new_sample();
    list_star(sample, 30.2, 30.0, 100, 20);
    list_star(sample, 31.0, 30.0, 200, 40);
    assert_int_equal(rx_star_check_run(sample, sample->y, MARGIN, 2, &check, NULL), RX_OK);
    assert_true(check.stars == 2);
    assert_true(check.found == 1);
    assert_true(check.ratios == 0);
    free(sample);
}

static int found_of(const rx_sample *sample, const float *restored)
{
    rx_star_check check;
    assert_int_equal(rx_star_check_run(sample, restored, MARGIN, 2, &check, NULL), RX_OK);
    return (int)check.found;
}

/* A peak of one pixel is found from as far as 1.5 pixels. */
static void peaks_are_found_within_their_radius(void **state)
{
    static const float fractions[] = {0, 0.4996f, 0.5f, 0.8f};
    static float restored[SIDE * SIDE];
    rx_sample *sample = new_sample();
    list_star(sample, 30, 30, 0, 10);
    for (int k = 0; k < 16; k++)
        for (int y = 27; y < 35; y++)
            for (int x = 27; x < 35; x++) {
                float *star = sample->star[0];
                star[0] = 30 + fractions[k % 4];
                star[1] = 30 + fractions[k / 4];
                restored[y * SIDE + x] = 10;
                assert_int_equal(found_of(sample, restored), hypot(x - star[0], y - star[1]) <= 1.5);
                restored[y * SIDE + x] = 0;
            }
    free(sample);
}

/* --- gradients --- */

static rx_sample *make_sample(uint32_t i)
{
    rx_sample *s = new_sample();
    s->fwhm = s->true_fwhm = 4;
    for (uint64_t k = 0; k < SIDE * SIDE; k++) {
        s->y[k] = (float)fmax(0, 10 * rx_random_normal(1, i, k));
        s->blurred[k] = s->y[k];
        s->x[k] = s->y[k] + (float)rx_random_normal(2, i, k);
        s->w[k] = s->x[k];
    }
    s->kernel[RX_SAMPLE_KERNEL * RX_SAMPLE_KERNEL / 2] = 1;
    return s;
}

/* Sums of gradients and terms over the samples, with that many threads; the caller's to free. */
static float *gradient_of(const rx_model *model, rx_sample *const *samples, int n, int nthreads, double clip,
                          rx_step_values *values)
{
    const rx_step_params par = {.kind = RX_LOSS_LINEAR,
                                .idt_restore = 1,
                                .idt_psf = 0.1,
                                .floor = 10,
                                .margin = MARGIN,
                                .clip = clip};
    float *gradient = calloc((size_t)rx_model_params(model), sizeof *gradient);
    rx_learner *learner = NULL;
    assert_int_equal(rx_learner_new(model, &par, SIDE, SAMPLES, nthreads, &learner, NULL), RX_OK);
    assert_int_equal(rx_learner_gradients(learner, samples, n, values, NULL), RX_OK);
    rx_learner_add(learner, n, gradient);
    rx_learner_free(learner);
    return gradient;
}

/* Each sample's gradient, over all networks, before the sum; their terms stay. The threads change no bit. */
static void samples_are_clipped(void **state)
{
    rx_sample *samples[SAMPLES];
    rx_step_values values[3][SAMPLES];
    rx_model *model = rx_model_new();
    double norm[SAMPLES], clip;
    float *alone[SAMPLES], *clipped[2];
    model->restore = small_net(3, 1);
    model->psf = small_net(RX_PSF_CHANNELS, 1);
    rx_net_initialise(model->restore, 1, 1, 0.3, 0.1);
    rx_net_initialise(model->psf, 1, 2, 0.3, 0.1);
    const long n = rx_model_params(model);
    for (uint32_t i = 0; i < SAMPLES; i++) {
        samples[i] = make_sample(i);
        alone[i] = gradient_of(model, samples + i, 1, 1, 0, &values[0][i]);
        norm[i] = rx_gradient_clip(alone[i], n, 0);
    }
    clip = sqrt(norm[0] * norm[1]); /* of these two one is too long, the other one is not */
    assert_true(clip < 0.99 * fmax(norm[0], norm[1]));
    for (int t = 0; t < 2; t++)
        clipped[t] = gradient_of(model, samples, SAMPLES, 1 + 2 * t, clip, values[1 + t]);
    assert_memory_equal(clipped[0], clipped[1], (size_t)n * sizeof(float));
    for (int t = 1; t < 3; t++)
        assert_memory_equal(values[0], values[t], sizeof values[0]);
    for (long p = 0; p < n; p++) {
        double sum = 0;
        for (int i = 0; i < SAMPLES; i++)
            sum += alone[i][p] * fmin(1, clip / norm[i]);
        assert_near(clipped[0][p], sum, 2e-6 * clip);
    }
    for (int i = 0; i < SAMPLES; i++) {
        free(alone[i]);
        free(samples[i]);
    }
    free(clipped[0]);
    free(clipped[1]);
    rx_model_free(model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stars_are_found_and_measured),
        cmocka_unit_test(a_blend_is_found_once),
        cmocka_unit_test(peaks_are_found_within_their_radius),
        cmocka_unit_test(samples_are_clipped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
