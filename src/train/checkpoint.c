/* Checkpoints. */
#include "train/checkpoint.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/hash.h"
#include "base/input.h"
#include "base/memory.h"

static const char MAGIC[] = "rextract-train checkpoint 4\n";
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

static void selection_items(stream *s, rx_selection *x)
{
    const size_t n = (size_t)x->nbins;
    same(s, x->nbins);
    item(s, x->loss, n * sizeof *x->loss);
    item(s, x->list, n * sizeof *x->list);
    item(s, x->train, n * sizeof *x->train);
    item(s, x->test, n * sizeof *x->test);
}

static rx_status history_items(stream *s, rx_history *x, rx_error *err)
{
    const rx_epoch epoch = {0};
    rx_status status = RX_OK;
    long n = x->n;
    ITEM(s, n);
    if (!s->writing) {
        rx_epoch_bin *bins = RX_NEW(rx_epoch_bin, (size_t)x->nbins);
        const size_t bytes = sizeof *x->epoch + (size_t)x->nbins * sizeof *x->bin; /* of an epoch */
        s->failed |= n < 0 || n > s->left / (long)bytes;
        x->n = 0;
        if (bins == NULL)
            status = rx_error_memory(err, (size_t)x->nbins * sizeof *bins);
        while (status == RX_OK && !s->failed && x->n < n)
            status = rx_history_add(x, &epoch, bins, err);
        free(bins);
    }
    if (status == RX_OK && n > 0 && !s->failed) {
        item(s, x->epoch, (size_t)n * sizeof *x->epoch);
        item(s, x->bin, (size_t)n * (size_t)x->nbins * sizeof *x->bin);
    }
    return status;
}

static rx_status state_items(stream *s, rx_train_state *x, rx_error *err)
{
    for (int k = 0; k < RX_MODEL_NETS; k++) {
        same(s, x->adam[k] != NULL ? x->adam[k]->n : 0);
        if (x->adam[k] == NULL)
            continue;
        const size_t bytes = (size_t)x->adam[k]->n * sizeof(float);
        ITEM(s, x->adam[k]->steps);
        item(s, x->params[k], bytes);
        item(s, x->best_params[k], bytes);
        item(s, x->adam[k]->mean, bytes);
        item(s, x->adam[k]->square, bytes);
    }
    ITEM(s, x->epoch);
    ITEM(s, x->at);
    ITEM(s, x->patches);
    selection_items(s, &x->selection);
    ITEM(s, x->best);
    ITEM(s, x->best_epoch);
    ITEM(s, x->slow);
    ITEM(s, x->returns);
    ITEM(s, x->usual);
    ITEM(s, x->usual_n);
    ITEM(s, x->high);
    ITEM(s, x->sum);
    ITEM(s, x->norm);
    ITEM(s, x->rate);
    ITEM(s, x->batches);
    return history_items(s, &x->history, err);
}

rx_status rx_checkpoint_write(const char *path, const char *shown, const char *settings,
                              const rx_train_state *kept, const rx_train_state *now, rx_error *err)
{
    stream s = {.file = fopen(path, "wb"), .writing = 1};
    char magic[sizeof MAGIC], digest[RX_HASH_TEXT];
    long length = (long)strlen(settings);
    int follows = now != NULL;
    char *text = rx_strdup(settings);
    rx_status status = text != NULL ? RX_OK : rx_error_memory(err, strlen(settings));
    if (s.file == NULL) {
        free(text);
        return rx_error_at(err, RX_SYSTEM, shown, -1, 0, "cannot be written: %s", strerror(errno));
    }
    memcpy(magic, MAGIC, sizeof MAGIC);
    rx_hash_begin(&s.sum);
    item(&s, magic, sizeof MAGIC - 1);
    ITEM(&s, length);
    if (status == RX_OK) {
        item(&s, text, (size_t)length);
        /* only read: the direction is that of the stream */
        status = state_items(&s, (rx_train_state *)kept, err);
    }
    ITEM(&s, follows);
    if (status == RX_OK && follows)
        status = state_items(&s, (rx_train_state *)now, err);
    rx_hash_text(&s.sum, digest);
    item(&s, digest, RX_HASH_TEXT - 1);
    if (fclose(s.file) != 0)
        s.failed = 1;
    free(text);
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
    char magic[sizeof MAGIC] = "";
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
    char *text = RX_NEW(char, (size_t)length + 1);
    if (text == NULL)
        return rx_error_memory(err, (size_t)length);
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
