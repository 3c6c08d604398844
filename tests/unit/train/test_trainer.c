/* The parts of the trainer: settings as text, gradients in the order of samples, the test of an epoch; and a
 * whole training, interrupted within an epoch. */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "../near.h"
#include "../scratch.h"
#include "base/interrupt.h"
#include "base/random.h"
#include "base/threads.h"
#include "train/epoch_test.h"
#include "train/setup.h"
#include "train/trainer.h"

enum { SIDE = 32, SAMPLES = 5 };

static rx_train_config *make_config(const char *const (*pairs)[2])
{
    rx_train_config *config = NULL;
    assert_int_equal(rx_train_config_new(&config, NULL), RX_OK);
    for (; pairs != NULL && (*pairs)[0] != NULL; pairs++)
        assert_int_equal(rx_settings_set(&config->settings, (*pairs)[0], (*pairs)[1], NULL, NULL), RX_OK);
    return config;
}

static void settings_as_text(void **state)
{
    static const char *const pairs[][2] = {{"EPOCHS", "7"},         {"MODEL_NAME", "/home/somebody/m.fits"},
                                           {"NTHREADS", "2"},       {"RATE", "0.002"},
                                           {"SIM.STAR_COUNT", "5"}, {NULL, NULL}};
    rx_text record = {0}, all = {0}, none = {0};
    rx_train_config *config = make_config(pairs), *defaults = make_config(NULL);
    rx_model *model = NULL;
    (void)state;
    assert_int_equal(rx_setup_text(config, RX_SETUP_RECORD, &record, NULL), RX_OK);
    assert_string_equal(record.data, "EPOCHS 7\nSIM.STAR_COUNT 5\n");
    assert_int_equal(rx_setup_text(config, RX_SETUP_ALL, &all, NULL), RX_OK);
    assert_non_null(strstr(all.data, "RATE 0.002\n"));
    assert_non_null(strstr(all.data, "SIM.STAR_COUNT 5\n"));
    assert_null(strstr(all.data, "EPOCHS"));
    assert_null(strstr(all.data, "somebody"));
    assert_null(strstr(all.data, "NTHREADS"));
    assert_int_equal(rx_setup_text(defaults, RX_SETUP_RECORD, &none, NULL), RX_OK);
    assert_string_equal(none.data, "");
    assert_int_equal(rx_setup_model(config, &model, NULL), RX_OK);
    assert_string_equal(model->name, "m");
    assert_string_equal(model->provenance, record.data);
    assert_non_null(model->psf);
    rx_model_free(model);
    rx_text_free(&record);
    rx_text_free(&all);
    rx_text_free(&none);
    rx_train_config_free(config);
    rx_train_config_free(defaults);
}

static void networks_follow_the_keywords(void **state)
{
    static const char *const pairs[][2] = {{"MODE", "BLIND"},     {"LOSS_IDT_PSF", "0"}, {"LOSS_REC", "0"},
                                           {"LOSS_REC_PSF", "0"}, {"WIDTH", "4"},        {"BLOCKS", "1"},
                                           {"SEED", "3"},         {NULL, NULL}};
    rx_train_config *config = make_config(pairs);
    rx_model *model = NULL;
    (void)state;
    assert_int_equal(rx_setup_model(config, &model, NULL), RX_OK);
    assert_null(model->psf);
    assert_int_equal(model->front.mode, RX_MODE_BLIND);
    assert_int_equal(model->front.rl_steps, 0);
    assert_int_equal(model->restore->node[0].channels, 1);
    assert_int_equal(model->seed, 3);
    rx_model_free(model);
    rx_train_config_free(config);
    assert_int_equal(rx_threads_count(3), 3);
    assert_int_equal(rx_threads_count(-1), 1);
    assert_true(rx_threads_count(0) >= 1);
}

/* --- gradients --- */

static rx_sample *make_sample(uint32_t i)
{
    rx_sample *s = rx_sample_new(SIDE);
    assert_non_null(s);
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

/* Sums of gradients and terms over the samples, with that many threads. */
static void gradients_of(const rx_model *model, rx_sample *const *samples, int n, int nthreads, double clip,
                         float *const gradient[RX_MODEL_NETS], rx_step_values *values)
{
    const rx_step_params par = {
        .kind = RX_LOSS_LINEAR, .idt_restore = 1, .idt_psf = 0.1, .floor = 10, .margin = 4, .clip = clip};
    rx_learner *learner = NULL;
    assert_int_equal(rx_learner_new(model, &par, SIDE, SAMPLES, nthreads, &learner, NULL), RX_OK);
    assert_int_equal(rx_learner_gradients(learner, samples, n, values, NULL), RX_OK);
    rx_net *nets[RX_MODEL_NETS];
    rx_model_nets(model, nets);
    for (int k = 0; k < RX_MODEL_NETS; k++)
        if (nets[k] != NULL) {
            memset(gradient[k], 0, (size_t)nets[k]->nparams * sizeof(float));
            rx_learner_add(learner, k, n, gradient[k]);
        }
    rx_learner_free(learner);
}

static void threads_change_no_bit(void **state)
{
    static const char *const pairs[][2] = {{"WIDTH", "4"}, {"BLOCKS", "1"}, {NULL, NULL}};
    rx_train_config *config = make_config(pairs);
    rx_sample *samples[SAMPLES];
    rx_step_values values[2][SAMPLES];
    rx_model *model = NULL;
    float *gradient[2][RX_MODEL_NETS] = {{NULL}};
    double norm = 0;
    (void)state;
    assert_int_equal(rx_setup_model(config, &model, NULL), RX_OK);
    const size_t n[2] = {(size_t)model->restore->nparams, (size_t)model->psf->nparams};
    for (uint32_t i = 0; i < SAMPLES; i++)
        samples[i] = make_sample(i);
    for (int t = 0; t < 2; t++) {
        for (int k = 0; k < 2; k++)
            assert_non_null(gradient[t][k] = malloc(n[k] * sizeof(float)));
        gradients_of(model, samples, SAMPLES, 1 + 2 * t, 0, gradient[t], values[t]);
    }
    for (int k = 0; k < 2; k++) {
        assert_memory_equal(gradient[0][k], gradient[1][k], n[k] * sizeof(float));
        for (size_t p = 0; p < n[k]; p++)
            norm += fabsf(gradient[0][k][p]);
        free(gradient[0][k]);
        free(gradient[1][k]);
    }
    assert_true(norm > 0);
    assert_memory_equal(values[0], values[1], sizeof values[0]);
    for (int i = 0; i < SAMPLES; i++)
        rx_sample_free(samples[i]);
    rx_model_free(model);
    rx_train_config_free(config);
}

/* Each sample's gradient, over all networks, before the sum; their terms stay. */
static void samples_are_clipped(void **state)
{
    static const char *const pairs[][2] = {{"WIDTH", "4"}, {"BLOCKS", "1"}, {NULL, NULL}};
    rx_train_config *config = make_config(pairs);
    rx_sample *samples[2] = {make_sample(0), make_sample(1)};
    rx_step_values values[2][2];
    rx_model *model = NULL;
    float *whole[2][RX_MODEL_NETS] = {{NULL}}, *clipped[RX_MODEL_NETS] = {NULL};
    double norm[2] = {0};
    (void)state;
    assert_int_equal(rx_setup_model(config, &model, NULL), RX_OK);
    const size_t n[2] = {(size_t)model->restore->nparams, (size_t)model->psf->nparams};
    for (int k = 0; k < 2; k++) {
        assert_non_null(clipped[k] = malloc(n[k] * sizeof(float)));
        for (int i = 0; i < 2; i++)
            assert_non_null(whole[i][k] = malloc(n[k] * sizeof(float)));
    }
    for (int i = 0; i < 2; i++) {
        gradients_of(model, samples + i, 1, 1, 0, whole[i], &values[0][i]);
        for (int k = 0; k < 2; k++)
            for (size_t p = 0; p < n[k]; p++)
                norm[i] += pow(whole[i][k][p], 2);
        norm[i] = sqrt(norm[i]);
    }
    /* the first is too long, the second is not */
    const int longer = norm[1] > norm[0];
    const double clip = sqrt(norm[0] * norm[1]), share = clip / norm[longer];
    assert_true(share < 0.99);
    gradients_of(model, samples, 2, 2, clip, clipped, values[1]);
    assert_memory_equal(values[0], values[1], sizeof values[0]);
    for (int k = 0; k < 2; k++) {
        for (size_t p = 0; p < n[k]; p++)
            assert_near(clipped[k][p], share * whole[longer][k][p] + whole[1 - longer][k][p], 1e-6 * clip);
        free(clipped[k]);
        free(whole[0][k]);
        free(whole[1][k]);
    }
    rx_sample_free(samples[0]);
    rx_sample_free(samples[1]);
    rx_model_free(model);
    rx_train_config_free(config);
}

/* --- the test of an epoch --- */

static void bins_are_judged_by_their_images(void **state)
{
    const double fwhm[2] = {2, 8}, sigma[2] = {1, 15};
    rx_selection selection;
    rx_epoch epoch = {0};
    rx_epoch_bin bins[2];
    rx_model *model = rx_model_new();
    rx_test_image images[40] = {{0}};
    (void)state;
    assert_non_null(model);
    assert_int_equal(rx_selection_begin((const int[]){2, 1}, fwhm, sigma, 30, 1, &selection, NULL), RX_OK);
    assert_int_equal(selection.train[0], 10);
    assert_int_equal(selection.test[0], 20);
    for (int i = 0; i < 40; i++) {
        images[i].loss = i < 20 ? 1 : 4;
        images[i].input = 6;
        images[i].check.stars = i < 20 ? 2 : 0;
        images[i].check.found = i < 20 ? 1 : 0;
        if (i < 5) { /* -2 ... 2 per cent */
            images[i].check.ratios = 1;
            images[i].check.error[0] = 0.01 * (i - 2);
        }
    }
    assert_int_equal(rx_epoch_test(images, &selection, &epoch, bins, NULL), RX_OK);
    assert_true(bins[0].loss == 1);
    assert_true(bins[1].loss == 4);
    assert_true(fabs(bins[0].list - 0.2) < 1e-12);
    assert_true(fabs(bins[1].list - 0.8) < 1e-12);
    assert_true(bins[0].train == 10);
    assert_true(bins[0].test == 20);
    assert_true(bins[0].recall == 0.5);
    assert_true(isnan(bins[1].recall));
    assert_true(fabs(bins[0].bias) < 1e-12);
    assert_true(fabs(bins[0].scatter - 0.014826) < 1e-6);
    assert_true(isnan(bins[1].bias));
    assert_true(isnan(bins[1].scatter));
    assert_true(epoch.test_loss == 2.5);
    assert_true(epoch.input_loss == 6);
    assert_true(epoch.recall == 0.5);
    assert_int_equal(selection.train[0], 4); /* Eq. 4: 20 times the list */
    assert_int_equal(selection.test[0], 26);
    assert_int_equal(selection.train[1], 16);
    assert_int_equal(rx_epoch_dictionary(&selection, bins, model, NULL), RX_OK);
    assert_true(model->nfwhm == 2);
    assert_true(model->nsigma == 1);
    assert_true(model->bins[1].fwhm[0] == 5);
    assert_true(model->bins[0].images == 20);
    assert_true(model->bins[0].recall == 0.5);
    rx_model_free(model);
}

/* --- a training --- */

static rx_train_config *make_training(const char *folder, const char *name)
{
    static const char *const pairs[][2] = {
        {"EPOCHS", "2"},     {"WIDTH", "4"},        {"BLOCKS", "1"},
        {"PATCH", "32"},     {"PATCH_MARGIN", "4"}, {"FIELD_PATCHES", "2"},
        {"GRID", "2,1"},     {"BIN_IMAGES", "60"},  {"BATCH", "4"},
        {"QA_FIGURES", "N"}, {"NTHREADS", "2"},     {"SIM.STAR_COUNT", "3000"},
        {"LOSS_REC", "0"},   {NULL, NULL}};
    static const char *const names[] = {"MODEL_NAME", "CHECKPOINT_NAME", "OUTPUT_NAME"};
    rx_train_config *config = make_config(pairs);
    for (int i = 0; i < 3; i++) {
        char path[160];
        snprintf(path, sizeof path, "%s/%s.%d", folder, name, i);
        assert_int_equal(rx_settings_set(&config->settings, names[i], path, NULL, NULL), RX_OK);
    }
    return config;
}

static char *model_bytes(const rx_train_config *config, size_t *size)
{
    char *bytes = calloc(1, 1 << 20);
    FILE *file = fopen(config->model_name, "rb");
    assert_true(bytes != NULL);
    assert_true(file != NULL);
    *size = fread(bytes, 1, 1 << 20, file);
    fclose(file);
    return bytes;
}

/* Ends the process's work after a while. */
typedef struct alarm_clock {
    unsigned delay; /* microseconds */
} alarm_clock;

static void *ring(void *user)
{
    const alarm_clock *clock = user;
    usleep(clock->delay);
    kill(getpid(), SIGTERM);
    return NULL;
}

/* Signals again and again, a little later each time: each call goes on from where the one before was stopped, within
 * epochs too, and in the end there is the same model. */
static void piece_by_piece(void **state)
{
    size_t size, other_size;
    rx_status status = RX_INTERRUPTED;
    sigset_t set;
    int ignored, within = 0;
    rx_train_config *config = make_training(*state, "model");
    config->width = 16; /* steps that take as long as the images of the epoch */
    assert_int_equal(rx_train_run(config, NULL, NULL), RX_OK);
    char *bytes = model_bytes(config, &size);
    assert_int_equal(remove(config->model_name) + remove(config->checkpoint_name), 0);
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    for (double delay = 2e4; delay < 1e9 && status == RX_INTERRUPTED; delay *= 1.2) {
        rx_error err = RX_ERROR_NONE;
        pthread_t thread;
        alarm_clock clock = {.delay = (unsigned)delay};
        assert_int_equal(pthread_create(&thread, NULL, ring, &clock), 0);
        status = rx_train_run(config, NULL, &err);
        pthread_join(thread, NULL);
        sigwait(&set, &ignored);
        const char *after = status == RX_INTERRUPTED ? strstr(err.text, ", after ") : NULL;
        if (after != NULL) { /* NULL: stopped before the training began, or not at all */
            assert_int_equal(access(config->checkpoint_name, F_OK), 0);
            within += atoi(after + strlen(", after ")) > 0;
        }
    }
    assert_int_equal(status, RX_OK);
    assert_true(within > 0);
    char *other = model_bytes(config, &other_size);
    assert_int_equal(size, other_size);
    assert_memory_equal(bytes, other, size);
    free(bytes);
    free(other);
    rx_train_config_free(config);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(settings_as_text),
        cmocka_unit_test(networks_follow_the_keywords),
        cmocka_unit_test(threads_change_no_bit),
        cmocka_unit_test(samples_are_clipped),
        cmocka_unit_test(bins_are_judged_by_their_images),
        cmocka_unit_test(piece_by_piece),
    };
    rx_interrupt_block(); /* before there are other threads, as programs do */
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
