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
#include "io/claim.h"

/* A folder that holds this file was made by us and may be replaced by the next run. */
static const char MARKER[] = ".rextract";

typedef enum output_kind { OUTPUT_FILE, OUTPUT_FOLDER, OUTPUT_DEVICE } output_kind;

typedef struct output {
    output_kind kind;
    char *path;      /* where it goes, symbolic links followed */
    char *shown;     /* as the user wrote it */
    char *temporary; /* where it is written */
    dev_t device;    /* with folder and name: a.fits and ./a.fits are one file */
    ino_t folder;
    int claim; /* descriptor that holds a folder's claim, -1 none */
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

void rx_output_remove(const char *path)
{
    struct stat info;
    if (lstat(path, &info) != 0)
        return;
    if (!S_ISDIR(info.st_mode)) {
        unlink(path);
        return;
    }
    DIR *dir = opendir(path);
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        char *inner = format(path, "/", entry->d_name);
        if (inner != NULL)
            rx_output_remove(inner);
        free(inner);
    }
    if (dir != NULL)
        closedir(dir);
    rmdir(path);
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

/* Fill path (links followed, so that a link stays a link) and the temporary name beside it. */
static rx_status place(output *out, rx_error *err)
{
    char *real = realpath(out->shown, NULL);
    size_t length = strlen(out->shown);
    out->path = real != NULL ? real : rx_strdup(out->shown);
    if (out->path == NULL)
        return rx_error_memory(err, length);
    for (length = strlen(out->path); length > 1 && out->path[length - 1] == '/'; length--)
        out->path[length - 1] = '\0';
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
    size_t size = strlen(folder) + strlen(name) + 64;
    out->temporary = malloc(size);
    if (out->temporary != NULL)
        snprintf(out->temporary, size, "%s.%s.rx-%ld.tmp", folder, name, (long)getpid());
    const char *shown = folder[0] != '\0' ? folder : ".";
    struct stat info;
    rx_status status = RX_OK;
    if (out->temporary == NULL)
        status = rx_error_memory(err, size);
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

static void forget(output *out)
{
    free(out->path);
    free(out->shown);
    free(out->temporary);
    if (out->claim >= 0)
        close(out->claim);
}

/* Making the temporary now is the only sure test of whether it can be made. */
static rx_status make_temporary(output *out, rx_error *err)
{
    rx_output_remove(out->temporary); /* left by a killed process of the same number */
    if (out->kind != OUTPUT_FOLDER) {
        int file = open(out->temporary, O_WRONLY | O_CREAT | O_EXCL, 0666);
        if (file < 0)
            return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: %s", strerror(errno));
        close(file);
        unlink(out->temporary);
        return RX_OK;
    }
    rx_claim_sweep(out->path, out->temporary, MARKER);
    if (mkdir(out->temporary, 0777) != 0)
        return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be made: %s", strerror(errno));
    out->claim =
        rx_claim_make(out->temporary, MARKER, "Made by rextract: the next run replaces this folder.\n");
    if (out->claim < 0) {
        rx_status status =
            rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: %s", strerror(errno));
        rx_output_remove(out->temporary);
        return status;
    }
    return RX_OK;
}

static int is_same(const output *a, const output *b)
{
    const char *slash_a = strrchr(a->temporary, '/'), *slash_b = strrchr(b->temporary, '/');
    return a->device == b->device && a->folder == b->folder &&
           strcmp(slash_a != NULL ? slash_a + 1 : a->temporary,
                  slash_b != NULL ? slash_b + 1 : b->temporary) == 0;
}

static rx_status reserve(rx_outputs *outputs, const char *path, int folder, const char **temporary,
                         rx_error *err)
{
    if (path == NULL || path[0] == '\0')
        return rx_error_set(err, RX_USAGE, "the name of an output is empty; give one");
    output *list = rx_regrow(outputs->list, outputs->n + 1, sizeof *list);
    if (list == NULL)
        return rx_error_memory(err, sizeof *list);
    outputs->list = list;
    output *out = &list[outputs->n];
    *out = (output){.shown = rx_strdup(path), .claim = -1};
    rx_status status = out->shown == NULL ? rx_error_memory(err, strlen(path)) : inspect(out, folder, err);
    if (status == RX_OK)
        status = place(out, err);
    for (size_t i = 0; status == RX_OK && i < outputs->n; i++)
        if (is_same(&list[i], out))
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
    char buffer[65536];
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
static int rename_folder(const output *out)
{
    struct stat info;
    if (lstat(out->path, &info) != 0)
        return rename(out->temporary, out->path);
    char *old = format(out->temporary, ".old", "");
    if (old != NULL && !is_replaceable_folder(out->path)) { /* filled by somebody since it was inspected */
        errno = ENOTEMPTY;
        free(old);
        return -1;
    }
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
    for (size_t i = 0; i < outputs->n; i++) {
        output *out = &outputs->list[i];
        if (out->done)
            continue;
        if (put_in_place(out) != 0)
            return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: %s", strerror(errno));
        out->done = 1;
    }
    return RX_OK;
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
