/* Checkpoints: what is read is what was written, and nothing else is read; the history as tables. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmocka.h>

#include "../near.h"
#include "../scratch.h"
#include "nn/psfnet.h"
#include "train/checkpoint.h"
#include "train/train_page.h"

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
    for (int k = 0; k < RX_MODEL_NETS && s->adam[k] != NULL; k++) {
        s->adam[k]->steps = (long)(v += 1);
        for (long i = 0; i < s->adam[k]->n; i++) {
            s->params[k][i] = (float)(v += 0.25);
            s->best_params[k][i] = (float)(v += 0.25);
            s->adam[k]->mean[i] = (float)(v += 0.25);
            s->adam[k]->square[i] = (float)(v += 0.25);
        }
    }
    long *const longs[] = {&s->epoch,   &s->at,      &s->patches, &s->best_epoch,
                           &s->returns, &s->usual_n, &s->high,    &s->batches};
    double *const doubles[] = {&s->best,
                               &s->slow,
                               &s->usual,
                               &s->norm,
                               &s->rate,
                               &s->sum.total,
                               &s->sum.idt_restore,
                               &s->sum.idt_psf,
                               &s->sum.rec_restore,
                               &s->sum.rec_psf,
                               &s->sum.ffl};
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
    for (int e = 0; e < EPOCHS; e++) {
        const rx_epoch epoch = {.steps = v += 1, .test_loss = v += 1, .scatter = v += 1.0 / 3};
        const rx_epoch_bin bins[NBINS] = {{.loss = v += 1}, {.recall = NAN, .scatter = v += 1}};
        assert_int_equal(rx_history_add(&s->history, &epoch, bins, NULL), RX_OK);
    }
}

static void assert_same(const rx_train_state *a, const rx_train_state *b)
{
    for (int k = 0; k < RX_MODEL_NETS && a->adam[k] != NULL; k++) {
        const size_t bytes = (size_t)a->adam[k]->n * sizeof(float);
        assert_int_equal(a->adam[k]->steps, b->adam[k]->steps);
        assert_memory_equal(a->params[k], b->params[k], bytes);
        assert_memory_equal(a->best_params[k], b->best_params[k], bytes);
        assert_memory_equal(a->adam[k]->mean, b->adam[k]->mean, bytes);
        assert_memory_equal(a->adam[k]->square, b->adam[k]->square, bytes);
    }
    assert_true(a->epoch == b->epoch);
    assert_true(a->at == b->at);
    assert_true(a->patches == b->patches);
    assert_true(a->best_epoch == b->best_epoch);
    assert_true(a->returns == b->returns);
    assert_true(a->usual_n == b->usual_n);
    assert_true(a->high == b->high);
    assert_true(a->batches == b->batches);
    assert_true(a->best == b->best);
    assert_true(a->slow == b->slow);
    assert_true(a->usual == b->usual);
    assert_true(a->norm == b->norm);
    assert_true(a->rate == b->rate);
    assert_memory_equal(&a->sum, &b->sum, sizeof a->sum);
    assert_memory_equal(a->selection.loss, b->selection.loss, NBINS * sizeof(double));
    assert_memory_equal(a->selection.list, b->selection.list, NBINS * sizeof(double));
    assert_memory_equal(a->selection.train, b->selection.train, NBINS * sizeof(int));
    assert_memory_equal(a->selection.test, b->selection.test, NBINS * sizeof(int));
    assert_int_equal(a->history.n, b->history.n);
    if (a->history.n > 0) {
        assert_memory_equal(a->history.epoch, b->history.epoch, (size_t)a->history.n * sizeof(rx_epoch));
        assert_memory_equal(a->history.bin, b->history.bin,
                            (size_t)a->history.n * NBINS * sizeof(rx_epoch_bin));
    }
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

/* The end of an epoch: all weights are `weight`, the validation loss is that. */
static void end_epoch(rx_train_state *s, float weight, double validation)
{
    s->epoch++;
    for (int k = 0; k < RX_MODEL_NETS && s->adam[k] != NULL; k++)
        for (long i = 0; i < s->adam[k]->n; i++)
            s->params[k][i] = weight;
    rx_train_state_rank(s, validation);
}

static int nets_of(const rx_train_state *s)
{
    int n = 0;
    while (n < RX_MODEL_NETS && s->adam[n] != NULL)
        n++;
    return n;
}

static void best_is(const rx_train_state *s, long epoch, double loss, float weight)
{
    rx_model *model = make_model(nets_of(s));
    assert_int_equal(s->best_epoch, epoch);
    assert_true(s->best == loss);
    rx_train_state_load_best(s, model);
    rx_net *nets[RX_MODEL_NETS];
    rx_model_nets(model, nets);
    for (int k = 0; k < RX_MODEL_NETS && s->adam[k] != NULL; k++)
        for (long i = 0; i < nets[k]->nparams; i++)
            assert_near(nets[k]->params[i], weight, 0);
    rx_model_free(model);
}

static void the_best_weights_are_kept(void **state)
{
    (void)state;
    for (int nets = 1; nets <= 3; nets++) {
        rx_train_state *s = make_state(nets), *copy = make_state(nets);
        end_epoch(s, 1, NAN);
        best_is(s, 1, INFINITY, 1); /* better than nothing */
        end_epoch(s, 2, 5);
        best_is(s, 2, 5, 2);
        end_epoch(s, 3, 5);
        end_epoch(s, 4, 6);
        end_epoch(s, 5, NAN);
        best_is(s, 2, 5, 2);
        assert_int_equal(rx_train_state_copy(s, copy, NULL), RX_OK);
        end_epoch(s, 6, 4.5);
        best_is(s, 6, 4.5, 6);
        best_is(copy, 2, 5, 2);
        rx_train_state_free(s);
        rx_train_state_free(copy);
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

static void other_settings_are_named(void **state)
{
    size_t size;
    rx_error err;
    unsigned char *bytes = whole(state, &size);
    assert_int_equal(read_bytes(state, bytes, size, "SEED 1\nWIDTH 8\n", &err), RX_USAGE);
    assert_non_null(strstr(err.text, "with WIDTH 4, now it is WIDTH 8"));
    assert_int_equal(read_bytes(state, bytes, size, "SEED 12\nWIDTH 4\n", &err), RX_USAGE);
    assert_non_null(strstr(err.text, "with SEED 1, now it is SEED 12;"));
    free(bytes);
}

static void copies_are_independent(void **state)
{
    (void)state;
    rx_train_state *a = make_state(2), *b = make_state(2);
    fill(a, 3);
    fill(b, 99);
    assert_int_equal(rx_train_state_copy(a, b, NULL), RX_OK);
    assert_same(a, b);
    a->params[1][0] = -1;
    a->adam[0]->mean[0] = -2;
    a->history.epoch[0].steps = -3;
    assert_true(b->params[1][0] > 0);
    assert_true(b->adam[0]->mean[0] > 0);
    assert_true(b->history.epoch[0].steps > 0);
    rx_train_state_free(a);
    rx_train_state_free(b);
}

static char *part_of(void **state, const char *name)
{
    char *text = NULL;
    const char *path = in(state, name);
    assert_int_equal(rx_text_read_file(path, 1 << 20, &text, NULL, NULL), RX_OK);
    return text;
}

static void tables_have_a_row_for_everything(void **state)
{
    rx_model *model = make_model(1);
    rx_train_state *s = make_state(1);
    fill(s, 1);
    model->best = 2;
    s->history.epoch[1].test_loss = 1.5;
    s->history.epoch[1].input_loss = 2.5;
    assert_int_equal(rx_train_page_write(&(rx_train_page){.history = &s->history,
                                                          .selection = &s->selection,
                                                          .model = model,
                                                          .settings = SETTINGS,
                                                          .figures = 0},
                                         *state, "the folder", NULL),
                     RX_OK);
    char *log = part_of(state, "log.ecsv"), *dictionaries = part_of(state, "dictionary.ecsv"),
         *page = part_of(state, "training.html"), *json = part_of(state, "summary.json");
    assert_non_null(strstr(log, "\nepoch,steps,patches,rate,gradient,loss,"));
    assert_non_null(strstr(log, "\n3,"));
    assert_null(strstr(log, "\n4,"));
    assert_non_null(strstr(dictionaries, "\n1,2,5,1,15,"));
    assert_non_null(strstr(dictionaries, "\n3,5,8,1,15,0,0,0,0,nan,0,"));
    assert_non_null(
        strstr(page, "Better than unrestored images.</b> Test loss 1.5 against 2.5, epoch 2 of 3,"));
    assert_non_null(strstr(page, "<th scope=\"row\" class=\"t\">WIDTH</th><td class=\"t\">4</td>"));
    assert_non_null(strstr(json, "\"best_epoch\": 2,"));
    assert_non_null(strstr(json, "\"test_loss\": 1.5, \"input_loss\": 2.5,"));
    free(log);
    free(dictionaries);
    free(page);
    free(json);
    rx_model_free(model);
    rx_train_state_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(states_come_back),        cmocka_unit_test(the_best_weights_are_kept),
        cmocka_unit_test(no_file_is_no_error),     cmocka_unit_test(damage_is_seen),
        cmocka_unit_test(a_claim_takes_no_memory), cmocka_unit_test(other_settings_are_named),
        cmocka_unit_test(copies_are_independent),  cmocka_unit_test(tables_have_a_row_for_everything),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
