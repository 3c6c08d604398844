/* A scratch folder for a test: state is its name; files written there by put() are removed with it. */
#ifndef TESTS_UNIT_CONFIG_FOLDER_H
#define TESTS_UNIT_CONFIG_FOLDER_H

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../files.h"

static int make_folder(void **state)
{
    const char *base = getenv("TMPDIR");
    char *folder = malloc(512);
    if (folder == NULL)
        return -1;
    snprintf(folder, 512, "%s/rextract-config-XXXXXX", base != NULL && base[0] != '\0' ? base : "/tmp");
    *state = folder;
    return mkdtemp(folder) != NULL ? 0 : -1;
}

static int remove_folder(void **state)
{
    char path[1024];
    DIR *dir = opendir(*state);
    for (struct dirent *entry = dir != NULL ? readdir(dir) : NULL; entry != NULL; entry = readdir(dir)) {
        snprintf(path, sizeof path, "%s/%s", (char *)*state, entry->d_name);
        if (entry->d_name[0] != '.')
            unlink(path);
    }
    if (dir != NULL)
        closedir(dir);
    int code = rmdir(*state);
    free(*state);
    return code;
}

/* Write a file into the folder; its path goes to dst. */
static void put(void **state, const char *name, const char *text, char dst[1024])
{
    snprintf(dst, 1024, "%s/%s", (char *)*state, name);
    write_text(dst, text);
}

#endif
