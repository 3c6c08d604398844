/* What the tests of io/ share: a scratch folder, header cards, and FITS files made byte by byte. */
#ifndef RX_TESTS_IO_TEST_H
#define RX_TESTS_IO_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../files.h"
#include "base/error.h"
#include "base/text.h"

/* --- scratch folder, the test's state --- */

typedef struct scratch {
    char folder[512];
    char *path[8]; /* ring of names handed out by in() */
    int next;
} scratch;

static inline void remove_all(const char *path)
{
    DIR *dir = opendir(path);
    if (dir == NULL) {
        unlink(path);
        return;
    }
    for (struct dirent *entry; (entry = readdir(dir)) != NULL;) {
        char inner[1024];
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        snprintf(inner, sizeof inner, "%.700s/%.255s", path, entry->d_name);
        remove_all(inner);
    }
    closedir(dir);
    rmdir(path);
}

static inline int make_scratch(void **state)
{
    const char *base = getenv("TMPDIR");
    scratch *s = calloc(1, sizeof *s);
    if (s == NULL)
        return -1;
    snprintf(s->folder, sizeof s->folder, "%.400s/rx-io-XXXXXX",
             base != NULL && base[0] != '\0' ? base : "/tmp");
    *state = s;
    return mkdtemp(s->folder) != NULL ? 0 : -1;
}

static inline int drop_scratch(void **state)
{
    scratch *s = *state;
    remove_all(s->folder);
    for (int i = 0; i < 8; i++)
        free(s->path[i]);
    free(s);
    return 0;
}

/* Full name of a file in the scratch folder; valid for the next seven calls. */
static inline const char *in(void **state, const char *name)
{
    scratch *s = *state;
    char **path = &s->path[s->next++ % 8];
    size_t size = strlen(s->folder) + strlen(name) + 2;
    free(*path);
    *path = malloc(size);
    assert_non_null(*path);
    snprintf(*path, size, "%s/%s", s->folder, name);
    return *path;
}

static inline int count_entries(const char *path)
{
    int n = 0;
    DIR *dir = opendir(path);
    assert_non_null(dir);
    for (struct dirent *entry; (entry = readdir(dir)) != NULL;)
        n += strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0;
    closedir(dir);
    return n;
}

/* Folder of the real data, NULL (and a line) where it is absent. */
static inline const char *real_data(void)
{
    const char *folder = getenv("RX_SHARED_DATA");
    if (folder == NULL || access(folder, R_OK) != 0) {
        print_message("real data absent (RX_SHARED_DATA): skipped\n");
        return NULL;
    }
    return folder;
}

/* --- cards --- */

/* Cards from lines separated by newlines. */
static inline void cards_from(const char *lines, rx_text *cards)
{
    while (*lines != '\0') {
        size_t n = strcspn(lines, "\n");
        char card[81];
        snprintf(card, sizeof card, "%-80.*s", (int)n, lines);
        rx_text_add_bytes(cards, card, 80);
        lines += n + (lines[n] == '\n');
    }
}

/* Append one HDU: its cards, END, padding, data, padding. */
static inline void add_hdu(rx_text *file, const char *lines, const void *data, size_t bytes)
{
    cards_from(lines, file);
    cards_from("END", file);
    while (file->length % 2880 != 0)
        rx_text_add_bytes(file, " ", 1);
    rx_text_add_bytes(file, data, bytes);
    while (file->length % 2880 != 0)
        rx_text_add_bytes(file, "\0", 1);
}

/* Big-endian bytes of n values of size bytes each, in place. */
static inline void swap(void *data, size_t n, size_t size)
{
    unsigned char *bytes = data;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < size / 2; j++) {
            unsigned char keep = bytes[i * size + j];
            bytes[i * size + j] = bytes[i * size + size - 1 - j];
            bytes[i * size + size - 1 - j] = keep;
        }
}

#endif
