/* Temporary folders of killed processes. */
#include "io/claim.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "io/output.h"

static const char TEMP[] = ".tmp", ASIDE[] = ".tmp.old", PROCESS[] = ".rx-";

int rx_claim_make(const char *folder, const char *marker, const char *text)
{
    char draft[PATH_MAX], name[PATH_MAX];
    const size_t length = strlen(text);
    if (snprintf(draft, sizeof draft, "%s/%s.new", folder, marker) >= (int)sizeof draft) {
        errno = ENAMETOOLONG;
        return -1;
    }
    snprintf(name, sizeof name, "%.*s", (int)(strlen(draft) - strlen(".new")), draft);
    int file = open(draft, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file < 0)
        return -1;
    (void)flock(file, LOCK_EX | LOCK_NB);
    errno = ENOSPC; /* of a short write */
    if (write(file, text, length) == (ssize_t)length && rename(draft, name) == 0)
        return file;
    const int reason = errno;
    close(file);
    errno = reason;
    return -1;
}

/* A folder without a marker, whose maker was killed before it had one: it holds a draft of it at most. The
 * number in its name says who that was. */
static int remove_unmarked(const char *folder, const char *marker)
{
    char draft[PATH_MAX];
    const char *number = NULL;
    for (const char *c = folder; (c = strstr(c, PROCESS)) != NULL; c++)
        number = c + strlen(PROCESS);
    const long process = number != NULL ? strtol(number, NULL, 10) : 0;
    if (process <= 0 || process > INT_MAX || kill((pid_t)process, 0) == 0 || errno != ESRCH)
        return 0;
    if (snprintf(draft, sizeof draft, "%s/%s.new", folder, marker) >= (int)sizeof draft)
        return 0;
    (void)unlink(draft);
    return rmdir(folder) == 0;
}

/* Remove a folder whose maker has died; 0 when it lives, or nobody can tell. */
static int remove_abandoned(const char *folder, const char *marker)
{
    char name[PATH_MAX];
    if (snprintf(name, sizeof name, "%s/%s", folder, marker) >= (int)sizeof name)
        return 0;
    int file = open(name, O_RDWR | O_CLOEXEC);
    if (file < 0)
        return errno == ENOENT ? remove_unmarked(folder, marker) : 0;
    const int abandoned = flock(file, LOCK_EX | LOCK_NB) == 0;
    if (abandoned)
        rx_output_remove(folder);
    close(file);
    return abandoned;
}

static int exists(const char *path)
{
    struct stat info;
    return lstat(path, &info) == 0;
}

/* Does `name` read PREFIX digits SUFFIX? */
static int is_named(const char *name, const char *prefix, size_t n, const char *suffix)
{
    if (strncmp(name, prefix, n) != 0)
        return 0;
    const size_t digits = strspn(name + n, "0123456789");
    return digits > 0 && strcmp(name + n + digits, suffix) == 0;
}

/* A folder that stepped aside: in the way when `path` is there, else what belongs there, but not while its
 * process is between the two renames. */
static void settle_aside(char *full, const char *path, const char *marker)
{
    if (exists(path)) {
        rx_output_remove(full);
        return;
    }
    char *end = full + strlen(full) - (strlen(ASIDE) - strlen(TEMP));
    *end = '\0';
    const int dead = remove_abandoned(full, marker) || !exists(full);
    *end = ASIDE[strlen(TEMP)];
    if (dead)
        (void)rename(full, path);
}

void rx_claim_sweep(const char *path, const char *temporary, const char *marker)
{
    char folder[PATH_MAX], full[PATH_MAX];
    const char *slash = strrchr(temporary, '/'), *name = slash != NULL ? slash + 1 : temporary;
    const size_t room = (size_t)(name - temporary);
    size_t common = 0; /* of all their names: up to the number of the process */
    for (const char *c = name; (c = strstr(c, PROCESS)) != NULL; c++)
        common = (size_t)(c - name) + strlen(PROCESS);
    if (common == 0 || room >= sizeof folder)
        return;
    memcpy(folder, temporary, room);
    folder[room] = '\0';
    DIR *dir = opendir(room > 0 ? folder : ".");
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;) {
        if (snprintf(full, sizeof full, "%s%s", folder, entry->d_name) >= (int)sizeof full)
            continue;
        if (is_named(entry->d_name, name, common, ASIDE))
            settle_aside(full, path, marker);
        else if (is_named(entry->d_name, name, common, TEMP))
            remove_abandoned(full, marker);
    }
    if (dir != NULL)
        closedir(dir);
}
