/* The state of a training: made, improved, copied, and as a checkpoint. */
#include "train/state.h"

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/hash.h"
#include "base/input.h"
#include "base/memory.h"
#include "num/stats.h"

/* --- epochs kept: means and medians over their test images --- */

void rx_history_free(rx_history *history)
{
    free(history->epoch);
    free(history->bin);
    *history = (rx_history){.nbins = history->nbins};
}

rx_status rx_history_resize(rx_history *history, long n, rx_error *err)
{
    RX_TRY(RX_GROW(history->epoch, (size_t)n, err));
    RX_TRY(RX_GROW(history->bin, (size_t)n * (size_t)history->nbins, err));
    history->n = n;
    return RX_OK;
}

/* Sums over some test images. */
typedef struct tally {
    double loss, input, stars, found;
    long images;
    double *errors; /* of fluxes */
    size_t nerrors;
} tally;

static void add(tally *t, const rx_test_image *image)
{
    t->loss += image->loss;
    t->input += image->input;
    t->stars += image->check.stars;
    t->found += image->check.found;
    t->images++;
    for (int i = 0; i < (int)image->check.ratios; i++)
        t->errors[t->nerrors++] = image->check.error[i];
}

/* Recall, bias and scatter; reorders errors. */
static void conclude(tally *t, double *recall, double *bias, double *scatter)
{
    *recall = t->stars > 0 ? t->found / t->stars : NAN;
    *bias = NAN;
    *scatter = rx_sigma_mad(t->errors, t->nerrors, bias);
    if (t->nerrors == 0)
        *bias = NAN;
}

rx_status rx_history_add(rx_history *history, const rx_test_image *images, rx_selection *selection,
                         rx_epoch epoch, rx_error *err)
{
    double sum[RX_BINS_MAX] = {0}, loss = 0, input = 0, *errors = NULL;
    long count[RX_BINS_MAX] = {0}, all = 0, at = 0;
    for (int b = 0; b < selection->nbins; b++)
        all += selection->test[b];
    const size_t most = (size_t)all * RX_SAMPLE_STARS;
    RX_TRY(rx_history_resize(history, history->n + 1, err));
    rx_epoch_bin *bins = history->bin + (history->n - 1) * history->nbins;
    rx_status status = RX_MAKE(errors, 2 * most, err);
    if (status != RX_OK) {
        history->n--;
        return status;
    }
    tally total = {.errors = errors};
    for (int b = 0; b < selection->nbins; b++) {
        rx_epoch_bin *bin = &bins[b];
        tally one = {.errors = errors + most};
        for (int i = 0; i < selection->test[b]; i++, at++) {
            add(&one, &images[at]);
            add(&total, &images[at]);
        }
        sum[b] = one.loss;
        count[b] = one.images;
        *bin = (rx_epoch_bin){
            .loss = one.loss / (double)one.images, .train = selection->train[b], .test = selection->test[b]};
        conclude(&one, &bin->recall, &bin->bias, &bin->scatter);
        loss += bin->loss;
        input += one.input / (double)one.images;
    }
    rx_selection_update(selection, sum, count);
    for (int b = 0; b < selection->nbins; b++)
        bins[b].list = selection->list[b];
    epoch.test_loss = loss / selection->nbins;
    epoch.input_loss = input / selection->nbins;
    conclude(&total, &epoch.recall, &epoch.bias, &epoch.scatter);
    history->epoch[history->n - 1] = epoch;
    free(errors);
    return RX_OK;
}

rx_status rx_history_dictionary(const rx_history *history, const rx_selection *grid, long epoch,
                                rx_model *model, rx_error *err)
{
    const rx_epoch_bin *bins = history->bin + (epoch - 1) * history->nbins;
    if (model->bins == NULL)
        RX_TRY(RX_MAKE(model->bins, (size_t)grid->nbins, err));
    model->nfwhm = grid->nfwhm;
    model->nsigma = grid->nsigma;
    for (int b = 0; b < grid->nbins; b++) {
        rx_model_bin *dst = &model->bins[b];
        *dst = (rx_model_bin){.loss = bins[b].loss,
                              .list = bins[b].list,
                              .recall = bins[b].recall,
                              .bias = bins[b].bias,
                              .scatter = bins[b].scatter,
                              .images = (long)bins[b].test};
        rx_selection_bin(grid, b, dst->fwhm, dst->sigma);
    }
    return RX_OK;
}

/* --- the state --- */

enum { NUMBERS = offsetof(rx_train_state, steps) };

rx_status rx_train_state_new(const rx_model *model, const rx_selection *selection, rx_train_state **dst,
                             rx_error *err)
{
    rx_net *nets[RX_MODEL_NETS];
    rx_train_state *s;
    RX_TRY(RX_MAKE(s, 1, err));
    s->n = rx_model_params(model);
    const rx_status status = RX_MAKE(s->weights, 4 * (size_t)s->n, err);
    if (status != RX_OK) {
        free(s);
        return status;
    }
    s->bytes = 4 * (size_t)s->n * sizeof *s->weights;
    s->best = s->weights + s->n;
    s->mean = s->best + s->n;
    s->square = s->mean + s->n;
    s->selection = *selection;
    s->history.nbins = selection->nbins;
    s->best_loss = INFINITY;
    s->slow = 1;
    rx_model_nets(model, nets);
    float *to = s->weights;
    for (int k = 0; k < RX_MODEL_NETS; to += nets[k] != NULL ? nets[k]->nparams : 0, k++)
        if (nets[k] != NULL)
            memcpy(to, nets[k]->params, (size_t)nets[k]->nparams * sizeof *to);
    *dst = s;
    return RX_OK;
}

void rx_train_weights_load(const float *weights, rx_model *model)
{
    rx_net *nets[RX_MODEL_NETS];
    rx_model_nets(model, nets);
    for (int k = 0; k < RX_MODEL_NETS; weights += nets[k] != NULL ? nets[k]->nparams : 0, k++)
        if (nets[k] != NULL)
            memcpy(nets[k]->params, weights, (size_t)nets[k]->nparams * sizeof *weights);
}

void rx_train_state_free(rx_train_state *state)
{
    if (state == NULL)
        return;
    free(state->weights);
    rx_history_free(&state->history);
    free(state);
}

rx_status rx_train_state_copy(const rx_train_state *src, rx_train_state *dst, rx_error *err)
{
    const rx_history *h = &src->history;
    RX_TRY(rx_history_resize(&dst->history, h->n, err));
    memcpy((char *)dst + NUMBERS, (const char *)src + NUMBERS, sizeof *src - NUMBERS);
    dst->selection = src->selection;
    memcpy(dst->weights, src->weights, src->bytes);
    if (h->n > 0) {
        memcpy(dst->history.epoch, h->epoch, (size_t)h->n * sizeof *h->epoch);
        memcpy(dst->history.bin, h->bin, (size_t)h->n * (size_t)h->nbins * sizeof *h->bin);
    }
    return RX_OK;
}

void rx_train_state_step(rx_train_state *s, const float *gradient, double rate)
{
    const double b1 = 0.9, b2 = 0.99, epsilon = 1e-8;
    s->steps++;
    const double unbias1 = 1 / (1 - pow(b1, (double)s->steps)), unbias2 = 1 / (1 - pow(b2, (double)s->steps));
    for (long i = 0; i < s->n; i++) {
        const double g = gradient[i];
        const double mean = b1 * s->mean[i] + (1 - b1) * g;
        const double square = b2 * s->square[i] + (1 - b2) * g * g;
        s->mean[i] = (float)mean;
        s->square[i] = (float)square;
        s->weights[i] -= (float)(rate * unbias1 * mean / (sqrt(unbias2 * square) + epsilon));
    }
}

void rx_train_state_rank(rx_train_state *state, double validation)
{
    if (state->best_epoch > 0 && !(validation < state->best_loss))
        return;
    state->best_loss = isnan(validation) ? INFINITY : validation;
    state->best_epoch = state->epoch;
    memcpy(state->best, state->weights, (size_t)state->n * sizeof *state->best);
}

/* --- checkpoints --- */

static const char MAGIC[] = "rextract-train checkpoint 5\n";
enum { MOST_SETTINGS = 1 << 20 };

/* One way through the file for both directions, so that what is read is what was written. */
typedef struct stream {
    FILE *file;
    int writing;
    int failed; /* cannot be written, or ends early, or a size that cannot be */
    long left;  /* bytes of the file that are not read yet */
    rx_hash sum;
} stream;

static void item(stream *s, void *data, size_t size)
{
    if (s->failed || size == 0)
        return;
    const size_t done = s->writing ? fwrite(data, 1, size, s->file) : fread(data, 1, size, s->file);
    s->failed = done != size;
    s->left -= (long)done;
    rx_hash_add(&s->sum, data, done);
}

#define ITEM(s, field) item(s, &(field), sizeof(field))

/* A size that must be what it is. */
static void same(stream *s, long value)
{
    long found = value;
    ITEM(s, found);
    s->failed |= found != value;
}

static rx_status history_items(stream *s, rx_history *x, rx_error *err)
{
    const long bytes = (long)(sizeof *x->epoch + (size_t)x->nbins * sizeof *x->bin); /* of an epoch */
    long n = x->n;
    ITEM(s, n);
    s->failed |= !s->writing && (n < 0 || n > s->left / bytes);
    if (s->failed || n == 0)
        return RX_OK;
    if (!s->writing)
        RX_TRY(rx_history_resize(x, n, err));
    item(s, x->epoch, (size_t)n * sizeof *x->epoch);
    item(s, x->bin, (size_t)n * (size_t)x->nbins * sizeof *x->bin);
    return RX_OK;
}

static rx_status state_items(stream *s, rx_train_state *x, rx_error *err)
{
    rx_selection *grid = &x->selection;
    const size_t bins = (size_t)grid->nbins;
    same(s, x->n);
    same(s, grid->nbins);
    item(s, x->weights, x->bytes);
    item(s, (char *)x + NUMBERS, sizeof *x - NUMBERS);
    item(s, grid->loss, bins * sizeof *grid->loss);
    item(s, grid->list, bins * sizeof *grid->list);
    item(s, grid->train, bins * sizeof *grid->train);
    item(s, grid->test, bins * sizeof *grid->test);
    return history_items(s, &x->history, err);
}

rx_status rx_checkpoint_write(const char *path, const char *shown, const char *settings,
                              const rx_train_state *kept, const rx_train_state *now, rx_error *err)
{
    stream s = {.file = fopen(path, "wb"), .writing = 1};
    char magic[sizeof MAGIC], digest[RX_HASH_TEXT];
    long length = (long)strlen(settings);
    int follows = now != NULL;
    if (s.file == NULL)
        return rx_error_at(err, RX_SYSTEM, shown, -1, 0, "cannot be written: %s", strerror(errno));
    memcpy(magic, MAGIC, sizeof MAGIC);
    rx_hash_begin(&s.sum);
    /* what is written is only read: the direction is that of the stream */
    item(&s, magic, sizeof MAGIC - 1);
    ITEM(&s, length);
    item(&s, (char *)(size_t)settings, (size_t)length);
    rx_status status = state_items(&s, (rx_train_state *)kept, err);
    ITEM(&s, follows);
    if (status == RX_OK && follows)
        status = state_items(&s, (rx_train_state *)now, err);
    rx_hash_text(&s.sum, digest);
    item(&s, digest, RX_HASH_TEXT - 1);
    s.failed |= fclose(s.file) != 0;
    if (status == RX_OK && s.failed)
        status = rx_error_at(err, RX_SYSTEM, shown, -1, 0, "cannot be written; is the disk full?");
    return status;
}

/* The first line in which two texts of settings differ, as an error. */
static rx_status other_settings(const char *path, const char *old, const char *ours, rx_error *err)
{
    while (*old != '\0' && *ours != '\0') {
        const size_t n = strcspn(old, "\n"), m = strcspn(ours, "\n");
        if (n != m || memcmp(old, ours, n) != 0)
            break;
        old += n + (old[n] == '\n');
        ours += m + (ours[m] == '\n');
    }
    return rx_error_at(
        err, RX_USAGE, path, -1, 0,
        "is of a training with %.*s, now it is %.*s; give another CHECKPOINT_NAME, or remove it",
        (int)(strcspn(old, "\n") < 200 ? strcspn(old, "\n") : 200), old,
        (int)(strcspn(ours, "\n") < 200 ? strcspn(ours, "\n") : 200), ours);
}

/* Magic and settings. */
static rx_status read_head(stream *s, const char *path, const char *settings, rx_error *err)
{
    char magic[sizeof MAGIC] = "", *text;
    long length = 0;
    rx_status status = RX_OK;
    item(s, magic, sizeof MAGIC - 1);
    if (s->failed || memcmp(magic, MAGIC, sizeof MAGIC) != 0)
        return rx_error_at(err, RX_USAGE, path, -1, 0,
                           "is no checkpoint of this version of rextract-train; give another "
                           "CHECKPOINT_NAME, or remove it");
    ITEM(s, length);
    if (s->failed || length < 0 || length > MOST_SETTINGS) {
        s->failed = 1;
        return RX_OK;
    }
    RX_TRY(RX_MAKE(text, (size_t)length + 1, err));
    item(s, text, (size_t)length);
    if (!s->failed && strcmp(text, settings) != 0)
        status = other_settings(path, text, settings, err);
    free(text);
    return status;
}

rx_status rx_checkpoint_read(const char *path, const char *settings, rx_train_state *kept,
                             rx_train_state *now, int *found, int *within, rx_error *err)
{
    stream s = {.file = rx_input_open(path)};
    int follows = 0;
    struct stat about;
    char digest[RX_HASH_TEXT], written[RX_HASH_TEXT] = "";
    *found = s.file != NULL;
    *within = 0;
    if (s.file == NULL && errno == ENOENT)
        return RX_OK;
    if (s.file == NULL)
        return rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be read: %s", strerror(errno));
    rx_hash_begin(&s.sum);
    if (fstat(fileno(s.file), &about) == 0)
        s.left = (long)about.st_size;
    rx_status status = read_head(&s, path, settings, err);
    if (status == RX_OK)
        status = state_items(&s, kept, err);
    ITEM(&s, follows);
    if (status == RX_OK)
        status = follows ? state_items(&s, now, err) : rx_train_state_copy(kept, now, err);
    rx_hash_text(&s.sum, digest);
    item(&s, written, RX_HASH_TEXT - 1);
    if (status == RX_OK && (s.failed || strcmp(written, digest) != 0 || fgetc(s.file) != EOF))
        status = rx_error_at(err, RX_INPUT, path, -1, 0,
                             "is damaged; restore it from a copy, or remove it and train from the beginning");
    *within = follows;
    fclose(s.file);
    return status;
}
