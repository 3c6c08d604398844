/* The trainer's loop. */
#include "train/trainer.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/threads.h"
#include "par/ranks.h"
#include "train/checkpoint.h"
#include "train/epoch_test.h"
#include "train/setup.h"
#include "train/train_output.h"

/* Divergence: so many batches in a row above so many times the running mean, known from so many batches. */
enum { HIGH_BATCHES = 3, KNOWN_BATCHES = 5, MOST_RETURNS = 3 };
static const double HIGH = 20, FORGETS = 0.02;

typedef struct job {
    const rx_train_config *config;
    rx_log *log; /* NULL on all ranks but the first */
    rx_feed_params feed_par;
    rx_ranks *ranks;
    rx_feed *feed;
    rx_model *model;
    rx_learner *learner;
    rx_train_output output;
    rx_train_state *kept, *now;     /* at the last end of an epoch, and now */
    float *gradient[RX_MODEL_NETS]; /* NULL: the model has no such network */
    rx_sample **sample;             /* [most]: of this rank's share of a batch */
    rx_sample **validation;         /* [nvalidation]: this rank's share of those images */
    int nvalidation;
    rx_step_values *values;
    int most, rank, nranks;
    double begun, begun_at; /* seconds; share of the training done then */
    double learning;        /* seconds spent on gradients and improvements */
    long learnt;            /* from so many images, by this rank */
    int has_diverged, interrupted;
} job;

/* Sums over a batch that all ranks must agree on. */
typedef struct batch_sums {
    rx_step_values values;
    double interrupted;
} batch_sums;

static void generate(void *user, rx_ranks *ranks)
{
    /* its errors go to the trainer */
    rx_feed_generate(user, ranks, NULL, NULL);
}

/* --- a batch --- */

/* This rank's share of positions from .. to - 1 of the epoch. */
static rx_status take_samples(job *j, long from, long to, int *n, rx_error *err)
{
    rx_status status = RX_OK;
    *n = 0;
    for (long at = from; at < to && status == RX_OK; at++)
        if (at % j->nranks == j->rank) {
            status = rx_feed_next(j->feed, at, &j->sample[*n], err);
            *n += status == RX_OK;
        }
    return status;
}

static void free_samples(job *j, int n)
{
    for (int i = 0; i < n; i++)
        rx_sample_free(j->sample[i]);
}

static void add_values(rx_step_values *sum, const rx_step_values *v, double scale)
{
    sum->total += scale * v->total;
    sum->idt_restore += scale * v->idt_restore;
    sum->idt_psf += scale * v->idt_psf;
    sum->rec_restore += scale * v->rec_restore;
    sum->rec_psf += scale * v->rec_psf;
    sum->light += scale * v->light;
    sum->ffl += scale * v->ffl;
}

/* Is the loss of a batch what one would expect? Divergence changes nothing in the weights. */
static int diverges(rx_train_state *s, double loss, double norm)
{
    if (!isfinite(loss) || !isfinite(norm))
        return 1;
    const int high = s->usual_n > 0 && loss > HIGH * s->usual;
    if (high && s->usual_n >= KNOWN_BATCHES)
        return ++s->high >= HIGH_BATCHES;
    s->high = 0;
    s->usual_n++;
    loss = high ? HIGH * s->usual : loss; /* one bad batch is not what is usual */
    s->usual += fmax(FORGETS, 1 / (double)s->usual_n) * (loss - s->usual);
    return 0;
}

/* Clipped gradients into the weights. */
static void improve(job *j, long n, long epoch_images, const rx_step_values *mean)
{
    rx_train_state *s = j->now;
    long sizes[RX_MODEL_NETS] = {0};
    for (int k = 0; k < RX_MODEL_NETS; k++) {
        sizes[k] = s->adam[k] != NULL ? s->adam[k]->n : 0;
        for (long p = 0; p < sizes[k]; p++)
            j->gradient[k][p] /= (float)n;
    }
    const double norm = rx_gradient_clip(j->gradient, sizes, RX_MODEL_NETS, j->config->clip);
    j->has_diverged = diverges(s, mean->total, norm);
    if (j->has_diverged)
        return;
    /* the middle of the step */
    const double within = ((double)s->at + 0.5 * (double)n) / (double)epoch_images;
    const double progress = ((double)s->epoch + within) / j->config->epochs;
    s->rate = j->config->rate * s->slow * rx_schedule(progress, j->config->warmup);
    for (int k = 0; k < RX_MODEL_NETS; k++)
        if (s->adam[k] != NULL)
            rx_adam_step(s->adam[k], j->gradient[k], s->rate, s->params[k]);
    add_values(&s->sum, mean, (double)n);
    s->norm += norm;
    s->batches++;
    s->at += n;
    s->patches += n;
    rx_train_state_load(s, j->model);
    rx_learner_load(j->learner);
}

/* One step of the optimiser, on the next images of an epoch that has n. */
static rx_status run_batch(job *j, long n, rx_error *err)
{
    const long from = j->now->at, to = from + j->config->batch < n ? from + j->config->batch : n;
    batch_sums sums = {.interrupted = rx_interrupt_pending()};
    int mine = 0;
    rx_status status = take_samples(j, from, to, &mine, err);
    const double begun = rx_seconds();
    if (status == RX_OK)
        status = rx_learner_gradients(j->learner, j->sample, mine, j->gradient, j->values, err);
    free_samples(j, mine);
    for (int i = 0; i < mine && status == RX_OK; i++)
        add_values(&sums.values, &j->values[i], 1);
    for (int k = 0; k < RX_MODEL_NETS && status == RX_OK; k++)
        if (j->gradient[k] != NULL)
            status = rx_ranks_sum(j->ranks, j->gradient[k], j->now->adam[k]->n, err);
    if (status == RX_OK)
        status = rx_ranks_sum_double(j->ranks, (double *)&sums, sizeof sums / sizeof(double), err);
    if (status != RX_OK)
        return status;
    rx_step_values mean = {0};
    add_values(&mean, &sums.values, 1 / (double)(to - from));
    improve(j, to - from, n, &mean);
    j->learning += rx_seconds() - begun;
    j->learnt += mine;
    j->interrupted = sums.interrupted > 0;
    return RX_OK;
}

/* --- an epoch --- */

static double progress_of(const job *j, long n)
{
    const double within = n > 0 ? (double)j->now->at / (double)n : 0;
    return ((double)j->now->epoch + within) / j->config->epochs;
}

static void show_progress(const job *j, long n)
{
    char what[96];
    const double left = 1 - j->begun_at, done = left > 0 ? (progress_of(j, n) - j->begun_at) / left : 1;
    snprintf(what, sizeof what, "epoch %ld of %d, loss %.4g", j->now->epoch + 1, j->config->epochs,
             j->now->usual);
    rx_log_progress(j->log, what, done);
}

/* All test images of the epoch, those of other ranks included. */
static rx_status run_tests(job *j, long first, long n, rx_test_image *images, rx_error *err)
{
    rx_test_image *mine = RX_NEW(rx_test_image, (size_t)j->most);
    rx_status status = mine != NULL ? RX_OK : rx_error_memory(err, (size_t)j->most * sizeof *mine);
    for (long from = 0; from < n && status == RX_OK; from += j->config->batch) {
        const long to = from + j->config->batch < n ? from + j->config->batch : n;
        int count = 0, next = 0;
        status = take_samples(j, first + from, first + to, &count, err);
        if (status == RX_OK)
            status = rx_learner_test(j->learner, j->sample, count, mine, err);
        free_samples(j, count);
        for (long i = from; i < to && status == RX_OK; i++)
            if ((first + i) % j->nranks == j->rank)
                images[i] = mine[next++];
        /* of several ranks none may leave the others alone */
        if (status == RX_OK && j->nranks == 1)
            status = rx_interrupt_check(err);
    }
    free(mine);
    if (status == RX_OK)
        status = rx_ranks_sum_double(j->ranks, (double *)images, n * RX_TEST_NUMBERS, err);
    return status;
}

/* The validation images, before the first epoch. */
static rx_status draw_validation(job *j, rx_error *err)
{
    rx_selection set = j->feed_par.grid;
    for (int b = 0; b < set.nbins; b++) {
        set.train[b] = 0;
        set.test[b] = j->config->validation_images;
    }
    const long n = (long)set.nbins * j->config->validation_images;
    j->validation = RX_NEW(rx_sample *, (size_t)n);
    if (j->validation == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *j->validation);
    rx_status status = rx_feed_epoch(j->feed, RX_EPOCH_VALIDATION, &set, NULL, 0, err);
    for (long at = j->rank; at < n && status == RX_OK; at += j->nranks) {
        status = rx_feed_next(j->feed, at, &j->validation[j->nvalidation], err);
        j->nvalidation += status == RX_OK;
    }
    return status;
}

/* Mean loss of RESTORE over the validation images, those of other ranks included, in their order. */
static rx_status validate(job *j, double *mean, rx_error *err)
{
    const long n = (long)j->feed_par.grid.nbins * j->config->validation_images;
    rx_test_image *mine = RX_NEW(rx_test_image, (size_t)j->nvalidation);
    double *loss = RX_NEW(double, (size_t)n);
    rx_status status = mine != NULL && loss != NULL ? RX_OK : rx_error_memory(err, (size_t)n * sizeof *mine);
    if (status == RX_OK)
        status = rx_learner_test(j->learner, j->validation, j->nvalidation, mine, err);
    for (int i = 0; i < j->nvalidation && status == RX_OK; i++)
        loss[j->rank + (long)i * j->nranks] = mine[i].loss;
    if (status == RX_OK)
        status = rx_ranks_sum_double(j->ranks, loss, n, err);
    *mean = 0;
    for (long i = 0; i < n && status == RX_OK; i++)
        *mean += loss[i] / (double)n;
    free(mine);
    free(loss);
    return status;
}

/* A complete epoch into the history and the model; the state is then at its end. */
static rx_status conclude(job *j, const rx_test_image *images, double validation, rx_error *err)
{
    rx_train_state *s = j->now;
    rx_epoch epoch = {.steps = (double)s->adam[0]->steps,
                      .patches = (double)s->patches,
                      .rate = s->rate,
                      .validation = validation,
                      .norm = s->norm / (double)s->batches};
    rx_epoch_bin *bins = RX_NEW(rx_epoch_bin, (size_t)s->selection.nbins);
    if (bins == NULL)
        return rx_error_memory(err, (size_t)s->selection.nbins * sizeof *bins);
    add_values(&epoch.losses, &s->sum, 1 / (double)s->at);
    rx_status status = rx_epoch_test(images, &s->selection, &epoch, bins, err);
    if (status == RX_OK)
        status = rx_history_add(&s->history, &epoch, bins, err);
    free(bins);
    if (status != RX_OK)
        return status;
    s->epoch++;
    rx_train_state_rank(s, validation);
    s->at = s->batches = 0;
    s->sum = (rx_step_values){0};
    s->norm = 0;
    return rx_train_state_copy(s, j->kept, err);
}

static int is_over(const job *j)
{
    const rx_train_state *s = j->kept;
    const rx_train_config *c = j->config;
    return s->epoch >= c->epochs ||
           (c->patience > 0 && rx_schedule_low(s->best_epoch, s->epoch, c->epochs, c->warmup) >= c->patience);
}

/* At the end of an epoch: the best one as the model, and the state, onto the disk. */
static rx_status save(job *j, rx_error *err)
{
    const rx_train_state *s = j->kept;
    const rx_epoch_bin *bins = s->history.bin + (s->best_epoch - 1) * s->history.nbins;
    rx_train_state_load_best(s, j->model);
    j->model->epochs = s->epoch;
    j->model->best = s->best_epoch;
    j->model->ended = is_over(j);
    j->model->patches = s->patches;
    rx_status status = rx_epoch_dictionary(&s->selection, bins, j->model, err);
    if (status == RX_OK && j->rank == 0)
        status = rx_train_output_epoch(&j->output, j->model, s, j->model->ended, err);
    rx_train_state_load(s, j->model);
    return status;
}

/* "1h05m" or "40 s". */
static void tell_epoch(const job *j, double seconds, double waited, long images)
{
    const rx_history *h = &j->kept->history;
    const rx_epoch *e = &h->epoch[h->n - 1];
    char left[RX_TIME_LEFT];
    const double done = progress_of(j, 0) - j->begun_at;
    rx_time_left(done > 0 ? (rx_seconds() - j->begun) * (1 - progress_of(j, 0)) / done : 0, left);
    rx_log_info(
        j->log,
        "epoch %ld of %d: loss %.4g, test %.4g (unrestored %.4g), validation %.4g%s, recall %.3f, flux "
        "bias %+.2f %%; %.0f images/s; %s left",
        h->n, j->config->epochs, e->losses.total, e->test_loss, e->input_loss, e->validation,
        j->kept->best_epoch == h->n ? " (best)" : "", e->recall, 100 * e->bias, (double)images / seconds,
        left);
    rx_log_detail(j->log, "flux scatter %.2f %%; %.0f %% of the time spent waiting for images",
                  100 * e->scatter, 100 * waited / seconds);
}

/* What steps and images have cost so far. */
static void tell_costs(const job *j)
{
    long images = 0;
    double seconds = 0;
    rx_feed_drawn(j->feed, &images, &seconds);
    rx_log_detail(j->log,
                  "steps: %.2f s for %ld images, %.2f s waiting for them; generators: %.2f s for %ld images",
                  j->learning, j->learnt, rx_feed_waited(j->feed), seconds, images);
}

/* Back to the last end of an epoch, with half the rate. */
static rx_status go_back(job *j, rx_error *err)
{
    const long returns = j->kept->returns + 1;
    if (returns > MOST_RETURNS)
        return rx_error_set(
            err, RX_INPUT,
            "the loss diverged %ld times, in the end with %g of RATE in epoch %ld; give a lower "
            "RATE or a smaller CLIP and train again",
            returns, j->now->slow, j->now->epoch + 1);
    rx_log_warning(j->log, "the loss diverged in epoch %ld; it begins again with half the rate",
                   j->now->epoch + 1);
    j->kept->returns = returns;
    j->kept->slow *= 0.5;
    RX_TRY(rx_train_state_copy(j->kept, j->now, err));
    j->has_diverged = 0;
    rx_train_state_load(j->now, j->model);
    rx_learner_load(j->learner);
    return RX_OK;
}

static rx_status train_images(job *j, long n, rx_error *err)
{
    rx_status status = RX_OK;
    while (status == RX_OK && j->now->at < n && !j->has_diverged) {
        status = run_batch(j, n, err);
        show_progress(j, n);
        if (status == RX_OK && j->interrupted)
            status = rx_error_set(err, RX_INTERRUPTED, "interrupted by a signal");
    }
    return status;
}

/* The epoch in `now`, from where it stands to its end, or to where the loss diverges. */
static rx_status run_epoch(job *j, rx_error *err)
{
    rx_train_state *s = j->now;
    const double begun = rx_seconds(), waited = rx_feed_waited(j->feed);
    const long at = s->at;
    rx_pick *order = NULL;
    rx_test_image *images = NULL;
    long n = 0, ntest = 0;
    double validation = 0;
    rx_status status =
        rx_selection_order(&s->selection, (uint64_t)j->config->seed, (uint32_t)s->epoch, &order, &n, err);
    if (status == RX_OK)
        status = rx_feed_epoch(j->feed, (uint32_t)s->epoch, &s->selection, order, n, err);
    if (status == RX_OK)
        status = train_images(j, n, err);
    if (status != RX_OK || j->has_diverged)
        goto exit;
    for (int b = 0; b < s->selection.nbins; b++)
        ntest += s->selection.test[b];
    images = RX_NEW(rx_test_image, (size_t)ntest);
    status = images != NULL ? run_tests(j, n, ntest, images, err)
                            : rx_error_memory(err, (size_t)ntest * sizeof *images);
    if (status == RX_OK)
        status = validate(j, &validation, err);
    if (status == RX_OK)
        status = conclude(j, images, validation, err);
    if (status == RX_OK)
        status = save(j, err);
    if (status == RX_OK) {
        tell_epoch(j, rx_seconds() - begun, rx_feed_waited(j->feed) - waited, n - at + ntest);
        tell_costs(j);
    }
exit:
    free(order);
    free(images);
    return status;
}

/* --- the whole --- */

/* What an interrupted epoch has done is kept, too. */
static rx_status keep_interrupted(job *j, rx_error *err)
{
    rx_error trouble = rx_error_part(err);
    if (j->rank != 0)
        return RX_INTERRUPTED;
    const rx_status status = rx_train_output_within(&j->output, j->kept, j->now, &trouble);
    if (status != RX_OK) {
        rx_error_take(err, &trouble);
        return status;
    }
    return rx_error_at(err, RX_INTERRUPTED, j->config->checkpoint_name, -1, 0,
                       "interrupted by a signal in epoch %ld, after %ld training images of it; the same "
                       "command goes on from there",
                       j->now->epoch + 1, j->now->at);
}

static rx_status train(job *j, rx_error *err)
{
    j->begun = rx_seconds();
    j->begun_at = progress_of(j, 0);
    rx_log_progress_begin(j->log);
    rx_status status = is_over(j) ? RX_OK : draw_validation(j, err);
    while (status == RX_OK && !is_over(j)) {
        status = run_epoch(j, err);
        if (status == RX_OK && j->has_diverged)
            status = go_back(j, err);
    }
    rx_log_progress_end(j->log);
    if (status == RX_INTERRUPTED)
        return keep_interrupted(j, err);
    if (status != RX_OK)
        return status;
    rx_log_info(
        j->log,
        "%s after %ld epoch%s and %ld training images: epoch %ld is the best, validation loss %.4g, in "
        "%s",
        j->kept->epoch >= j->config->epochs ? "complete" : "no improvement, stopped", j->kept->epoch,
        j->kept->epoch == 1 ? "" : "s", j->kept->patches, j->kept->best_epoch, j->kept->best,
        j->config->model_name);
    return RX_OK;
}

static rx_status make_buffers(job *j, rx_error *err)
{
    j->most = (j->config->batch + j->nranks - 1) / j->nranks;
    j->sample = RX_NEW(rx_sample *, (size_t)j->most);
    j->values = RX_NEW(rx_step_values, (size_t)j->most);
    if (j->sample == NULL || j->values == NULL)
        return rx_error_memory(err, 0);
    for (int k = 0; k < RX_MODEL_NETS; k++) {
        if (j->now->adam[k] == NULL)
            continue;
        j->gradient[k] = RX_NEW(float, (size_t)j->now->adam[k]->n);
        if (j->gradient[k] == NULL)
            return rx_error_memory(err, (size_t)j->now->adam[k]->n * sizeof(float));
    }
    return RX_OK;
}

/* The state to begin with: that of the checkpoint, or a fresh one. */
static rx_status find_state(job *j, rx_error *err)
{
    int found = 0, within = 0;
    rx_status status = rx_checkpoint_read(j->config->checkpoint_name, j->output.settings, j->kept, j->now,
                                          &found, &within, err);
    if (status != RX_OK || !found)
        return status;
    if (within)
        rx_log_info(j->log, "%s: goes on in epoch %ld, after %ld training images of it",
                    j->config->checkpoint_name, j->now->epoch + 1, j->now->at);
    else
        rx_log_info(j->log, "%s: goes on after epoch %ld of %d", j->config->checkpoint_name, j->now->epoch,
                    j->config->epochs);
    rx_train_state_load(j->now, j->model);
    return RX_OK;
}

/* What restores. */
static void tell_size(const job *j, int nthreads)
{
    const rx_net *first = j->model->restore, *second = j->model->second;
    rx_log_detail(j->log, "%ld parameters, %.1f kMAC per pixel, %d threads",
                  first->nparams + (second != NULL ? second->nparams : 0),
                  1e-3 * (rx_net_macs(first) + (second != NULL ? rx_net_macs(second) : 0)), nthreads);
}

static rx_status prepare(job *j, rx_error *err)
{
    const rx_step_params par = rx_setup_step(j->config);
    const int nthreads = rx_threads_had(j->config->nthreads, j->log);
    rx_status status = rx_setup_model(j->config, &j->model, err);
    if (status == RX_OK)
        status = rx_train_output_open(j->config, &j->output, err);
    if (status == RX_OK)
        status = rx_train_state_new(j->model, &j->feed_par.grid, &j->kept, err);
    if (status == RX_OK)
        status = rx_train_state_new(j->model, &j->feed_par.grid, &j->now, err);
    if (status == RX_OK)
        status = find_state(j, err);
    if (status == RX_OK)
        status = make_buffers(j, err);
    if (status == RX_OK)
        status = rx_learner_new(j->model, &par, j->config->patch, j->most, nthreads, &j->learner, err);
    if (status == RX_OK)
        tell_size(j, nthreads);
    return status;
}

static void clean_up(job *j)
{
    rx_feed_free(j->feed);
    rx_learner_free(j->learner);
    rx_train_state_free(j->kept);
    rx_train_state_free(j->now);
    rx_model_free(j->model);
    rx_train_output_close(&j->output);
    for (int k = 0; k < RX_MODEL_NETS; k++)
        free(j->gradient[k]);
    for (int i = 0; i < j->nvalidation; i++)
        rx_sample_free(j->validation[i]);
    free(j->validation);
    free(j->sample);
    free(j->values);
}

/* The life of a rank that trains. */
static rx_status run_trainer(job *j, rx_error *err)
{
    rx_error own = rx_error_part(err);
    rx_status status = prepare(j, &own);
    if (status == RX_OK && is_over(j)) {
        status = save(j, &own); /* what a kill between two files may have kept from being written */
    } else if (status == RX_OK) {
        status = rx_feed_new(&j->feed_par, j->ranks, &j->feed, &own);
    }
    if (status == RX_OK)
        status = train(j, &own);
    if (status != RX_OK && status != RX_INTERRUPTED)
        rx_ranks_fail(j->ranks, &own);
    rx_error_take(err, &own);
    clean_up(j);
    return status;
}

rx_status rx_train_run(const rx_train_config *config, rx_log *log, rx_error *err)
{
    job *j = RX_NEW(job, 1);
    rx_selection *grid = RX_NEW(rx_selection, 1);
    rx_status status = j == NULL || grid == NULL ? rx_error_memory(err, sizeof *j + sizeof *grid)
                                                 : rx_setup_selection(config, grid, err);
    if (status == RX_OK) {
        j->config = config;
        j->feed_par = rx_setup_feed(config, grid);
        status =
            rx_ranks_start(config->train_ranks, config->generators, generate, &j->feed_par, &j->ranks, err);
    }
    if (status == RX_OK) {
        j->rank = rx_ranks_rank(j->ranks);
        j->nranks = rx_ranks_trainers(j->ranks);
        j->log = j->rank == 0 ? log : NULL;
        status =
            j->rank >= j->nranks ? rx_feed_generate(&j->feed_par, j->ranks, NULL, err) : run_trainer(j, err);
        rx_ranks_stop(j->ranks);
    }
    free(grid);
    free(j);
    return status;
}

rx_status rx_train_describe(const char *path, rx_text *dst, rx_error *err)
{
    rx_model *model = NULL;
    rx_status status = rx_model_read(path, &model, err);
    if (status == RX_OK)
        rx_model_describe(model, dst);
    rx_model_free(model);
    return status;
}
