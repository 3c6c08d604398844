/* A folder of its own for a test, the current one while it runs. */
#ifndef RX_TESTS_PLACE_H
#define RX_TESTS_PLACE_H

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "io/output.h"

typedef struct place {
    char root[64], old[4096];
} place;

static int enter(void **state)
{
    place *p = calloc(1, sizeof *p);
    if (p == NULL)
        return -1;
    *state = p;
    strcpy(p->root, "/tmp/rextract-stage-XXXXXX");
    return mkdtemp(p->root) != NULL && getcwd(p->old, sizeof p->old) != NULL && chdir(p->root) == 0 ? 0 : -1;
}

static int leave(void **state)
{
    place *p = *state;
    const int failed = chdir(p->old);
    rx_output_remove(p->root);
    const int gone = access(p->root, F_OK) != 0;
    free(p);
    return failed != 0 || !gone ? -1 : 0;
}

#endif
