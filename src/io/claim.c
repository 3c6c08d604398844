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
enum { RANDOM = 6 }; /* letters that mkdtemp() chooses */

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

static void sweep_lock(const char *path, const char *lock)
{
    char stem[PATH_MAX];
    const int file = open(lock, O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (file < 0)
        return;
    if (flock(file, LOCK_EX | LOCK_NB) == 0 && is_named(file, lock)) {
        snprintf(stem, sizeof stem, "%.*s", (int)(strlen(lock) - strlen(LOCK)), lock);
        if (remove_left(path, stem))
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

/* A folder that rx_claim_folder() has made; the lock is held while it goes. */
static void sweep_folder(const char *path, const char *name)
{
    (void)path;
    const int file = open(name, O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW);
    if (file < 0)
        return;
    if (flock(file, LOCK_EX | LOCK_NB) == 0 && is_named(file, name))
        rx_output_remove(name);
    close(file);
}

/* Does `name` read STEM and the six letters of mkdtemp()? */
static int is_claimed_folder(const char *name, const char *stem)
{
    const size_t n = strlen(stem);
    return strncmp(name, stem, n) == 0 && strlen(name + n) == RANDOM;
}

/* sweep_one(path, ...) for everything beside the stem whose name belongs to it. */
static void sweep(const char *path, const char *stem, int (*belongs)(const char *name, const char *stem),
                  void (*sweep_one)(const char *path, const char *found))
{
    char folder[PATH_MAX], found[PATH_MAX];
    const char *slash = strrchr(stem, '/'), *name = slash != NULL ? slash + 1 : stem;
    if (snprintf(folder, sizeof folder, "%.*s", (int)(name - stem), stem) >= (int)sizeof folder)
        return;
    DIR *dir = opendir(folder[0] != '\0' ? folder : ".");
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;)
        if (belongs(entry->d_name, name) &&
            snprintf(found, sizeof found, "%s%s", folder, entry->d_name) < (int)sizeof found)
            sweep_one(path, found);
    if (dir != NULL)
        closedir(dir);
}

void rx_claim_sweep(const char *path, const char *stem)
{
    sweep(path, stem, is_lock, sweep_lock);
}

int rx_claim_folder(char *name)
{
    char *random = name + strlen(name) - RANDOM;
    *random = '\0';
    sweep(NULL, name, is_claimed_folder, sweep_folder);
    for (int tries = 0; tries < 100; tries++) {
        memcpy(random, "XXXXXX", RANDOM);
        if (mkdtemp(name) == NULL)
            return -1;
        const int file = open(name, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
        if (file >= 0 && is_held(file, name))
            return file;
        if (file < 0 && errno != ENOENT) {
            const int reason = errno;
            rmdir(name);
            errno = reason;
            return -1;
        }
    }
    errno = EBUSY;
    return -1;
}

void rx_claim_remove(int claim, const char *name)
{
    rx_output_remove(name);
    close(claim);
}
