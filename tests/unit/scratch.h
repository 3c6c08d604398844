/* A folder of its own for a test (state is its name). */
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

#include "files.h"
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

/* Write a file into the folder; its path goes to dst. */
static inline void put(void **state, const char *name, const char *text, char dst[1024])
{
    snprintf(dst, 1024, "%s/%s", (char *)*state, name);
    write_text(dst, text);
}

static inline void path_in(void **state, const char *name, char dst[1024])
{
    snprintf(dst, 1024, "%s/%s", (char *)*state, name);
}

#endif
