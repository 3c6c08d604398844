/* The trainer's loop. */
#include "train/trainer.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/threads.h"
#include "io/output.h"
#include "par/ranks.h"
#include "train/setup.h"
#include "train/state.h"
#include "train/train_page.h"

/* Divergence: so many batches in a row above so many times the running mean, known from so many batches. */
enum { HIGH_BATCHES = 3, KNOWN_BATCHES = 5, MOST_RETURNS = 3 };
static const double HIGH = 20, FORGETS = 0.02;
enum { STEP_NUMBERS = sizeof(rx_step_values) / sizeof(double) };

typedef struct job {
    const rx_train_config *config;
    rx_log *log; /* NULL on all ranks but the first */
    rx_selection grid;
    rx_samples *samples;
    rx_model *model;
    rx_learner *learner;
    rx_text settings;           /* of the checkpoint */
    rx_train_state *kept, *now; /* at the last end of an epoch, and now */
    float *gradient;            /* [parameters] */
    rx_sample **sample;         /* [most]: this rank's share of a batch */
    rx_sample **validation;     /* [nvalidation]: of those images this rank's share, others NULL */
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
        rx_sample *sample = rx_samples_take(j->samples, at);
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
        free(j->sample[i]);
}

static void add_values(rx_step_values *sum, const rx_step_values *v, double scale)
{
    double *to = (double *)sum;
    for (int k = 0; k < (int)STEP_NUMBERS; k++)
        to[k] += scale * ((const double *)v)[k];
}

/* Is the loss of a batch what one would expect? Divergence changes nothing in the weights. */
static int diverges(rx_train_state *s, double loss, double norm)
{
    if (!isfinite(loss) || !isfinite(norm))
        return 1;
    const int high = s->loss_n > 0 && loss > HIGH * s->loss;
    if (high && s->loss_n >= KNOWN_BATCHES)
        return ++s->high >= HIGH_BATCHES;
    s->high = 0;
    s->loss_n++;
    loss = high ? HIGH * s->loss : loss; /* one bad batch is not the mean */
    s->loss += fmax(FORGETS, 1 / (double)s->loss_n) * (loss - s->loss);
    return 0;
}

/* Fraction (0..1) of the highest rate at `progress` (0..1) of the training: linear warm-up, then a half
 * cosine down to 0. */
static double schedule(const rx_train_config *config, double progress)
{
    const double warmup = config->warmup;
    if (progress >= 1)
        return 0;
    if (progress < warmup)
        return progress / warmup;
    return 0.5 * (1 + cos(M_PI * (progress - warmup) / (1 - warmup)));
}

/* Clipped gradients into the weights. */
static void improve(job *j, long n, long epoch_images, const rx_step_values *mean)
{
    rx_train_state *s = j->now;
    for (long p = 0; p < s->n; p++)
        j->gradient[p] /= (float)n;
    const double norm = rx_gradient_clip(j->gradient, s->n, j->config->clip);
    j->has_diverged = diverges(s, mean->total, norm);
    if (j->has_diverged)
        return;
    /* the middle of the step */
    const double within = ((double)s->at + 0.5 * (double)n) / (double)epoch_images;
    const double progress = ((double)s->epoch + within) / j->config->epochs;
    s->rate = j->config->rate * s->slow * schedule(j->config, progress);
    rx_train_state_step(s, j->gradient, s->rate);
    add_values(&s->sum, mean, (double)n);
    s->norm += norm;
    s->batches++;
    s->at += n;
    s->patches += n;
    rx_train_weights_load(s->weights, j->model);
    rx_learner_load(j->learner);
}

/* This rank's gradients onto those of the ranks before. */
typedef struct share_of_batch {
    const rx_learner *learner;
    int n;
} share_of_batch;

static void add_gradients(void *user, float *sum, long n)
{
    const share_of_batch *of = user;
    (void)n;
    rx_learner_add(of->learner, of->n, sum);
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
    RX_TRY(rx_par_fold(j->gradient, j->now->n, add_gradients, &(share_of_batch){j->learner, mine}, err));
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
    rx_selection set = j->grid;
    for (int b = 0; b < set.nbins; b++) {
        set.train[b] = 0;
        set.test[b] = j->config->validation_images;
    }
    j->nvalidation = (long)set.nbins * j->config->validation_images;
    rx_status status = RX_MAKE(j->validation, (size_t)j->nvalidation, err);
    RX_TRY(rx_par_agree(status, err));
    RX_TRY(rx_samples_epoch(j->samples, RX_EPOCH_VALIDATION, &set, NULL, 0, 0, err));
    for (long at = 0; at < j->nvalidation; at++)
        j->validation[at] = rx_samples_take(j->samples, at);
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
    rx_epoch epoch = {.steps = (double)s->steps,
                      .patches = (double)s->patches,
                      .rate = s->rate,
                      .validation = validation,
                      .norm = s->norm / (double)s->batches};
    add_values(&epoch.losses, &s->sum, 1 / (double)s->at);
    RX_TRY(rx_history_add(&s->history, images, &s->selection, epoch, err));
    s->epoch++;
    rx_train_state_rank(s, validation);
    s->at = s->batches = 0;
    s->sum = (rx_step_values){0};
    s->norm = 0;
    return rx_train_state_copy(s, j->kept, err);
}

/* The epochs since the best one that began on the way down and below a tenth of the highest rate count for PATIENCE: there
 * little is left to learn, and no improvement is news. */
static int is_over(const job *j)
{
    const double low = 0.1;
    const rx_train_state *s = j->kept;
    const rx_train_config *c = j->config;
    long n = 0;
    for (long e = s->best_epoch; e < s->epoch; e++) {
        const double progress = (double)e / c->epochs;
        n += progress >= c->warmup && schedule(c, progress) < low;
    }
    return s->epoch >= c->epochs || (c->patience > 0 && n >= c->patience);
}

/* --- what is left on the disk, whole or not at all --- */

/* Outputs that cannot be written are reported before the work. */
static rx_status try_outputs(const job *j, rx_error *err)
{
    const rx_train_config *config = j->config;
    rx_outputs *outputs = NULL;
    const char *temporary;
    rx_status status;
    RX_TRY_EXIT(rx_outputs_new(&outputs, err));
    RX_TRY_EXIT(rx_outputs_file(outputs, config->model_name, &temporary, err));
    RX_TRY_EXIT(rx_outputs_file(outputs, config->checkpoint_name, &temporary, err));
    status = rx_outputs_folder(outputs, config->output_name, &temporary, err);
exit:
    rx_outputs_free(outputs);
    return status;
}

/* At the end of an epoch (now NULL): the model, which is that of the best epoch, checkpoint and folder. Within an epoch: the
 * checkpoint alone. */
static rx_status write_outputs(const job *j, const rx_train_state *now, rx_error *err)
{
    const rx_train_config *config = j->config;
    const rx_train_state *s = j->kept;
    const char *model, *checkpoint, *folder;
    rx_outputs *outputs = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_outputs_new(&outputs, err));
    if (now == NULL) {
        RX_TRY_EXIT(rx_outputs_file(outputs, config->model_name, &model, err));
        RX_TRY_EXIT(rx_model_write(j->model, model, config->model_name, err));
    }
    RX_TRY_EXIT(rx_outputs_file(outputs, config->checkpoint_name, &checkpoint, err));
    RX_TRY_EXIT(rx_checkpoint_write(checkpoint, config->checkpoint_name, j->settings.data, s, now, err));
    if (now == NULL) {
        RX_TRY_EXIT(rx_outputs_folder(outputs, config->output_name, &folder, err));
        RX_TRY_EXIT(rx_train_page_write(s, j->model, j->settings.data, config->qa_figures, folder,
                                        config->output_name, err));
    }
    status = rx_outputs_commit(outputs, err);
exit:
    rx_outputs_free(outputs);
    return status;
}

/* At the end of an epoch: the best one as the model, and the state, onto the disk. */
static rx_status save(job *j, rx_error *err)
{
    const rx_train_state *s = j->kept;
    rx_train_weights_load(s->best, j->model);
    j->model->epochs = s->epoch;
    j->model->best = s->best_epoch;
    j->model->ended = is_over(j);
    j->model->patches = s->patches;
    rx_status status = rx_history_dictionary(&s->history, &s->selection, s->best_epoch, j->model, err);
    if (status == RX_OK && rx_par_rank() == 0)
        status = write_outputs(j, NULL, err);
    rx_train_weights_load(s->weights, j->model);
    return status;
}

static void report_epoch(const job *j, double seconds, double making, long images)
{
    const rx_history *h = &j->kept->history;
    const rx_epoch *e = &h->epoch[h->n - 1];
    char left[RX_TIME_LEFT];
    const double done = progress_of(j, 0) - j->begun_at;
    rx_time_left(done > 0 ? (rx_seconds() - j->begun) * (1 - progress_of(j, 0)) / done : 0, left);
    rx_log_info(j->log,
                "epoch %ld of %d: loss %.4g, test %.4g (unrestored %.4g), validation %.4g%s, recall %.3f, "
                "flux bias %+.2f %%; %.0f images/s; %s left",
                h->n, j->config->epochs, e->losses.total, e->test_loss, e->input_loss, e->validation,
                j->kept->best_epoch == h->n ? " (best)" : "", e->recall, 100 * e->bias,
                (double)images / seconds, left);
    rx_log_detail(j->log, "flux scatter %.2f %%; %.0f %% of the time spent making images", 100 * e->scatter,
                  100 * making / seconds);
}

/* Back to the last end of an epoch, with half the rate. */
static rx_status go_back(job *j, rx_error *err)
{
    const long returns = j->kept->returns + 1;
    if (returns > MOST_RETURNS)
        return rx_error_set(err, RX_INPUT,
                            "the loss diverged %ld times, in the end with %g of RATE in epoch %ld; give a "
                            "lower RATE or a smaller CLIP and train again",
                            returns, j->now->slow, j->now->epoch + 1);
    rx_log_warning(j->log, "the loss diverged in epoch %ld; it begins again with half the rate",
                   j->now->epoch + 1);
    j->kept->returns = returns;
    j->kept->slow *= 0.5;
    RX_TRY(rx_train_state_copy(j->kept, j->now, err));
    j->has_diverged = 0;
    rx_train_weights_load(j->now->weights, j->model);
    rx_learner_load(j->learner);
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
    rx_samples_made(j->samples, &made, &making_before);
    rx_status status;
    RX_TRY_EXIT(
        rx_selection_order(&s->selection, (uint64_t)j->config->seed, (uint32_t)s->epoch, &order, &n, err));
    RX_TRY_EXIT(rx_samples_epoch(j->samples, (uint32_t)s->epoch, &s->selection, order, n, s->at, err));
    while (s->at < n && !j->has_diverged) {
        const double left = 1 - j->begun_at;
        char what[96];
        RX_TRY_EXIT(run_batch(j, n, err));
        snprintf(what, sizeof what, "epoch %ld of %d, loss %.4g", s->epoch + 1, j->config->epochs, s->loss);
        rx_log_progress(j->log, what, left > 0 ? (progress_of(j, n) - j->begun_at) / left : 1);
        RX_TRY_EXIT(rx_par_agree(rx_interrupt_check(err), err));
    }
    if (j->has_diverged)
        goto exit;
    for (int b = 0; b < s->selection.nbins; b++)
        ntest += s->selection.test[b];
    RX_TRY_EXIT(RX_MAKE(images, (size_t)ntest, err));
    RX_TRY_EXIT(run_tests(j, n, ntest, images, err));
    RX_TRY_EXIT(validate(j, &validation, err));
    RX_TRY_EXIT(conclude(j, images, validation, err));
    RX_TRY_EXIT(save(j, err));
    rx_samples_made(j->samples, &made, &making);
    report_epoch(j, rx_seconds() - begun, making - making_before, n - at + ntest);
    rx_log_detail(j->log, "steps: %.2f s for %ld images; making images: %.2f s for %ld images", j->learning,
                  j->learnt, making, made); /* so far, on this rank */
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
    const rx_status status = write_outputs(j, j->now, &trouble);
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
        "%s after %ld epoch%s and %ld training images: epoch %ld is the best, validation loss %.4g, in %s",
        j->kept->epoch >= j->config->epochs ? "complete" : "no improvement, stopped", j->kept->epoch,
        j->kept->epoch == 1 ? "" : "s", j->kept->patches, j->kept->best_epoch, j->kept->best_loss,
        j->config->model_name);
    return RX_OK;
}

/* The state to begin with: that of the checkpoint, or a fresh one. */
static rx_status find_state(job *j, rx_error *err)
{
    int found = 0, within = 0;
    RX_TRY(rx_checkpoint_read(j->config->checkpoint_name, j->settings.data, j->kept, j->now, &found, &within,
                              err));
    if (!found)
        return RX_OK;
    if (within)
        rx_log_info(j->log, "%s: goes on in epoch %ld, after %ld training images of it",
                    j->config->checkpoint_name, j->now->epoch + 1, j->now->at);
    else
        rx_log_info(j->log, "%s: goes on after epoch %ld of %d", j->config->checkpoint_name, j->now->epoch,
                    j->config->epochs);
    rx_train_weights_load(j->now->weights, j->model);
    return RX_OK;
}

static rx_status prepare(job *j, int nthreads, rx_error *err)
{
    const rx_train_config *config = j->config;
    const rx_step_params par = rx_setup_step(config);
    RX_TRY(rx_setup_model(config, &j->model, err));
    RX_TRY(rx_setup_text(config, RX_SETUP_ALL, &j->settings, err));
    RX_TRY(try_outputs(j, err));
    RX_TRY(rx_train_state_new(j->model, &j->grid, &j->kept, err));
    RX_TRY(rx_train_state_new(j->model, &j->grid, &j->now, err));
    RX_TRY(find_state(j, err));
    j->most = (config->batch + rx_par_processes() - 1) / rx_par_processes();
    RX_TRY(RX_MAKE(j->sample, (size_t)j->most, err));
    RX_TRY(RX_MAKE(j->values, (size_t)config->batch, err));
    RX_TRY(RX_MAKE(j->gradient, (size_t)j->now->n, err));
    RX_TRY(rx_learner_new(j->model, &par, config->patch, j->most, nthreads, &j->learner, err));
    const rx_net *first = j->model->restore, *second = j->model->second; /* what restores */
    rx_log_detail(j->log, "%ld parameters, %.1f kMAC per pixel, %d threads",
                  first->nparams + (second != NULL ? second->nparams : 0),
                  1e-3 * (rx_net_macs(first) + (second != NULL ? rx_net_macs(second) : 0)), nthreads);
    return RX_OK;
}

rx_status rx_train_run(const rx_train_config *config, rx_log *log, rx_error *err)
{
    const rx_samples_params par = rx_setup_samples(config);
    const int active = strcmp(config->selection, "ACTIVE") == 0;
    rx_status status;
    job *j;
    RX_TRY(RX_MAKE(j, 1, err));
    j->config = config;
    j->log = rx_par_rank() == 0 ? log : NULL;
    const int nthreads = rx_threads_had(config->nthreads, j->log);
    RX_TRY_EXIT(rx_selection_begin(config->grid.v, config->fwhm_range.v, config->sigma_range.v,
                                   config->bin_images, active, &j->grid, err));
    RX_TRY_EXIT(rx_par_agree(prepare(j, nthreads, err), err));
    if (is_over(j)) {
        status = save(j, err); /* what a kill between two files may have kept from being written */
        goto exit;
    }
    RX_TRY_EXIT(
        rx_par_agree(rx_samples_new(&par, &j->grid, config->sim, nthreads, j->log, &j->samples, err), err));
    status = train(j, err);
exit:
    rx_samples_free(j->samples);
    rx_learner_free(j->learner);
    rx_train_state_free(j->kept);
    rx_train_state_free(j->now);
    rx_model_free(j->model);
    rx_text_free(&j->settings);
    for (long i = 0; i < j->nvalidation && j->validation != NULL; i++)
        free(j->validation[i]);
    free(j->validation);
    free(j->gradient);
    free(j->sample);
    free(j->values);
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
