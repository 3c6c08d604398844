// list_files: what lies in the current folder and below it, by name: a line "DIGEST SIZE NAME" for a file, "NAME" for a folder.
// run.sh lists twice a case, hundreds of times: one process that needs the C library alone, instead of find, cksum and sort.
// A pipe is not opened, which would wait for its other end.
#include <dirent.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { PATH_SIZE = 4096 };

static void file(const char *path)
{
    static unsigned char part[1 << 16];
    uint64_t digest = 0xcbf29ce484222325, size = 0; // FNV-1a
    const int from = open(path, O_RDONLY | O_NONBLOCK);
    for (ssize_t n; from >= 0 && (n = read(from, part, sizeof part)) > 0; size += (uint64_t)n)
        for (ssize_t i = 0; i < n; i++)
            digest = (digest ^ part[i]) * 0x100000001b3;
    if (from >= 0) {
        close(from);
        printf("%" PRIu64 " %" PRIu64 " %s\n", digest, size, path);
    }
}

static void folder(const char *path)
{
    struct dirent **entry = NULL;
    const int n = scandir(path, &entry, NULL, alphasort);
    printf("%s\n", path);
    for (int i = 0; i < n; i++) {
        char below[PATH_SIZE];
        struct stat is;
        const int length = snprintf(below, sizeof below, "%s/%s", path, entry[i]->d_name);
        if (strcmp(entry[i]->d_name, ".") != 0 && strcmp(entry[i]->d_name, "..") != 0 && length < PATH_SIZE &&
            lstat(below, &is) == 0) {
            if (S_ISDIR(is.st_mode))
                folder(below);
            else if (!S_ISFIFO(is.st_mode))
                file(below);
        }
        free(entry[i]);
    }
    free(entry);
}

int main(void)
{
    folder(".");
    return ferror(stdout) || fflush(stdout) != 0 ? EXIT_FAILURE : EXIT_SUCCESS;
}
