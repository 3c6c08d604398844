/* Outputs appear whole or not at all. */
#include "io/output.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <limits.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/hash.h"
#include "base/interrupt.h"
#include "base/memory.h"
#include "base/names.h"
#include "base/text.h"
#include "io/folders.h"

/* Behind the last slash. */
static const char *name_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash != NULL ? slash + 1 : path;
}

static int is_there(const char *path)
{
    struct stat info;
    return lstat(path, &info) == 0;
}

RX_PRINTF(1, 2) static char *format(const char *how, ...)
{
    va_list args, again;
    va_start(args, how);
    va_copy(again, args);
    const int n = vsnprintf(NULL, 0, how, args);
    char *made = n < 0 ? NULL : rx_regrow(NULL, (size_t)n + 1, 1);
    if (made != NULL)
        vsnprintf(made, (size_t)n + 1, how, again);
    va_end(again);
    va_end(args);
    return made;
}

/* --- locks ---
 *
 * An output is written in the folder ".NAME.rx-NUMBER.tmp" beside its place, and as long as the process that writes it lives,
 * that process holds a lock (flock) on the empty file ".NAME.rx-NUMBER.lock": what a killed one has left can be distinguished
 * from the work of another process, and removed. The kernel drops the lock with the process, so that neither process numbers
 * nor names of machines have to be trusted. Where the file system has no locks, no process gets one, and nothing is ever
 * removed; where locks do not reach other machines (NFS with local_lock), two machines must not write the same output at
 * once. */
static const char LOCK[] = ".lock", TEMP[] = ".tmp", ASIDE[] = ".tmp.old";

/* Is the open file or folder still the one of this name, and ours? */
static int is_named(int file, const char *name)
{
    struct stat held, found;
    return fstat(file, &held) == 0 && lstat(name, &found) == 0 &&
           (S_ISREG(held.st_mode) || S_ISDIR(held.st_mode)) && held.st_dev == found.st_dev &&
           held.st_ino == found.st_ino && held.st_uid == geteuid();
}

/* Make `lock` and hold its lock. Returns the descriptor, or -1 with errno: EEXIST when another has it. */
static int take_lock(const char *lock)
{
    for (int tries = 0; tries < 100; tries++) {
        const int file = open(lock, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (file < 0)
            return file;
        /* before flock() another process may have taken it for an abandoned one and removed it */
        const int locked = flock(file, LOCK_EX | LOCK_NB) == 0;
        if (locked ? is_named(file, lock) : errno != EWOULDBLOCK)
            return file;
        close(file);
    }
    errno = EBUSY;
    return -1;
}

static void drop_lock(int claim, const char *lock)
{
    unlink(lock); /* while it is held: no other process can have made another of this name */
    close(claim);
}

/* What the dead owner of a lock has left; stem: full name up to the ending. True when nothing is left of it. */
static int remove_left(const char *path, const char *stem)
{
    char aside[PATH_MAX + sizeof ASIDE], temporary[PATH_MAX + sizeof TEMP];
    snprintf(aside, sizeof aside, "%s%s", stem, ASIDE);
    snprintf(temporary, sizeof temporary, "%s%s", stem, TEMP);
    if (is_there(aside)) {
        if (is_there(path))
            rx_output_remove(aside);
        else
            (void)rename(aside, path);
    }
    rx_output_remove(temporary);
    return !is_there(aside) && !is_there(temporary);
}

static void sweep_lock(const char *path, char *lock)
{
    char *ending = lock + strlen(lock) - strlen(LOCK);
    const int file = open(lock, O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (file < 0)
        return;
    if (flock(file, LOCK_EX | LOCK_NB) == 0 && is_named(file, lock)) {
        *ending = '\0';
        const int removed = remove_left(path, lock);
        *ending = LOCK[0];
        if (removed)
            unlink(lock);
    }
    close(file);
}

/* Does `name` read STEM.rx-digits.lock? */
static int is_lock(const char *name, const char *stem)
{
    static const char process[] = ".rx-";
    const size_t n = strlen(stem);
    if (strncmp(name, stem, n) != 0 || strncmp(name + n, process, strlen(process)) != 0)
        return 0;
    const char *number = name + n + strlen(process);
    const size_t digits = strspn(number, "0123456789");
    return digits > 0 && strcmp(number + digits, LOCK) == 0;
}

/* Remove the temporaries of `path` whose processes are dead, with their locks; only what belongs to the user of this process.
 * `stem` is the common part of their names, up to ".rx-". A folder that stepped aside as ".NAME.rx-NUMBER.tmp.old" for one
 * that never came goes back to `path`. Failures are ignored. */
static void sweep(const char *path, const char *stem)
{
    char found[PATH_MAX];
    const char *name = name_of(stem);
    const int n = (int)(name - stem);
    if (snprintf(found, sizeof found, "%.*s", n, stem) >= (int)sizeof found)
        return;
    DIR *dir = opendir(n > 0 ? found : ".");
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;)
        if (is_lock(entry->d_name, name) &&
            snprintf(found, sizeof found, "%.*s%s", n, stem, entry->d_name) < (int)sizeof found)
            sweep_lock(path, found);
    if (dir != NULL)
        closedir(dir);
}

/* --- the marker ---
 *
 * Which folders a run may replace: those that hold what a run wrote there, and nothing else. The marker, a file
 * `.rextract` in the folder, lists its files with their digests. */
static const char MARKER[] = ".rextract";
static const char HEAD[] = "Made by rextract: the next run replaces this folder as long as it holds these "
                           "files alone, as they were written.\n";
enum { MOST_BYTES = 1 << 24 };

/* What is in a folder: a line "digest name" of each file, "folder name" of each folder. */
typedef struct listing {
    const char *folder;
    const char *marker; /* lines that are expected, or NULL */
    rx_text lines;
    rx_text odd; /* name of the first entry that is not among those expected: the listing ends there */
} listing;

/* Links, pipes and the like, which no run writes, are in no marker. */
static rx_status add_line(listing *l, const char *path, const char *name, int *is_folder, rx_error *err)
{
    char digest[RX_HASH_TEXT] = "";
    struct stat info;
    int there = 0;
    if (lstat(path, &info) != 0)
        return rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be read: %s", strerror(errno));
    *is_folder = S_ISDIR(info.st_mode);
    const int of_interest = S_ISREG(info.st_mode) && (l->marker == NULL || l->marker[0] != '\0');
    const rx_status status = of_interest ? rx_hash_file(path, digest, &there, err) : RX_OK;
    if (status != RX_OK &&
        (l->marker == NULL || status != RX_INPUT)) /* what cannot be read is not as it was written */
        return status;
    const size_t begin = l->lines.length;
    rx_text_printf(&l->lines, "%s %s\n", *is_folder ? "folder" : digest, name);
    if (l->lines.failed)
        return rx_error_memory(err, 0);
    const char *found = l->marker != NULL ? strstr(l->marker, l->lines.data + begin) : NULL;
    /* a name of two lines could pass for two entries */
    const int known = found != NULL && found[-1] == '\n' && strchr(name, '\n') == NULL;
    if (!(there || *is_folder) || (l->marker != NULL && !known))
        rx_text_add(&l->odd, name);
    return RX_OK;
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

static rx_status list(listing *l, const char *inner, rx_error *err);

static rx_status list_entry(listing *l, const char *inner, const char *entry, rx_error *err)
{
    int is_folder = 0;
    if (strcmp(entry, ".") == 0 || strcmp(entry, "..") == 0 ||
        (inner[0] == '\0' && strcmp(entry, MARKER) == 0))
        return RX_OK;
    char *path = format("%s/%s%s%s", l->folder, inner, inner[0] != '\0' ? "/" : "", entry);
    if (path == NULL)
        return rx_error_memory(err, 0);
    const char *name = path + strlen(l->folder) + 1;
    rx_status status = add_line(l, path, name, &is_folder, err);
    if (status == RX_OK && is_folder && l->odd.length == 0)
        status = list(l, name, err);
    free(path);
    return status;
}

/* In the order of names, so that the same report has the same marker. */
static rx_status list(listing *l, const char *inner, rx_error *err)
{
    struct dirent **entries = NULL;
    char *path = format("%s/%s", l->folder, inner);
    if (path == NULL)
        return rx_error_memory(err, 0);
    const int n = scandir(path, &entries, NULL, by_name);
    rx_status status =
        n < 0 ? rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be read: %s", strerror(errno)) : RX_OK;
    for (int i = 0; i < n; i++) {
        if (status == RX_OK && l->odd.length == 0)
            status = list_entry(l, inner, entries[i]->d_name, err);
        free(entries[i]);
    }
    free(entries);
    free(path);
    return status;
}

/* What went wrong with a file, said of the folder: it may still have a name that means nothing to a user. */
static rx_status of_folder(rx_status status, rx_error *trouble, const char *shown, rx_error *err)
{
    if (status == RX_OK)
        return RX_OK;
    if (trouble->where[0] != '\0') {
        snprintf(trouble->where, sizeof trouble->where, "%s", shown);
        trouble->status = RX_SYSTEM;
    }
    return rx_error_take(err, trouble);
}

/* The marker of all that lies in `folder`, which errors call `shown`. Errors: RX_SYSTEM, and a signal. */
static rx_status write_marker(const char *folder, const char *shown, rx_error *err)
{
    listing l = {.folder = folder};
    char *path = format("%s/%s", folder, MARKER);
    rx_error trouble = rx_error_part(err);
    rx_text_add(&l.lines, HEAD);
    rx_status status = path == NULL ? rx_error_memory(&trouble, 0) : list(&l, "", &trouble);
    if (status == RX_OK)
        status = rx_text_write_file(&l.lines, path, shown, &trouble);
    free(path);
    rx_text_free(&l.lines);
    rx_text_free(&l.odd);
    return of_folder(status, &trouble, shown, err);
}

/* The marker's text; an empty one where there is none that a run of this version wrote. */
static rx_status read_marker(const char *folder, char **text, int *there, rx_error *err)
{
    char *path = format("%s/%s", folder, MARKER);
    struct stat info;
    *text = NULL;
    if (path == NULL)
        return rx_error_memory(err, 0);
    *there = lstat(path, &info) == 0;
    if (*there && S_ISREG(info.st_mode) && rx_text_read_file(path, MOST_BYTES, text, NULL, NULL) == RX_OK &&
        strncmp(*text, HEAD, sizeof HEAD - 1) != 0)
        (*text)[0] = '\0';
    free(path);
    return *text != NULL || (*text = rx_strdup("")) != NULL ? RX_OK : rx_error_memory(err, 1);
}

/* RX_OK where the folder is empty, or each file and folder in it is one that its marker lists, unchanged; files that
 * are missing do not matter. Else RX_USAGE, which names the first that is not; links are not followed. */
static rx_status check_marker(const char *folder, const char *shown, rx_error *err)
{
    static const char remedy[] = "so that it is not replaced; give another name, or move what you need "
                                 "elsewhere and remove the folder";
    listing l = {.folder = folder};
    rx_error trouble = rx_error_part(err);
    char *marker = NULL;
    int there = 0;
    rx_status status = read_marker(folder, &marker, &there, err);
    l.marker = marker;
    if (status == RX_OK)
        status = of_folder(list(&l, "", &trouble), &trouble, shown, err);
    if (status == RX_OK && l.odd.failed)
        status = rx_error_memory(err, 0);
    else if (status == RX_OK && there && marker[0] == '\0')
        status = rx_error_at(
            err, RX_USAGE, shown, -1, 0,
            "its %s does not list the files that a run wrote (it is damaged, or of an older version), %s",
            MARKER, remedy);
    else if (status == RX_OK && l.odd.length > 0)
        status =
            there ? rx_error_at(err, RX_USAGE, shown, -1, 0,
                                "holds '%.200s', which is not what a run of rextract wrote there, %s",
                                l.odd.data, remedy)
                  : rx_error_at(err, RX_USAGE, shown, -1, 0,
                                "is a folder with other content, which is never replaced; give another name");
    rx_text_free(&l.lines);
    rx_text_free(&l.odd);
    free(marker);
    return status;
}

/* --- reserving --- */

typedef enum output_kind { OUTPUT_FILE, OUTPUT_FOLDER, OUTPUT_DEVICE } output_kind;

typedef struct output {
    output_kind kind;
    char *path;  /* where it goes, symbolic links followed */
    char *shown; /* as the user wrote it */
    char *stem;  /* of the names of temporary and lock: beside the path, hidden */
    char *room;  /* folder beside the path that only this user can enter, so that no link waits in there */
    char *temporary; /* where it is written, in that folder */
    char *lock;      /* what says that it is ours */
    mode_t mode;     /* permissions of what it replaces, 0 without */
    dev_t device;    /* with folder and name: a.fits and ./a.fits are one file */
    ino_t folder;
    int claim; /* descriptor that holds the lock, -1 none */
    int done;  /* renamed */
} output;

struct rx_outputs {
    output *list;
    size_t n;
    rx_folders made; /* folders that outputs lie in */
};

rx_status rx_outputs_new(rx_outputs **dst, rx_error *err)
{
    *dst = RX_NEW(rx_outputs, 1);
    return *dst != NULL ? RX_OK : rx_error_memory(err, sizeof **dst);
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
    if (S_ISDIR(info.st_mode))
        out->mode = info.st_mode & 07777;
    else if (S_ISREG(info.st_mode))
        out->mode = info.st_mode & 0777;
    else {
        out->kind = OUTPUT_DEVICE;
        if (access(out->shown, W_OK) != 0)
            return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: %s", strerror(errno));
    }
    return RX_OK;
}

/* Fill path (links followed, so that a link stays a link) and the stem of the temporary's name beside it; the folder
 * is made where there is none. */
static rx_status place(output *out, rx_folders *made, rx_error *err)
{
    const size_t length = strlen(out->shown);
    RX_TRY(rx_name_trusted(out->shown, err));
    out->path = rx_name_real(out->shown);
    if (out->path == NULL)
        return rx_error_memory(err, length);
    const char *name = name_of(out->path), *scratch = getenv("TMPDIR");
    if (out->kind == OUTPUT_DEVICE)
        out->stem = format("%s/.%s", scratch != NULL && scratch[0] != '\0' ? scratch : "/tmp", name);
    else
        out->stem = format("%.*s.%s", (int)(name - out->path), out->path, name);
    if (out->stem == NULL)
        return rx_error_memory(err, length);
    if (strlen(name) + 24 > NAME_MAX)
        return rx_error_at(err, RX_USAGE, out->shown, -1, 0, "the name is too long; give a shorter one");
    return out->kind != OUTPUT_DEVICE ? rx_folders_make(made, out->stem, out->shown, err) : RX_OK;
}

/* A lock stays, without its holder, while something is left to be swept. */
static void forget(output *out)
{
    if (out->claim >= 0 && is_there(out->room))
        close(out->claim);
    else if (out->claim >= 0)
        drop_lock(out->claim, out->lock);
    free(out->path);
    free(out->shown);
    free(out->stem);
    free(out->room);
    free(out->temporary);
    free(out->lock);
}

/* Hold the lock of a number, with its room; -1 and errno where either is taken. */
static int take(output *out)
{
    const int held = take_lock(out->lock);
    if (held < 0)
        return -1;
    rx_output_remove(out->room); /* whose lock somebody has removed */
    if (mkdir(out->room, 0700) == 0)
        return held;
    const int reason = errno;
    drop_lock(held, out->lock);
    errno = reason;
    return -1;
}

/* Take the first free number; another machine, or another run in a container, may have ours. The folder is made again
 * where a run that has failed, and made it, has removed it by now; with our lock in it it stays. */
static rx_status claim(output *out, rx_folders *made, rx_error *err)
{
    const long first = (long)getpid(), tries = 1000;
    sweep(out->path, out->stem);
    for (long number = first; out->claim < 0 && number < first + tries; number++) {
        free(out->room);
        free(out->lock);
        out->room = format("%s.rx-%ld.tmp", out->stem, number);
        out->lock = format("%s.rx-%ld.lock", out->stem, number);
        if (out->room == NULL || out->lock == NULL)
            return rx_error_memory(err, strlen(out->stem));
        out->claim = take(out);
        if (out->claim < 0 && errno == ENOENT && out->kind != OUTPUT_DEVICE)
            RX_TRY(rx_folders_make(made, out->stem, out->shown, err));
        else if (out->claim < 0 && errno != EEXIST)
            break;
    }
    if (out->claim < 0)
        return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be %s: %s",
                           out->kind == OUTPUT_FOLDER ? "made" : "written", strerror(errno));
    out->temporary = format("%s/%s", out->room, name_of(out->path));
    return out->temporary != NULL ? RX_OK : rx_error_memory(err, strlen(out->room));
}

/* Which folder it is, now that it stays. */
static rx_status note_folder(output *out, rx_error *err)
{
    struct stat info;
    char *folder = format("%.*s.", (int)(name_of(out->stem) - out->stem), out->stem);
    if (folder == NULL)
        return rx_error_memory(err, strlen(out->stem));
    const int failed = stat(folder, &info) != 0;
    free(folder);
    if (failed)
        return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written, its folder: %s",
                           strerror(errno));
    out->device = info.st_dev;
    out->folder = info.st_ino;
    return RX_OK;
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
        status = place(out, &outputs->made, err);
    if (status == RX_OK) /* the only sure test of whether it can be written */
        status = claim(out, &outputs->made, err);
    if (status == RX_OK)
        status = note_folder(out, err);
    for (size_t i = 0; status == RX_OK && i < outputs->n; i++) {
        const output *other = &outputs->list[i];
        /* the stem's folder may be another than the path's (devices), its name is that of the output */
        if (other->device == out->device && other->folder == out->folder &&
            strcmp(name_of(other->stem), name_of(out->stem)) == 0)
            status =
                rx_error_at(err, RX_USAGE, path, -1, 0, "is asked for twice; give every output its own name");
    }
    /* once it is claimed: what a killed run has moved aside is back then; files are made by their writers */
    if (status == RX_OK && out->kind == OUTPUT_FOLDER && is_there(out->path))
        status = check_marker(out->path, out->shown, err);
    if (status == RX_OK && out->kind == OUTPUT_FOLDER && mkdir(out->temporary, 0777) != 0)
        status = rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be made: %s", strerror(errno));
    if (status != RX_OK) {
        if (out->claim >= 0)
            rx_output_remove(out->room);
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

/* One file of a tree to the disk: a full disk may only show now. */
static int sync_file(const char *path, const struct stat *info, int type, struct FTW *place)
{
    (void)place;
    if (type != FTW_F || !S_ISREG(info->st_mode))
        return type == FTW_DNR || type == FTW_NS ? -1 : 0; /* a folder that cannot be read */
    const int file = open(path, O_RDONLY);
    if (file < 0)
        return -1;
    const int failed = fsync(file), reason = errno;
    close(file);
    errno = reason;
    return failed;
}

static rx_status cannot_be_written(const output *out, rx_error *err)
{
    return rx_error_at(err, RX_SYSTEM, out->shown, -1, 0, "cannot be written: %s", strerror(errno));
}

/* A FIFO may have no reader, or one that sleeps, and signals are blocked. */
static int open_device(const output *out, rx_status *status, rx_error *err)
{
    int file = -1;
    while (*status == RX_OK && file < 0) {
        file = open(out->path, O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
        if (file < 0 && errno != ENXIO)
            *status = cannot_be_written(out, err);
        else if (file < 0 && (*status = rx_interrupt_check(err)) == RX_OK)
            poll(NULL, 0, 100);
    }
    return file;
}

static rx_status copy_to_device(const output *out, rx_error *err)
{
    char buffer[8192];
    rx_status status = RX_OK;
    FILE *src = fopen(out->temporary, "rb");
    if (src == NULL)
        return cannot_be_written(out, err);
    const int dst = open_device(out, &status, err);
    for (size_t n = 0, at = 0; status == RX_OK; at = at < n ? at : 0) {
        if (at == 0 && (n = fread(buffer, 1, sizeof buffer, src)) == 0)
            break;
        struct pollfd room = {.fd = dst, .events = POLLOUT};
        (void)poll(&room, 1, 100);
        const ssize_t written = write(dst, buffer + at, n - at);
        if (written > 0)
            at += (size_t)written;
        else if (written == 0 || errno == EAGAIN || errno == EINTR)
            status = rx_interrupt_check(err);
        else
            status = cannot_be_written(out, err);
    }
    if (status == RX_OK && ferror(src))
        status = cannot_be_written(out, err);
    if (dst >= 0 && close(dst) != 0 && status == RX_OK)
        status = cannot_be_written(out, err);
    fclose(src);
    return status;
}

/* Old and new change places at once where the file system can do that (not on NFS); else the old one steps aside. */
static int exchange(const output *out, const char *aside)
{
    if (renameat2(AT_FDCWD, out->temporary, AT_FDCWD, out->path, RENAME_EXCHANGE) == 0)
        return 0;
    if (rename(out->path, aside) != 0)
        return -1;
    if (rename(out->temporary, out->path) == 0)
        return rename(aside, out->temporary);
    const int reason = errno;
    (void)rename(aside, out->path);
    errno = reason;
    return -1;
}

/* What was put into the old folder while the new one took its place brings it back. */
static rx_status replace_folder(const output *out, rx_error *err)
{
    if (rename(out->temporary, out->path) == 0) /* where there is none, or an empty one */
        return RX_OK;
    if (errno != ENOTEMPTY && errno != EEXIST)
        return cannot_be_written(out, err);
    char *aside = format("%s.old", out->room);
    if (aside == NULL)
        return rx_error_memory(err, strlen(out->room));
    rx_status status = exchange(out, aside) == 0 ? RX_OK : cannot_be_written(out, err);
    if (status == RX_OK && (status = check_marker(out->temporary, out->shown, err)) != RX_OK)
        (void)exchange(out, aside);
    free(aside);
    return status;
}

static rx_status put_in_place(output *out, rx_error *err)
{
    rx_status status = RX_OK;
    if (out->kind == OUTPUT_DEVICE)
        status = copy_to_device(out, err);
    else if (out->kind == OUTPUT_FOLDER)
        status = replace_folder(out, err);
    else if (rename(out->temporary, out->path) != 0)
        status = cannot_be_written(out, err);
    if (status != RX_OK)
        return status;
    out->done = 1;
    rx_output_remove(out->room);
    return RX_OK;
}

/* All that can fail for want of space, or because the old folder is no longer one of ours. */
static rx_status complete(const output *out, rx_error *err)
{
    if (out->kind == OUTPUT_FOLDER)
        RX_TRY(write_marker(out->temporary, out->shown, err));
    if (nftw(out->temporary, sync_file, 16, FTW_PHYS) != 0 ||
        (out->mode != 0 && chmod(out->temporary, out->mode) != 0))
        return cannot_be_written(out, err);
    return out->kind == OUTPUT_FOLDER && is_there(out->path) ? check_marker(out->path, out->shown, err)
                                                             : RX_OK;
}

rx_status rx_outputs_commit(rx_outputs *outputs, rx_error *err)
{
    for (size_t i = 0; i < outputs->n; i++)
        if (!outputs->list[i].done)
            RX_TRY(complete(&outputs->list[i], err));
    if (rx_memory_is_refused()) /* what was written may be less than it should be */
        return rx_error_memory(err, 0);
    /* devices first: they may refuse bytes (a full disk behind a pipe, /dev/full), names hardly ever */
    for (size_t i = 0; i < 2 * outputs->n; i++) {
        output *out = &outputs->list[i % outputs->n];
        if (!out->done && (i < outputs->n) == (out->kind == OUTPUT_DEVICE))
            RX_TRY(put_in_place(out, err));
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
            rx_output_remove(outputs->list[i].room);
        forget(&outputs->list[i]);
    }
    rx_folders_free(&outputs->made);
    free(outputs->list);
    free(outputs);
}
