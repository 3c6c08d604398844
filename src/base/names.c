/* Names of outputs, and the two images of the dual-image mode. */
#include "base/names.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/memory.h"

char *rx_name_with_tag(const char *path, const char *tag)
{
    if (tag == NULL || tag[0] == '\0')
        return rx_strdup(path);
    const char *base = strrchr(path, '/');
    base = base != NULL ? base + 1 : path;
    const char *dot = strrchr(base, '.');
    size_t stem = dot != NULL && dot != base ? (size_t)(dot - path) : strlen(path);
    size_t bytes = strlen(path) + strlen(tag) + 2;
    char *name = malloc(bytes);
    if (name != NULL)
        snprintf(name, bytes, "%.*s_%s%s", (int)stem, path, tag, path + stem);
    return name;
}

bool rx_name_split_images(const char *images, char **detect, char **measure)
{
    *detect = *measure = NULL;
    int depth = 0;
    const char *comma = NULL;
    for (const char *c = images; *c != '\0' && comma == NULL; c++) {
        depth += (*c == '[') - (*c == ']');
        if (*c == ',' && depth <= 0)
            comma = c;
    }
    if (comma == NULL) {
        *detect = rx_strdup(images);
        return *detect != NULL;
    }
    *detect = strndup(images, (size_t)(comma - images));
    *measure = rx_strdup(comma + 1);
    if (*detect != NULL && *measure != NULL)
        return true;
    free(*detect);
    free(*measure);
    *detect = *measure = NULL;
    return false;
}

/* What an image's name ends in is cut off where the name is more than that. */
static void cut_endings(char *name)
{
    static const char *const endings[] = {".fz", ".gz", ".bz2", ".z", ".fits", ".fit", ".fts"};
    for (size_t i = 0; i < sizeof endings / sizeof endings[0]; i++) {
        const size_t length = strlen(name), n = strlen(endings[i]);
        if (length > n && strcasecmp(name + length - n, endings[i]) == 0)
            name[length - n] = '\0';
    }
}

char *rx_name_stem(const char *image)
{
    char *detect, *measure;
    if (!rx_name_split_images(image, &detect, &measure))
        return NULL;
    free(measure);
    const size_t length = strlen(detect);
    char *bracket = length > 0 && detect[length - 1] == ']' ? strchr(detect, '[') : NULL;
    if (bracket != NULL)
        *bracket = '\0';
    const char *slash = strrchr(detect, '/');
    if (slash != NULL)
        memmove(detect, slash + 1, strlen(slash));
    cut_endings(detect);
    return detect;
}

char *rx_name_psf(const char *image)
{
    const size_t room = strlen(image) + 5;
    char *name = malloc(room);
    if (name == NULL)
        return NULL;
    snprintf(name, room, "%s", image);
    cut_endings(name);
    return strcat(name, ".psf");
}

/* "a/b", with one slash between. */
static char *joined(const char *a, const char *b)
{
    const size_t n = strlen(a), size = n + strlen(b) + 2;
    char *text = malloc(size);
    if (text != NULL)
        snprintf(text, size, "%s%s%s", a, n > 0 && a[n - 1] == '/' ? "" : "/", b);
    return text;
}

/* The folder that holds `path`, which ends in no slash. */
static char *folder_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash == NULL   ? rx_strdup(".")
           : slash == path ? rx_strdup("/")
                           : strndup(path, (size_t)(slash - path));
}

/* Where the link in `folder` leads to; NULL with *failed 0: it is no link. */
static char *link_target(const char *path, const char *folder, int *failed)
{
    char target[PATH_MAX];
    const ssize_t length = readlink(path, target, sizeof target - 1);
    *failed = 0;
    if (length <= 0)
        return NULL;
    target[length] = '\0';
    char *whole = target[0] == '/' ? rx_strdup(target) : joined(folder, target);
    *failed = whole == NULL;
    return whole;
}

static char *real_of(const char *path, int links);

/* The same where nothing is there, without links. */
static char *behind_link(const char *path, const char *folder, int links, int *failed)
{
    *failed = 0;
    char *whole = links > 0 ? link_target(path, folder, failed) : NULL;
    char *real = whole != NULL ? real_of(whole, links - 1) : NULL;
    *failed |= whole != NULL && real == NULL;
    free(whole);
    return real;
}

/* The name in a folder that has none: without "." and "..". */
static char *step(const char *place, const char *name)
{
    return strcmp(name, ".") == 0    ? rx_strdup(place)
           : strcmp(name, "..") == 0 ? folder_of(place)
                                     : joined(place, name);
}

/* `links`: so many are followed that lead to nothing. What is above a missing folder is resolved all the same. */
static char *real_of(const char *path, int links)
{
    char *real = realpath(path, NULL);
    char *plain = real == NULL ? rx_strdup(path) : NULL;
    if (plain == NULL)
        return real;
    size_t length = strlen(plain);
    while (length > 1 && plain[length - 1] == '/')
        plain[--length] = '\0';
    const char *slash = strrchr(plain, '/');
    char *folder = folder_of(plain);
    char *place = folder == NULL               ? NULL
                  : strcmp(folder, plain) == 0 ? rx_strdup(plain)
                                               : real_of(folder, links);
    int failed = place == NULL;
    if (!failed && (real = behind_link(plain, folder, links, &failed)) == NULL && !failed)
        real = step(place, slash != NULL ? slash + 1 : plain);
    free(folder);
    free(place);
    free(plain);
    return real;
}

char *rx_name_real(const char *path)
{
    return real_of(path, 20);
}

/* As Linux's fs.protected_symlinks has it, which names that were resolved before they are opened get around. */
static bool is_planted(const char *folder, const struct stat *entry)
{
    struct stat in;
    return entry->st_uid != geteuid() && stat(folder, &in) == 0 && (in.st_mode & S_ISVTX) != 0 &&
           (in.st_mode & (S_IWGRP | S_IWOTH)) != 0 && entry->st_uid != in.st_uid;
}

static rx_status check_way(const char *path, int links, const char *shown, rx_error *err);

/* `name` is one that the way goes through. */
static rx_status check_step(const char *name, int links, const char *shown, rx_error *err)
{
    struct stat info;
    rx_status status = RX_OK;
    if (lstat(name, &info) != 0 || S_ISDIR(info.st_mode) || S_ISREG(info.st_mode))
        return RX_OK;
    char *folder = folder_of(name), *target = NULL;
    int failed = folder == NULL;
    if (!failed && is_planted(folder, &info))
        status =
            rx_error_at(err, RX_USAGE, shown, -1, 0,
                        "'%.200s' was put into a shared folder by another user and is not followed; give "
                        "another name",
                        name);
    else if (!failed && links > 0)
        target = link_target(name, folder, &failed);
    if (failed)
        status = rx_error_memory(err, strlen(name));
    else if (target != NULL)
        status = check_way(target, links - 1, shown, err);
    free(folder);
    free(target);
    return status;
}

static rx_status check_way(const char *path, int links, const char *shown, rx_error *err)
{
    char *name = rx_strdup(path);
    rx_status status = name != NULL ? RX_OK : rx_error_memory(err, strlen(path));
    for (char *end = name; status == RX_OK && *end != '\0';) {
        end += strspn(end, "/");
        end += strcspn(end, "/");
        const char slash = *end;
        *end = '\0';
        status = check_step(name, links, shown, err);
        *end = slash;
    }
    free(name);
    return status;
}

rx_status rx_name_trusted(const char *path, rx_error *err)
{
    return check_way(path, 20, path, err);
}
