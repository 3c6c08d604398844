/* What is trained is what is run: a training image as a tile, restored by NET, against what the trainer's own
 * step makes of it, and its stars against what the trainer's test finds; in the middle, where the borders of
 * neither are seen. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "samples_test.h"
/* after cmocka.h, which it needs */
#include "../near.h"
#include "../restore/network_model.h"
#include "psf/psf.h"
#include "restore/restore.h"
#include "train/learner.h"

enum { P = 384, N = P * P };
static const double BETA = 4.0, SKY = 250, SIGMA = 3.7;

typedef struct tile {
    rx_tile tile;
    rx_background background;
} tile;

static void tile_new(const rx_sample *s, tile *t)
{
    *t = (tile){.tile = {.width = P, .height = P, .saturation = HUGE_VAL},
                .background = {.width = P, .height = P, .global_level = SKY, .global_sigma = SIGMA}};
    t->tile.pixels = calloc(N, sizeof(float));
    t->tile.mask = calloc(N, 1);
    t->background.level = calloc(N, sizeof(float));
    t->background.sigma = calloc(N, sizeof(float));
    for (int k = 0; k < N; k++) {
        t->background.level[k] = (float)SKY;
        t->background.sigma[k] = (float)SIGMA;
        t->tile.pixels[k] = (float)(s->x[k] * SIGMA + SKY);
    }
}

static void tile_free(tile *t)
{
    free(t->tile.pixels);
    free(t->tile.mask);
    free(t->background.level);
    free(t->background.sigma);
}

static rx_sample *make_sample(uint32_t bin)
{
    samples_test t = samples_test_open(1.0, 15.0);
    t.par.side = t.par.field_side = P;
    t.par.sky.beta[0] = t.par.sky.beta[1] = BETA;
    t.par.sky.ellipticity = 0;
    t.par.photon[0] = t.par.photon[1] = 0.01;
    t.par.sky_error = 0.03;
    t.par.noise_error = 0.05;
    t.par.psf_error = 0.02;
    rx_samples *scenes = samples_test_make(&t);
    rx_sample *s = samples_test_new(P);
    samples_test_sample(scenes, (rx_sample_id){.bin = bin, .index = 1}, s);
    rx_samples_free(scenes);
    rx_simulate_config_free(t.config);
    return s;
}

static rx_restored *run(const rx_model *model, const rx_sample *s)
{
    const rx_restore_params par = {.model = model, .net_block = 128, .nthreads = 2};
    rx_restored *restored = NULL;
    rx_error err = RX_ERROR_NONE;
    rx_psf *psf = NULL;
    tile t;
    tile_new(s, &t);
    /* the trainer tells the network this PSF, round here: no turn of the image matters */
    assert_int_equal(rx_psf_moffat(s->fwhm, BETA, 1, 0, 0, &psf, NULL), RX_OK);
    const rx_image whole = rx_tile_image(&t.tile);
    rx_image image = rx_image_on_sky(&whole, &t.background);
    image.psf = psf;
    if (rx_restorer_find("NET")->run(&par, &image, NULL, &restored, &err) != RX_OK)
        fail_msg("%s", err.text);
    rx_psf_free(psf);
    tile_free(&t);
    return restored;
}

/* One image through the trainer's own test, whose margin is `margin`, and through its step. */
static void train(const rx_model *model, rx_sample *s, int margin, float *restored, rx_test_image *dst)
{
    const rx_step_params par = {.kind = RX_LOSS_LINEAR, .idt_restore = 1, .floor = 10, .margin = margin};
    rx_step_values values;
    rx_step *step = NULL;
    rx_learner *learner = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_step_new(model, &par, P, &step, &err) != RX_OK ||
        rx_step_run(step, s, NULL, &values, &err) != RX_OK ||
        rx_learner_new(model, &par, P, 1, 1, &learner, &err) != RX_OK ||
        rx_learner_test(learner, &s, 1, dst, &err) != RX_OK)
        fail_msg("%s", err.text);
    assert_true(dst->loss == values.idt_restore);
    memcpy(restored, rx_step_restored(step), N * sizeof *restored);
    for (int k = 0; k < N; k++)
        restored[k] = rx_front_shown(restored[k]);
    rx_step_free(step);
    rx_learner_free(learner);
}

/* The same stars are found, and their fluxes are the same to `tolerance`. */
static void compare_stars(const rx_sample *s, int margin, const float *run, const rx_star_check *trained,
                          double tolerance)
{
    rx_star_check check;
    assert_int_equal(rx_star_check_run(s, run, margin, 2, &check, NULL), RX_OK);
    assert_true(check.stars == trained->stars);
    assert_true(check.found == trained->found);
    assert_true(check.ratios == trained->ratios);
    for (int i = 0; i < (int)check.ratios; i++)
        assert_true(fabs(check.error[i] - trained->error[i]) < tolerance);
}

/* Takes off what the restored image has at low frequency and the network's has not (restore/network_sky.h): bilinear
 * on 8 x 8 pixels between the centres of cells. */
static void take_sky_off(const float *trained, int margin, float *restored)
{
    enum { CELL = 8, LAST = CELL - 1 };
    for (int y = CELL / 2; y + CELL <= P; y += CELL)
        for (int x = CELL / 2; x + CELL <= P; x += CELL) {
            const int at = y * P + x, corner[4] = {at, at + LAST, at + LAST * P, at + LAST * P + LAST};
            const int inside = x >= margin && y >= margin && x + CELL <= P - margin && y + CELL <= P - margin;
            double d[4];
            for (int i = 0; i < 4; i++) {
                d[i] = (double)restored[corner[i]] - trained[corner[i]];
                if (inside)
                    assert_near(d[i], 0, 1 + 1e-3 * fabs(trained[corner[i]]));
            }
            for (int k = 0; k < CELL * CELL; k++) {
                const double u = (double)(k % CELL) / LAST, v = (double)(k / CELL) / LAST;
                const double low = d[0] + u * (d[1] - d[0]), high = d[2] + u * (d[3] - d[2]);
                restored[at + k / CELL * P + k % CELL] -= (float)(low + v * (high - low));
            }
        }
}

/* Differences in units of the noise and 1/1000 of the value: without the step what floats and FFTs round, and
 * beyond FWHM 6 what the Tikhonov filter has beyond its reach; with it what K' has beyond the stamp of either
 * side (1e-3 of it, nn/deblur.h). */
static void compare(uint32_t bin, rx_mode mode, int steps, int stages, double tolerance)
{
    rx_model *model = stages == 2 ? small_stages() : small_model(mode, 1);
    model->front.rl_steps = steps;
    const int margin = RX_TIKHONOV_REACH + rx_net_halo(model->restore) + RX_SAMPLE_KERNEL;
    rx_sample *s = make_sample(bin);
    float *trained = calloc(N, sizeof(float));
    rx_test_image image;
    double most = 0, brightest = 0;
    train(model, s, margin, trained, &image);
    rx_restored *r = run(model, s);
    assert_true(2 * margin < P - 100);
    for (int k = 0; k < N; k++)
        r->pixels[k] = (float)(r->pixels[k] / SIGMA);
    take_sky_off(trained, margin, r->pixels);
    for (int k = 0; k < N; k++) {
        const int x = k % P, y = k / P;
        if (x < margin || y < margin || x >= P - margin || y >= P - margin)
            continue;
        most = fmax(most, fabs(r->pixels[k] - trained[k]) / (1 + 1e-3 * fabs(trained[k])));
        brightest = fmax(brightest, trained[k]);
    }
    print_message("FWHM %.2f, %s, %d step, %d stages: %.2g sigma, brightest %.0f, %.0f stars\n", s->fwhm,
                  rx_mode_name(mode), steps, stages, most, brightest, image.check.stars);
    assert_true(most < tolerance);
    assert_true(brightest > 5);
    compare_stars(s, margin, r->pixels, &image.check, 2e-3);
    rx_restored_free(r);
    free(trained);
    free(s);
    rx_model_free(model);
}

static void test_same_as_trained(void **state)
{
    for (uint32_t bin = 0; bin < 5; bin++) {
        compare(bin, RX_MODE_BLIND, 0, 1, 1e-4);
        compare(bin, RX_MODE_INFORMED, 0, 1, bin < 4 ? 5e-4 : 1e-2);
        compare(bin, RX_MODE_INFORMED, 1, 1, 0.1);
        compare(bin, RX_MODE_INFORMED, 1, 2, 0.1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_same_as_trained)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
