/* A folder of its own for a test (state is its name), and whole files in it. */
#ifndef TESTS_UNIT_SCRATCH_H
#define TESTS_UNIT_SCRATCH_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "io/output.h"

static int make_scratch(void **state)
{
    const char *base = getenv("TMPDIR");
    char *folder = malloc(512);
    if (folder == NULL)
        return -1;
    snprintf(folder, 512, "%s/rextract-test-XXXXXX", base != NULL && base[0] != '\0' ? base : "/tmp");
    *state = folder;
    return mkdtemp(folder) != NULL ? 0 : -1;
}

static int remove_scratch(void **state)
{
    rx_output_remove(*state);
    const int gone = access(*state, F_OK) != 0;
    free(*state);
    return gone ? 0 : -1;
}

static inline void path_in(void **state, const char *name, char dst[1024])
{
    snprintf(dst, 1024, "%s/%s", (char *)*state, name);
}

/* The file's bytes with a 0 behind them, to be freed. */
static inline char *file_bytes(const char *path, size_t *size)
{
    struct stat info;
    assert_int_equal(stat(path, &info), 0);
    char *data = calloc((size_t)info.st_size + 1, 1);
    FILE *file = fopen(path, "rb");
    assert_non_null(data);
    assert_non_null(file);
    *size = fread(data, 1, (size_t)info.st_size, file);
    assert_int_equal(*size, info.st_size);
    fclose(file);
    return data;
}

static inline void write_bytes(const char *path, const char *data, size_t size)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

#endif
