/* Outputs appear whole or not at all. */
#include "io/output.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/names.h"
#include "base/reserve.h"
#include "base/text.h"
#include "io/claim.h"

/* A folder that holds this file was made by us and may be replaced by the next run. */
static const char MARKER[] = ".rextract";

typedef enum output_kind { OUTPUT_FILE, OUTPUT_FOLDER, OUTPUT_DEVICE } output_kind;

typedef struct output {
    output_kind kind;
    char *path;      /* where it goes, symbolic links followed */
    char *shown;     /* as the user wrote it */
    char *stem;      /* of the names of temporary and lock: beside the path, hidden */
    char *temporary; /* where it is written */
    char *lock;      /* what says that it is ours */
    dev_t device;    /* with folder and name: a.fits and ./a.fits are one file */
    ino_t folder;
    int claim; /* descriptor that holds the lock, -1 none */
    int done;  /* renamed */
} output;

struct rx_outputs {
    output *list;
    size_t n;
};

rx_status rx_outputs_new(rx_outputs **dst, rx_error *err)
{
    *dst = RX_NEW(rx_outputs, 1);
    return *dst != NULL ? RX_OK : rx_error_memory(err, sizeof **dst);
}

static char *format(const char *a, const char *b, const char *c)
{
    size_t size = strlen(a) + strlen(b) + strlen(c) + 64;
    char *text = malloc(size);
    if (text != NULL)
        snprintf(text, size, "%s%s%s", a, b, c);
    return text;
}

/* Folder part of a path, with the slash ("" for none), and the name after it. */
static char *folder_of(const char *path, const char **name)
{
    const char *slash = strrchr(path, '/');
    size_t n = slash != NULL ? (size_t)(slash - path) + 1 : 0;
    char *folder = malloc(n + 1);
    if (folder != NULL) {
        memcpy(folder, path, n);
        folder[n] = '\0';
    }
    *name = path + n;
    return folder;
}

/* Asks for no memory of its own, which may be what is missing, and follows no link, even one that is put
 * there now. */
static void remove_at(int folder, const char *name)
{
    if (unlinkat(folder, name, 0) == 0 || (errno != EISDIR && errno != EPERM))
        return;
    /* more than once where the gnuplot of a killed process still writes in there */
    for (int tries = 0, left = 1; left && tries < 5; tries++) {
        const int inner = openat(folder, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        DIR *dir = inner >= 0 ? fdopendir(inner) : NULL;
        if (dir == NULL && inner >= 0)
            close(inner);
        for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;)
            if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
                remove_at(inner, entry->d_name);
        if (dir != NULL)
            closedir(dir);
        left = unlinkat(folder, name, AT_REMOVEDIR) != 0 && errno == ENOTEMPTY;
    }
}

void rx_output_remove(const char *path)
{
    remove_at(AT_FDCWD, path);
}

static int is_replaceable_folder(const char *path)
{
    int replaceable = 1;
    DIR *dir = opendir(path);
    if (dir == NULL)
        return 0;
    for (struct dirent *entry; (entry = readdir(dir)) != NULL;) {
        if (strcmp(entry->d_name, MARKER) == 0) {
            replaceable = 1;
            break;
        }
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
            replaceable = 0;
    }
    closedir(dir);
    return replaceable;
}

/* What is at the target already decides the kind; errors for what cannot be replaced. */
static rx_status inspect(output *out, int want_folder, rx_error *err)
{
    struct stat info;
    out->kind = want_folder ? OUTPUT_FOLDER : OUTPUT_FILE;
    if (stat(out->shown, &info) != 0)
        return RX_OK;
    if (want_folder && !S_ISDIR(info.st_mode))
        return rx_error_at(err, RX_USAGE, out->shown, -1, 0,
                           "is a file, a folder is written; give another name");
    if (!want_folder && S_ISDIR(info.st_mode))
        return rx_error_at(err, RX_USAGE, out->shown, -1, 0,
                           "is a folder, a file is written; give a file name");
    if (want_folder && !is_replaceable_folder(out->shown))
        return rx_error_at(err, RX_USAGE, out->shown, -1, 0,
                           "is a folder with other content, which is never replaced; give another name");
    if (!S_ISDIR(info.st_mode) && !S_ISREG(info.st_mode)) {
        out->kind = OUTPUT_DEVICE;
        if (access(out->shown, W_OK) != 0)
            return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: %s", strerror(errno));
    }
    return RX_OK;
}

/* Fill path (links followed, so that a link stays a link) and the stem of the temporary's name beside it. */
static rx_status place(output *out, rx_error *err)
{
    const size_t length = strlen(out->shown);
    out->path = rx_name_real(out->shown);
    if (out->path == NULL)
        return rx_error_memory(err, length);
    const char *name, *scratch = getenv("TMPDIR");
    char *folder = folder_of(out->path, &name);
    if (folder == NULL)
        return rx_error_memory(err, length);
    if (out->kind == OUTPUT_DEVICE) {
        free(folder);
        folder = format(scratch != NULL && scratch[0] != '\0' ? scratch : "/tmp", "/", "");
        if (folder == NULL)
            return rx_error_memory(err, length);
    }
    out->stem = format(folder, ".", name);
    const char *shown = folder[0] != '\0' ? folder : ".";
    struct stat info;
    rx_status status = RX_OK;
    if (out->stem == NULL)
        status = rx_error_memory(err, length);
    else if (strlen(name) + 24 > NAME_MAX)
        status = rx_error_at(err, RX_USAGE, out->shown, -1, 0, "the name is too long; give a shorter one");
    else if (stat(shown, &info) != 0)
        status = rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written, its folder: %s",
                             strerror(errno));
    else if (!S_ISDIR(info.st_mode))
        status =
            rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: '%s' is not a folder", shown);
    if (status == RX_OK) {
        out->device = info.st_dev;
        out->folder = info.st_ino;
    }
    free(folder);
    return status;
}

/* A lock stays, without its holder, while something is left to be swept. */
static void forget(output *out)
{
    struct stat info;
    if (out->claim >= 0 && lstat(out->temporary, &info) == 0)
        close(out->claim);
    else if (out->claim >= 0)
        rx_claim_drop(out->claim, out->lock);
    free(out->path);
    free(out->shown);
    free(out->stem);
    free(out->temporary);
    free(out->lock);
}

/* Take the first free number; another machine, or another run in a container, may have ours. */
static rx_status claim(output *out, rx_error *err)
{
    const long first = (long)getpid(), tries = 1000;
    const size_t size = strlen(out->stem) + 64;
    out->temporary = malloc(size);
    out->lock = malloc(size);
    if (out->temporary == NULL || out->lock == NULL)
        return rx_error_memory(err, size);
    rx_claim_sweep(out->path, out->stem);
    for (long number = first; out->claim < 0 && number < first + tries; number++) {
        snprintf(out->temporary, size, "%s.rx-%ld.tmp", out->stem, number);
        snprintf(out->lock, size, "%s.rx-%ld.lock", out->stem, number);
        out->claim = rx_claim_take(out->lock);
        if (out->claim < 0 && errno != EEXIST)
            break;
    }
    return out->claim >= 0 ? RX_OK
                           : rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be %s: %s",
                                         out->kind == OUTPUT_FOLDER ? "made" : "written", strerror(errno));
}

static int mark(const char *folder)
{
    static const char text[] = "Made by rextract: the next run replaces this folder.\n";
    char *name = format(folder, "/", MARKER);
    FILE *file = name != NULL ? fopen(name, "wb") : NULL;
    int failed = file == NULL || fputs(text, file) == EOF;
    if (file != NULL)
        failed |= fclose(file) != 0;
    free(name);
    return failed ? -1 : 0;
}

/* Claiming it now is the only sure test of whether it can be made. Files are made by their writers. */
static rx_status make_temporary(output *out, rx_error *err)
{
    rx_status status = claim(out, err);
    if (status == RX_OK)
        rx_output_remove(out->temporary); /* whose lock somebody has removed */
    if (status != RX_OK || out->kind != OUTPUT_FOLDER)
        return status;
    if (mkdir(out->temporary, 0777) != 0)
        return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be made: %s", strerror(errno));
    if (mark(out->temporary) != 0) {
        status = rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: %s", strerror(errno));
        rx_output_remove(out->temporary);
    }
    return status;
}

/* The stem's folder may be another than the path's (devices), its name is that of the output. */
static int is_same(const output *a, const output *b)
{
    const char *slash_a = strrchr(a->stem, '/'), *slash_b = strrchr(b->stem, '/');
    return a->device == b->device && a->folder == b->folder &&
           strcmp(slash_a != NULL ? slash_a + 1 : a->stem, slash_b != NULL ? slash_b + 1 : b->stem) == 0;
}

static rx_status reserve(rx_outputs *outputs, const char *path, int folder, const char **temporary,
                         rx_error *err)
{
    if (path == NULL || path[0] == '\0')
        return rx_error_set(err, RX_USAGE, "the name of an output is empty; give one");
    RX_TRY(RX_GROW(outputs->list, outputs->n + 1, err));
    output *out = &outputs->list[outputs->n];
    *out = (output){.shown = rx_strdup(path), .claim = -1};
    rx_status status = out->shown == NULL ? rx_error_memory(err, strlen(path)) : inspect(out, folder, err);
    if (status == RX_OK)
        status = place(out, err);
    for (size_t i = 0; status == RX_OK && i < outputs->n; i++)
        if (is_same(&outputs->list[i], out))
            status =
                rx_error_at(err, RX_USAGE, path, -1, 0, "is asked for twice; give every output its own name");
    if (status == RX_OK)
        status = make_temporary(out, err);
    if (status != RX_OK) {
        forget(out);
        return status;
    }
    outputs->n++;
    *temporary = out->temporary;
    return RX_OK;
}

rx_status rx_outputs_file(rx_outputs *outputs, const char *path, const char **temporary, rx_error *err)
{
    return reserve(outputs, path, 0, temporary, err);
}

rx_status rx_outputs_folder(rx_outputs *outputs, const char *path, const char **temporary, rx_error *err)
{
    return reserve(outputs, path, 1, temporary, err);
}

const char *rx_outputs_shown(const rx_outputs *outputs, const char *temporary)
{
    for (size_t i = 0; i < outputs->n; i++)
        if (strcmp(outputs->list[i].temporary, temporary) == 0)
            return outputs->list[i].shown;
    return temporary;
}

/* --- commit --- */

/* To the disk: a full disk may only show now. Folders: their files one by one. */
static int sync_tree(const char *path)
{
    struct stat info;
    if (lstat(path, &info) != 0)
        return -1;
    if (S_ISDIR(info.st_mode)) {
        int failed = 0;
        DIR *dir = opendir(path);
        if (dir == NULL)
            return -1;
        for (struct dirent *entry; failed == 0 && (entry = readdir(dir)) != NULL;) {
            if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
                continue;
            char *inner = format(path, "/", entry->d_name);
            failed = inner == NULL || sync_tree(inner) != 0;
            free(inner);
        }
        closedir(dir);
        return failed ? -1 : 0;
    }
    if (!S_ISREG(info.st_mode))
        return 0;
    int file = open(path, O_RDONLY);
    if (file < 0)
        return -1;
    int failed = fsync(file);
    int reason = errno;
    close(file);
    errno = reason;
    return failed;
}

static int copy_to_device(const output *out)
{
    char buffer[8192];
    FILE *src = fopen(out->temporary, "rb");
    int failed = src == NULL;
    FILE *dst = failed ? NULL : fopen(out->path, "wb");
    failed = dst == NULL;
    for (size_t n; !failed && (n = fread(buffer, 1, sizeof buffer, src)) > 0;)
        failed = fwrite(buffer, 1, n, dst) != n;
    failed = failed || ferror(src);
    int reason = errno;
    if (dst != NULL && fclose(dst) != 0 && !failed) {
        failed = 1;
        reason = errno;
    }
    if (src != NULL)
        fclose(src);
    if (!failed)
        unlink(out->temporary);
    errno = reason;
    return failed ? -1 : 0;
}

/* An older folder steps aside, and comes back when the new one cannot take its place. */
static int step_aside(const output *out)
{
    char *old = format(out->temporary, ".old", "");
    if (old == NULL || rename(out->path, old) != 0) {
        free(old);
        return -1;
    }
    int failed = rename(out->temporary, out->path), reason = errno;
    if (failed != 0 && rename(old, out->path) == 0)
        errno = reason;
    else if (failed == 0)
        rx_output_remove(old);
    free(old);
    return failed;
}

/* Old and new change places at once where the file system can do that (not on NFS). */
static int rename_folder(const output *out)
{
    if (rename(out->temporary, out->path) == 0) /* where there is none, or an empty one */
        return 0;
    if (errno != ENOTEMPTY && errno != EEXIST)
        return -1;
    if (!is_replaceable_folder(out->path)) { /* filled by somebody since it was inspected */
        errno = ENOTEMPTY;
        return -1;
    }
    if (renameat2(AT_FDCWD, out->temporary, AT_FDCWD, out->path, RENAME_EXCHANGE) != 0)
        return step_aside(out);
    rx_output_remove(out->temporary);
    return 0;
}

static int put_in_place(const output *out)
{
    switch (out->kind) {
    case OUTPUT_DEVICE:
        return copy_to_device(out);
    case OUTPUT_FOLDER:
        return rename_folder(out);
    case OUTPUT_FILE:
        break;
    }
    return rename(out->temporary, out->path);
}

rx_status rx_outputs_commit(rx_outputs *outputs, rx_error *err)
{
    /* everything that can fail for want of space comes before the first rename */
    for (size_t i = 0; i < outputs->n; i++) {
        const output *out = &outputs->list[i];
        if (!out->done && sync_tree(out->temporary) != 0)
            return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: %s", strerror(errno));
    }
    if (rx_reserve_is_needed()) /* what was written may be less than it should be */
        return rx_error_memory(err, 0);
    /* devices first: they may refuse bytes (a full disk behind a pipe, /dev/full), names hardly ever */
    for (size_t i = 0; i < 2 * outputs->n; i++) {
        output *out = &outputs->list[i % outputs->n];
        if (out->done || (i < outputs->n) != (out->kind == OUTPUT_DEVICE))
            continue;
        if (put_in_place(out) != 0)
            return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: %s", strerror(errno));
        out->done = 1;
    }
    return RX_OK;
}

void rx_outputs_log(const rx_outputs *outputs, const char *more, rx_log *log)
{
    rx_text names = {0};
    for (size_t i = 0; i < outputs->n; i++)
        if (outputs->list[i].done)
            rx_text_printf(&names, "%s%s", names.length > 0 ? ", " : "", outputs->list[i].shown);
    if (more != NULL)
        rx_text_printf(&names, "%s%s", names.length > 0 ? ", " : "", more);
    if (!names.failed)
        rx_log_written(log, names.length > 0 ? names.data : "");
    rx_text_free(&names);
}

void rx_outputs_free(rx_outputs *outputs)
{
    if (outputs == NULL)
        return;
    for (size_t i = 0; i < outputs->n; i++) {
        if (!outputs->list[i].done)
            rx_output_remove(outputs->list[i].temporary);
        forget(&outputs->list[i]);
    }
    free(outputs->list);
    free(outputs);
}
