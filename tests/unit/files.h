/* Whole files: read, written, and one of its own, by name or as state of a test (its name). */
#ifndef TESTS_UNIT_FILES_H
#define TESTS_UNIT_FILES_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "unit.h"

/* The file's bytes with a 0 behind them, to be freed; size may be NULL. */
static inline char *file_bytes(const char *path, size_t *size)
{
    struct stat info;
    if (stat(path, &info) != 0)
        fail_msg("%s is missing", path);
    char *data = calloc((size_t)info.st_size + 1, 1);
    FILE *file = fopen(path, "rb");
    assert_non_null(data);
    assert_non_null(file);
    assert_int_equal(fread(data, 1, (size_t)info.st_size, file), info.st_size);
    fclose(file);
    if (size != NULL)
        *size = (size_t)info.st_size;
    return data;
}

static inline void write_bytes(const char *path, const void *data, size_t size)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

static inline void write_text(const char *path, const char *text)
{
    write_bytes(path, text, strlen(text));
}

/* Whether a command of the shell succeeds. */
static inline int works(const char *command)
{
    return system(command) == 0;
}

/* A name to be completed by mkstemp() or mkdtemp(). */
static inline void scratch_name(char dst[512])
{
    const char *base = getenv("TMPDIR");
    snprintf(dst, 512, "%.400s/rextract-test-XXXXXX", base != NULL && base[0] != '\0' ? base : "/tmp");
}

/* A new file of that text. */
static inline void new_file(char dst[512], const char *text)
{
    scratch_name(dst);
    const int file = mkstemp(dst);
    assert_true(file >= 0);
    close(file);
    write_text(dst, text);
}

static inline int make_file(void **state)
{
    if ((*state = malloc(512)) == NULL)
        return -1;
    new_file(*state, "");
    return 0;
}

static inline int remove_file(void **state)
{
    const int code = unlink(*state);
    free(*state);
    return code;
}

#endif
