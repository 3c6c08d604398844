/* Folders of their own for tests: as state of a test, as the current one, or by name. */
#ifndef TESTS_UNIT_SCRATCH_H
#define TESTS_UNIT_SCRATCH_H

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "files.h"
#include "io/folders.h"

/* The state of a test: the name comes first, so that *state is it. */
typedef struct scratch {
    char folder[512], before[4096];
    char *path[8]; /* names that in() gave out */
    int next;
} scratch;

static inline void new_folder(char dst[512])
{
    scratch_name(dst);
    assert_non_null(mkdtemp(dst));
}

static inline int count_files(const char *folder)
{
    int n = 0;
    DIR *open = opendir(folder);
    assert_non_null(open);
    for (struct dirent *e; (e = readdir(open)) != NULL;)
        n += strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0;
    closedir(open);
    return n;
}

/* Files in a folder, which is removed with them. */
static inline int clear_folder(const char *folder)
{
    const int n = count_files(folder);
    rx_output_remove(folder);
    assert_int_not_equal(access(folder, F_OK), 0);
    return n;
}

static inline int make_scratch(void **state)
{
    scratch *s = calloc(1, sizeof *s);
    if ((*state = s) == NULL)
        return -1;
    new_folder(s->folder);
    return 0;
}

static inline int remove_scratch(void **state)
{
    scratch *s = *state;
    rx_output_remove(s->folder);
    const int gone = access(s->folder, F_OK) != 0;
    for (int i = 0; i < 8; i++)
        free(s->path[i]);
    free(s);
    return gone ? 0 : -1;
}

/* The same, as the current folder while the test runs; srcdir still names the sources. */
static inline int enter_scratch(void **state)
{
    char *sources = realpath(getenv("srcdir") != NULL ? getenv("srcdir") : ".", NULL);
    if (sources == NULL || setenv("srcdir", sources, 1) != 0 || make_scratch(state) != 0)
        return -1;
    free(sources);
    scratch *s = *state;
    return getcwd(s->before, sizeof s->before) != NULL ? chdir(s->folder) : -1;
}

static inline int leave_scratch(void **state)
{
    const int failed = chdir(((scratch *)*state)->before);
    return remove_scratch(state) != 0 ? -1 : failed;
}

/* A file's name in the folder; good for the next seven calls. */
static inline const char *in(void **state, const char *name)
{
    scratch *s = *state;
    char **path = &s->path[s->next++ % 8];
    const size_t size = strlen(s->folder) + strlen(name) + 2;
    free(*path);
    *path = malloc(size);
    assert_non_null(*path);
    snprintf(*path, size, "%s/%s", s->folder, name);
    return *path;
}

/* Write a file into the folder. */
static inline const char *put(void **state, const char *name, const char *text)
{
    const char *path = in(state, name);
    write_text(path, text);
    return path;
}

static inline char *slurp(const char *folder, const char *name)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return file_bytes(path, NULL);
}

#endif
