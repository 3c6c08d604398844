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
enum { STEP_NUMBERS = sizeof(rx_step_values) / sizeof(double) };

typedef struct job {
    const rx_train_config *config;
    rx_log *log; /* NULL on all ranks but the first */
    rx_feed_params feed_par;
    rx_feed *feed;
    rx_model *model;
    rx_learner *learner;
    rx_train_output output;
    rx_train_state *kept, *now;     /* at the last end of an epoch, and now */
    float *gradient[RX_MODEL_NETS]; /* NULL: the model has no such network */
    rx_sample **sample;             /* [most]: this rank's share of a batch */
    rx_sample **validation;         /* [nvalidation]: of those images this rank's share, others NULL */
    long nvalidation;
    rx_step_values *values; /* [batch] */
    int most;
    double begun, begun_at; /* seconds; share of the training done then */
    double learning;        /* seconds spent on gradients and improvements */
    long learnt;            /* from so many images, by this rank */
    int has_diverged;
} job;

/* --- a batch --- */

/* This rank's share of positions from .. to - 1 of the epoch: they follow one another. Returns their number, and in
 * *first the first one. */
static int take_samples(job *j, long from, long to, long *first)
{
    int n = 0;
    *first = to;
    for (long at = from; at < to; at++) {
        rx_sample *sample = rx_feed_take(j->feed, at);
        if (sample == NULL)
            continue;
        *first = n == 0 ? at : *first;
        j->sample[n++] = sample;
    }
    return n;
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

/* This rank's gradients of one network onto those of the ranks before. */
typedef struct share_of_net {
    const rx_learner *learner;
    int net, n;
} share_of_net;

static void add_gradients(void *user, float *sum, long n)
{
    const share_of_net *of = user;
    (void)n;
    rx_learner_add(of->learner, of->net, of->n, sum);
}

/* One step of the optimiser, on the next images of an epoch that has n. */
static rx_status run_batch(job *j, long n, rx_error *err)
{
    const long from = j->now->at, to = from + j->config->batch < n ? from + j->config->batch : n;
    const double begun = rx_seconds();
    long first;
    const int mine = take_samples(j, from, to, &first);
    memset(j->values, 0, (size_t)j->config->batch * sizeof *j->values);
    rx_status status = rx_learner_gradients(j->learner, j->sample, mine, j->values + (first - from), err);
    free_samples(j, mine);
    RX_TRY(rx_par_agree(status, err));
    for (int k = 0; k < RX_MODEL_NETS; k++)
        if (j->gradient[k] != NULL)
            RX_TRY(rx_par_fold(j->gradient[k], j->now->adam[k]->n, add_gradients,
                               &(share_of_net){j->learner, k, mine}, err));
    RX_TRY(rx_par_sum((double *)j->values, j->config->batch * STEP_NUMBERS, err));
    rx_step_values sum = {0}, mean = {0};
    for (long i = 0; i < to - from; i++)
        add_values(&sum, &j->values[i], 1);
    add_values(&mean, &sum, 1 / (double)(to - from));
    improve(j, to - from, n, &mean);
    j->learning += rx_seconds() - begun;
    j->learnt += mine;
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
    rx_status status = RX_OK;
    for (long from = 0; from < n && status == RX_OK; from += j->config->batch) {
        const long to = from + j->config->batch < n ? from + j->config->batch : n;
        long at;
        const int mine = take_samples(j, first + from, first + to, &at);
        status = rx_learner_test(j->learner, j->sample, mine, images + (at - first), err);
        free_samples(j, mine);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
    }
    RX_TRY(rx_par_agree(status, err));
    return rx_par_sum((double *)images, n * RX_TEST_NUMBERS, err);
}

/* The validation images, before the first epoch. */
static rx_status draw_validation(job *j, rx_error *err)
{
    rx_selection set = j->feed_par.grid;
    for (int b = 0; b < set.nbins; b++) {
        set.train[b] = 0;
        set.test[b] = j->config->validation_images;
    }
    j->nvalidation = (long)set.nbins * j->config->validation_images;
    rx_status status = RX_MAKE(j->validation, (size_t)j->nvalidation, err);
    RX_TRY(rx_par_agree(status, err));
    RX_TRY(rx_feed_epoch(j->feed, RX_EPOCH_VALIDATION, &set, NULL, 0, 0, err));
    for (long at = 0; at < j->nvalidation; at++)
        j->validation[at] = rx_feed_take(j->feed, at);
    return RX_OK;
}

/* Mean loss of RESTORE over the validation images, those of other ranks included, in their order. */
static rx_status validate(job *j, double *mean, rx_error *err)
{
    const long n = j->nvalidation;
    rx_test_image *images = NULL;
    rx_status status = RX_MAKE(images, (size_t)n, err);
    for (long at = 0, to; at < n && status == RX_OK; at = to) {
        to = at + 1;
        if (j->validation[at] == NULL)
            continue;
        while (to < n && j->validation[to] != NULL)
            to++;
        status = rx_learner_test(j->learner, j->validation + at, (int)(to - at), images + at, err);
    }
    status = rx_par_agree(status, err);
    if (status == RX_OK)
        status = rx_par_sum((double *)images, n * RX_TEST_NUMBERS, err);
    *mean = 0;
    for (long i = 0; i < n && status == RX_OK; i++)
        *mean += images[i].loss / (double)n;
    free(images);
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
    if (status == RX_OK && rx_par_rank() == 0)
        status = rx_train_output_epoch(&j->output, j->model, s, err);
    rx_train_state_load(s, j->model);
    return status;
}

/* "1h05m" or "40 s". */
static void tell_epoch(const job *j, double seconds, double making, long images)
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
    rx_log_detail(j->log, "flux scatter %.2f %%; %.0f %% of the time spent making images", 100 * e->scatter,
                  100 * making / seconds);
}

/* What steps and images have cost so far, on this rank. */
static void tell_costs(const job *j)
{
    long images;
    double seconds;
    rx_feed_made(j->feed, &images, &seconds);
    rx_log_detail(j->log, "steps: %.2f s for %ld images; making images: %.2f s for %ld images", j->learning,
                  j->learnt, seconds, images);
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
    while (j->now->at < n && !j->has_diverged) {
        RX_TRY(run_batch(j, n, err));
        show_progress(j, n);
        RX_TRY(rx_par_agree(rx_interrupt_check(err), err));
    }
    return RX_OK;
}

/* The epoch in `now`, from where it stands to its end, or to where the loss diverges. */
static rx_status run_epoch(job *j, rx_error *err)
{
    rx_train_state *s = j->now;
    const double begun = rx_seconds();
    const long at = s->at;
    rx_pick *order = NULL;
    rx_test_image *images = NULL;
    long n = 0, ntest = 0, made;
    double validation = 0, making_before, making;
    rx_feed_made(j->feed, &made, &making_before);
    rx_status status =
        rx_selection_order(&s->selection, (uint64_t)j->config->seed, (uint32_t)s->epoch, &order, &n, err);
    if (status == RX_OK)
        status = rx_feed_epoch(j->feed, (uint32_t)s->epoch, &s->selection, order, n, s->at, err);
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
        rx_feed_made(j->feed, &made, &making);
        tell_epoch(j, rx_seconds() - begun, making - making_before, n - at + ntest);
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
    if (rx_par_rank() != 0)
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
    j->most = (j->config->batch + rx_par_processes() - 1) / rx_par_processes();
    j->sample = RX_NEW(rx_sample *, (size_t)j->most);
    j->values = RX_NEW(rx_step_values, (size_t)j->config->batch);
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

static rx_status prepare(job *j, int nthreads, rx_error *err)
{
    const rx_step_params par = rx_setup_step(j->config);
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
    for (long i = 0; i < j->nvalidation && j->validation != NULL; i++)
        rx_sample_free(j->validation[i]);
    free(j->validation);
    free(j->sample);
    free(j->values);
}

static rx_status run(job *j, rx_error *err)
{
    const int nthreads = rx_threads_had(j->config->nthreads, j->log);
    RX_TRY(rx_par_agree(prepare(j, nthreads, err), err));
    if (is_over(j))
        return save(j, err); /* what a kill between two files may have kept from being written */
    RX_TRY(rx_par_agree(rx_feed_new(&j->feed_par, nthreads, j->log, &j->feed, err), err));
    return train(j, err);
}

rx_status rx_train_run(const rx_train_config *config, rx_log *log, rx_error *err)
{
    job *j = RX_NEW(job, 1);
    rx_selection *grid = RX_NEW(rx_selection, 1);
    rx_status status = j == NULL || grid == NULL ? rx_error_memory(err, sizeof *j + sizeof *grid)
                                                 : rx_setup_selection(config, grid, err);
    if (status == RX_OK) {
        j->config = config;
        j->log = rx_par_rank() == 0 ? log : NULL;
        j->feed_par = rx_setup_feed(config, grid);
        status = run(j, err);
        clean_up(j);
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
