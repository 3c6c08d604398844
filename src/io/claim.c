/* Temporary outputs of killed processes. */
#include "io/claim.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "io/folders.h"

static const char LOCK[] = ".lock", TEMP[] = ".tmp", ASIDE[] = ".tmp.old";

/* Is the open file or folder still the one of this name, and ours? */
static int is_named(int file, const char *name)
{
    struct stat held, found;
    return fstat(file, &held) == 0 && lstat(name, &found) == 0 &&
           (S_ISREG(held.st_mode) || S_ISDIR(held.st_mode)) && held.st_dev == found.st_dev &&
           held.st_ino == found.st_ino && held.st_uid == geteuid();
}

/* Hold the lock of what has just been made: between that and flock() another process may take it for an abandoned one and
 * remove it; then it is closed, and 0. */
static int is_held(int file, const char *name)
{
    const int locked = flock(file, LOCK_EX | LOCK_NB) == 0;
    if (locked ? is_named(file, name) : errno != EWOULDBLOCK)
        return 1;
    close(file);
    return 0;
}

int rx_claim_take(const char *lock)
{
    for (int tries = 0; tries < 100; tries++) {
        const int file = open(lock, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (file < 0 || is_held(file, lock))
            return file;
    }
    errno = EBUSY;
    return -1;
}

void rx_claim_drop(int claim, const char *lock)
{
    unlink(lock); /* while it is held: no other process can have made another of this name */
    close(claim);
}

static int exists(const char *path)
{
    struct stat info;
    return lstat(path, &info) == 0;
}

/* What the dead owner of a lock has left; stem: full name up to the ending. True when nothing is left of it.
 */
static int remove_left(const char *path, const char *stem)
{
    char aside[PATH_MAX + sizeof ASIDE], temporary[PATH_MAX + sizeof TEMP];
    snprintf(aside, sizeof aside, "%s%s", stem, ASIDE);
    snprintf(temporary, sizeof temporary, "%s%s", stem, TEMP);
    if (exists(aside)) {
        if (exists(path))
            rx_output_remove(aside);
        else
            (void)rename(aside, path);
    }
    rx_output_remove(temporary);
    return !exists(aside) && !exists(temporary);
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

void rx_claim_sweep(const char *path, const char *stem)
{
    char found[PATH_MAX];
    const char *slash = strrchr(stem, '/'), *name = slash != NULL ? slash + 1 : stem;
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
