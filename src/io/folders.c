/* Folders that outputs lie in. */
#include "io/folders.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/memory.h"

/* Asks for no memory of its own, which may be what is missing, and follows no link, even one that is put
 * there now. */
static void remove_at(int folder, const char *name)
{
    if (unlinkat(folder, name, 0) == 0 || (errno != EISDIR && errno != EPERM))
        return;
    /* more than once where the gnuplot of a killed process still writes in there */
    for (int tries = 0, left = 1; left && tries < 5; tries++) {
        const int inner = openat(folder, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        DIR *dir = inner >= 0 ? fdopendir(inner) : NULL;
        if (dir == NULL && inner >= 0)
            close(inner);
        for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;)
            if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
                remove_at(inner, entry->d_name);
        if (dir != NULL)
            closedir(dir);
        left = unlinkat(folder, name, AT_REMOVEDIR) != 0 && errno == ENOTEMPTY;
    }
}

void rx_output_remove(const char *path)
{
    remove_at(AT_FDCWD, path);
}

static int is_folder(const char *path)
{
    struct stat info;
    return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

/* One folder, and its name noted for the removal. It may be there: then mkdir() says EEXIST, or, on some file systems,
 * first that it may not write. */
static rx_status make(rx_folders *made, const char *path, int *reason, rx_error *err)
{
    *reason = 0;
    RX_TRY(RX_GROW(made->path, made->n + 1, err));
    char *copy = rx_strdup(path);
    if (copy == NULL)
        return rx_error_memory(err, strlen(path));
    if (mkdir(path, 0777) == 0) {
        made->path[made->n++] = copy;
        return RX_OK;
    }
    *reason = errno == EEXIST ? ENOTDIR : errno;
    free(copy);
    if (is_folder(path))
        *reason = 0;
    return RX_OK;
}

/* All of them, from the top; *end is where the folder's name ends that could not be made. */
static rx_status make_all(rx_folders *made, char *path, char **end, int *reason, rx_error *err)
{
    rx_status status = RX_OK;
    *reason = 0;
    for (char *slash = path + strspn(path, "/");
         status == RX_OK && *reason == 0 && (slash = strchr(slash, '/')) != NULL;
         slash += strspn(slash, "/")) {
        *slash = '\0';
        status = make(made, path, reason, err);
        *slash = '/';
        *end = slash;
    }
    return status;
}

rx_status rx_folders_make(rx_folders *made, const char *path, const char *shown, rx_error *err)
{
    const char *slash = strrchr(path, '/');
    if (slash == NULL || slash == path)
        return RX_OK;
    char *folder = strndup(path, (size_t)(slash - path) + 1), *end = NULL;
    if (folder == NULL)
        return rx_error_memory(err, strlen(path));
    int reason = ENOENT;
    rx_status status = RX_OK;
    /* again where another process, which had made one of them, has removed it after we saw it */
    for (int tries = 0; tries < 100 && status == RX_OK && reason == ENOENT && !is_folder(folder); tries++)
        status = make_all(made, folder, &end, &reason, err);
    if (status == RX_OK && !is_folder(folder)) {
        if (end != NULL)
            *end = '\0';
        status = rx_error_at(err, RX_SYSTEM, shown, -1, 0,
                             "cannot be written: its folder '%.200s' cannot be made: %s", folder,
                             strerror(reason));
    }
    free(folder);
    return status;
}

void rx_folders_free(rx_folders *made)
{
    while (made->n > 0) {
        (void)rmdir(made->path[--made->n]);
        free(made->path[made->n]);
    }
    free(made->path);
    made->path = NULL;
}
