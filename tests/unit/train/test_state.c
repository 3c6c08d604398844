/* The state of a training: Adam; checkpoints, from which what is read is what was written, and nothing else is read. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "../near.h"
#include "../scratch.h"
#include "nn/psfnet.h"
#include "train/state.h"

static const char SETTINGS[] = "SEED 1\nWIDTH 4\n";
enum { NBINS = 2, EPOCHS = 3 };

static rx_model *make_model(int nets)
{
    const rx_psfnet_shape shape = {.width = 4, .blocks = 1, .stem_kernel = 3, .kernel = 3};
    rx_model *model = rx_model_new();
    assert_non_null(model);
    assert_int_equal(rx_psfnet_new(&shape, 3, &model->restore, NULL), RX_OK);
    rx_net_initialise(model->restore, 1, 1, 0.3, 0.1);
    if (nets > 1)
        assert_int_equal(rx_psfnet_new(&shape, 2, &model->psf, NULL), RX_OK);
    if (nets > 2)
        assert_int_equal(rx_psfnet_new(&shape, 5, &model->second, NULL), RX_OK);
    return model;
}

static rx_train_state *make_state(int nets)
{
    const double fwhm[2] = {2, 8}, sigma[2] = {1, 15};
    rx_selection selection;
    rx_train_state *state = NULL;
    rx_model *model = make_model(nets);
    assert_int_equal(rx_selection_begin((const int[]){NBINS, 1}, fwhm, sigma, 40, 1, &selection, NULL),
                     RX_OK);
    assert_int_equal(rx_train_state_new(model, &selection, &state, NULL), RX_OK);
    rx_model_free(model);
    return state;
}

/* Every number differs from that of a fresh state, and from each other. */
static void fill(rx_train_state *s, double first)
{
    double v = first;
    for (long i = 0; i < 4 * s->n; i++)
        s->weights[i] = (float)(v += 0.25);
    long *const longs[] = {&s->steps,   &s->epoch,  &s->at,   &s->patches, &s->best_epoch,
                           &s->returns, &s->loss_n, &s->high, &s->batches};
    double *const doubles[] = {&s->best_loss, &s->slow,      &s->loss,   &s->norm,
                               &s->rate,      &s->sum.total, &s->sum.ffl};
    for (size_t i = 0; i < sizeof longs / sizeof *longs; i++)
        *longs[i] = (long)(v += 1);
    for (size_t i = 0; i < sizeof doubles / sizeof *doubles; i++)
        *doubles[i] = v += 1.0 / 3;
    for (int b = 0; b < NBINS; b++) {
        s->selection.loss[b] = v += 1.0 / 3;
        s->selection.list[b] = v += 1.0 / 3;
        s->selection.train[b] = (int)(v += 1);
        s->selection.test[b] = (int)(v += 1);
    }
    assert_int_equal(rx_history_resize(&s->history, EPOCHS, NULL), RX_OK);
    for (int e = 0; e < EPOCHS; e++) {
        s->history.epoch[e] = (rx_epoch){.steps = v += 1, .test_loss = v += 1, .scatter = v += 1.0 / 3};
        s->history.bin[NBINS * e] = (rx_epoch_bin){.loss = v += 1};
        s->history.bin[NBINS * e + 1] = (rx_epoch_bin){.recall = NAN, .scatter = v += 1};
    }
}

/* But for where their arrays are. */
static void assert_same(const rx_train_state *a, const rx_train_state *b)
{
    rx_train_state x = *a, y = *b;
    assert_memory_equal(a->weights, b->weights, 4 * (size_t)a->n * sizeof(float));
    if (a->history.n > 0) {
        assert_memory_equal(a->history.epoch, b->history.epoch, (size_t)a->history.n * sizeof(rx_epoch));
        assert_memory_equal(a->history.bin, b->history.bin,
                            (size_t)a->history.n * NBINS * sizeof(rx_epoch_bin));
    }
    y.weights = x.weights;
    y.best = x.best;
    y.mean = x.mean;
    y.square = x.square;
    y.history.epoch = x.history.epoch;
    y.history.bin = x.history.bin;
    assert_memory_equal(&x, &y, sizeof x);
}

static void states_come_back(void **state)
{
    const char *path = in(state, "back");
    for (int nets = 1; nets <= 3; nets++)
        for (int within = 0; within < 2; within++) {
            rx_train_state *kept = make_state(nets), *now = make_state(nets);
            rx_train_state *kept2 = make_state(nets), *now2 = make_state(nets);
            int found = 0, was_within = -1;
            fill(kept, 1);
            fill(now, 7777);
            assert_int_equal(rx_checkpoint_write(path, path, SETTINGS, kept, within ? now : NULL, NULL),
                             RX_OK);
            assert_int_equal(rx_checkpoint_read(path, SETTINGS, kept2, now2, &found, &was_within, NULL),
                             RX_OK);
            assert_true(found);
            assert_true(was_within == within);
            assert_same(kept, kept2);
            assert_same(within ? now : kept, now2);
            rx_train_state_free(kept);
            rx_train_state_free(now);
            rx_train_state_free(kept2);
            rx_train_state_free(now2);
        }
}

static void no_file_is_no_error(void **state)
{
    int found = 1, within = 1;
    rx_train_state *kept = make_state(1), *now = make_state(1), *fresh = make_state(1);
    const char *path = in(state, "none");
    assert_int_equal(rx_checkpoint_read(path, SETTINGS, kept, now, &found, &within, NULL), RX_OK);
    assert_false(found || within);
    assert_same(kept, fresh);
    rx_train_state_free(kept);
    rx_train_state_free(now);
    rx_train_state_free(fresh);
}

/* What a read of bytes[size] says, into fresh states. */
static rx_status read_bytes(void **state, const unsigned char *bytes, size_t size, const char *settings,
                            rx_error *err)
{
    int found, within;
    rx_train_state *kept = make_state(1), *now = make_state(1);
    const char *path = in(state, "bytes");
    write_bytes(path, bytes, size);
    *err = RX_ERROR_NONE;
    const rx_status status = rx_checkpoint_read(path, settings, kept, now, &found, &within, err);
    rx_train_state_free(kept);
    rx_train_state_free(now);
    return status;
}

static unsigned char *whole(void **state, size_t *size)
{
    rx_train_state *kept = make_state(1), *now = make_state(1);
    const char *path = in(state, "whole");
    fill(kept, 1);
    fill(now, 5);
    assert_int_equal(rx_checkpoint_write(path, path, SETTINGS, kept, now, NULL), RX_OK);
    rx_train_state_free(kept);
    rx_train_state_free(now);
    unsigned char *bytes = (unsigned char *)file_bytes(path, size);
    assert_true(*size >= 1000);
    return bytes;
}

static void damage_is_seen(void **state)
{
    size_t size;
    rx_error err;
    unsigned char *bytes = whole(state, &size);
    assert_int_equal(read_bytes(state, bytes, size, SETTINGS, &err), RX_OK);
    const size_t head = strlen("rextract-train checkpoint 1\n");
    for (size_t i = head; i < size; i += i < head + 200 ? 1 : size / 97) {
        const unsigned char old = bytes[i];
        bytes[i] ^= 0x10;
        const rx_status status = read_bytes(state, bytes, size, SETTINGS, &err);
        assert_true(status == RX_INPUT || status == RX_USAGE || status == RX_SYSTEM);
        assert_true(err.text[0] != '\0');
        bytes[i] = old;
    }
    for (size_t cut = head; cut < size; cut += 1 + size / 61)
        assert_int_equal(read_bytes(state, bytes, cut, SETTINGS, &err), RX_INPUT);
    assert_int_equal(read_bytes(state, bytes, size - 1, SETTINGS, &err), RX_INPUT);
    bytes[size] = 0;
    assert_int_equal(read_bytes(state, bytes, size + 1, SETTINGS, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "damaged"));
    assert_int_equal(read_bytes(state, bytes, 10, SETTINGS, &err), RX_USAGE);
    assert_int_equal(read_bytes(state, (const unsigned char *)"a letter\n", 9, SETTINGS, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "no checkpoint"));
    free(bytes);
}

/* A history that claims more epochs than the file holds is refused before there is memory for them. */
static void a_claim_takes_no_memory(void **state)
{
    size_t size;
    rx_error err;
    struct rusage before, after;
    const long claim = 1L << 24;
    unsigned char *bytes = whole(state, &size);
    const size_t history = EPOCHS * (sizeof(rx_epoch) + NBINS * sizeof(rx_epoch_bin));
    memcpy(bytes + size - sizeof(uint64_t) - history - sizeof claim, &claim, sizeof claim);
    getrusage(RUSAGE_SELF, &before);
    assert_int_equal(read_bytes(state, bytes, size, SETTINGS, &err), RX_INPUT);
    getrusage(RUSAGE_SELF, &after);
    assert_true(after.ru_maxrss - before.ru_maxrss < 100 * 1024); /* KiB */
    free(bytes);
}

/* python3 -c "
 * import numpy as np
 * p=np.array([.5,-1,3.]); m=np.zeros(3); v=np.zeros(3)
 * for t,g in enumerate([[1,-2,0],[.5,4,0],[-3,1,1e-3]],1):
 *   g=np.array(g,float); m=.9*m+.1*g; v=.99*v+.01*g*g
 *   p-=.01*t*(m/(1-.9**t))/(np.sqrt(v/(1-.99**t))+1e-8)
 *   print(*['%.9g'%x for x in p])" */
static void adam_as_published(void **state)
{
    static const float gradients[3][3] = {{1, -2, 0}, {0.5f, 4, 0}, {-3, 1, 1e-3f}};
    static const double expected[3][3] = {
        {0.490000000, -0.990000000, 3.0},
        {0.471331040, -0.997312154, 3.0},
        {0.481711101, -1.009789890, 2.98092212},
    };
    float weights[3] = {0.5f, -1, 3}, mean[3] = {0}, square[3] = {0};
    rx_train_state s = {.n = 3, .weights = weights, .mean = mean, .square = square};
    for (int t = 0; t < 3; t++) {
        rx_train_state_step(&s, gradients[t], 0.01 * (t + 1));
        for (int i = 0; i < 3; i++)
            assert_true(fabs(weights[i] - expected[t][i]) < 1e-6);
    }
    assert_int_equal(s.steps, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(adam_as_published),       cmocka_unit_test(states_come_back),
        cmocka_unit_test(no_file_is_no_error),     cmocka_unit_test(damage_is_seen),
        cmocka_unit_test(a_claim_takes_no_memory),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
