/* replay [-m N] [-k FILE] FOLDER [TARGET...]: every file of FOLDER/<target> goes through its target, with any
 * compiler. With -m also N damaged copies of each: bytes changed, cut off, doubled, the same ones every time.
 * -k: the input at work is kept in FILE, to have the one that a crash came of. */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/random.h"
#include "fuzz.h"

typedef struct target {
    const char *name;
    void (*run)(const uint8_t *data, size_t size);
} target;

static const target targets[] = {
#define TARGET(name, most, what) {#name, fuzz_##name},
#include "targets.def"
#undef TARGET
};

static uint8_t *read_file(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    fuzz_require(file != NULL && fseek(file, 0, SEEK_END) == 0, "an input can be opened");
    const long n = ftell(file);
    fuzz_require(n >= 0, "an input has a size");
    rewind(file);
    uint8_t *data = malloc((size_t)n + 1);
    fuzz_require(data != NULL && fread(data, 1, (size_t)n, file) == (size_t)n, "an input can be read");
    fclose(file);
    *size = (size_t)n;
    return data;
}

/* Copy number k of an input, damaged; `dst` has room for all of it and as much again. */
static size_t damage(const uint8_t *data, size_t size, uint64_t k, uint8_t *dst)
{
    static const char *const strange[] = {"-1", "0", "99999999999", "nan", "\xff", "", "'", "\"", "=", "\n"};
    uint32_t r[4];
    memcpy(dst, data, size);
    for (uint64_t step = 0; size > 0 && step <= k % 4; step++) {
        rx_random_block(1, k, step, r);
        const size_t at = r[0] % size, n = r[1] % (size - at) + 1;
        const char *word = strange[r[2] % (sizeof strange / sizeof *strange)];
        if (r[3] % 5 == 0)
            dst[at] = (uint8_t)r[1];
        else if (r[3] % 5 == 1)
            dst[at] ^= (uint8_t)(1U << r[1] % 8);
        else if (r[3] % 5 == 2)
            memcpy(dst + at, word, strlen(word) < size - at ? strlen(word) : size - at);
        else if (r[3] % 5 == 3 && step == 0) /* a piece twice */
            memmove(dst + at + n, dst + at, size - at), size += n;
        else if (step == 0) /* or not at all */
            memmove(dst + at, dst + at + n, size - at - n), size -= n;
    }
    return size;
}

static int not_hidden(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

static void one(const target *t, const uint8_t *data, size_t size, const char *keep)
{
    FILE *file = keep != NULL ? fopen(keep, "wb") : NULL;
    if (keep != NULL)
        fuzz_require(file != NULL && fwrite(data, 1, size, file) == size && fclose(file) == 0,
                     "an input can be kept");
    t->run(data, size);
}

static long run(const target *t, const char *folder, long copies, const char *keep)
{
    struct dirent **entries = NULL;
    char path[1100];
    long done = 0;
    snprintf(path, sizeof path, "%.500s/%s", folder, t->name);
    const int n = scandir(path, &entries, not_hidden, by_name);
    fuzz_require(n > 0, "there are inputs");
    for (int i = 0; i < n; i++) {
        size_t size;
        snprintf(path, sizeof path, "%.500s/%s/%.255s", folder, t->name, entries[i]->d_name);
        uint8_t *data = read_file(path, &size), *copy = malloc(2 * size + 1);
        fuzz_require(copy != NULL, "there is memory");
        one(t, data, size, keep);
        for (long k = 0; k < copies; k++, done++)
            one(t, copy, damage(data, size, (uint64_t)k, copy), keep);
        free(copy);
        free(data);
        free(entries[i]);
    }
    free(entries);
    return done + n;
}

int main(int argc, char **argv)
{
    long copies = 0;
    const char *folder = NULL, *keep = NULL;
    for (int option; (option = getopt(argc, argv, "m:k:")) != -1;) {
        if (option == 'k')
            keep = optarg;
        else if (option == 'm')
            copies = strtol(optarg, NULL, 10);
        else
            return 2;
    }
    if (optind < argc)
        folder = argv[optind++];
    if (folder == NULL) {
        fputs("usage: replay [-m N] [-k FILE] FOLDER [TARGET...]\n", stderr);
        return 2;
    }
    for (size_t i = 0; i < sizeof targets / sizeof *targets; i++) {
        int wanted = optind == argc;
        for (int a = optind; a < argc; a++)
            wanted |= strcmp(argv[a], targets[i].name) == 0;
        if (wanted)
            printf("%s: %ld inputs\n", targets[i].name, run(&targets[i], folder, copies, keep));
        fflush(stdout);
    }
    return 0;
}
