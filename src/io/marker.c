/* The list of files that makes a folder one of ours. */
#include "io/marker.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/hash.h"
#include "base/memory.h"
#include "base/text.h"

static const char MARKER[] = ".rextract";
static const char HEAD[] =
    "Made by rextract: the next run replaces this folder as long as it holds these files "
    "alone, as they were written.\n";
enum { MOST_BYTES = 1 << 24 };

/* What is in a folder: a line "digest name" of each file, "folder name" of each folder. */
typedef struct listing {
    const char *folder;
    const char *marker; /* lines that are expected, or NULL */
    rx_text lines;
    rx_text odd; /* name of the first entry that is not among those expected: the listing ends there */
} listing;

/* Links, pipes and the like, which no run writes, are in no marker. */
static rx_status add_line(listing *l, const char *path, const char *name, int *is_folder, rx_error *err)
{
    char digest[RX_HASH_TEXT] = "";
    struct stat info;
    int there = 0;
    if (lstat(path, &info) != 0)
        return rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be read: %s", strerror(errno));
    *is_folder = S_ISDIR(info.st_mode);
    const int of_interest = S_ISREG(info.st_mode) && (l->marker == NULL || l->marker[0] != '\0');
    const rx_status status = of_interest ? rx_hash_file(path, digest, &there, err) : RX_OK;
    if (status != RX_OK &&
        (l->marker == NULL || status != RX_INPUT)) /* what cannot be read is not as it was written */
        return status;
    const size_t begin = l->lines.length;
    rx_text_printf(&l->lines, "%s %s\n", *is_folder ? "folder" : digest, name);
    if (l->lines.failed)
        return rx_error_memory(err, 0);
    const char *found = l->marker != NULL ? strstr(l->marker, l->lines.data + begin) : NULL;
    /* a name of two lines could pass for two entries */
    const int known = found != NULL && found[-1] == '\n' && strchr(name, '\n') == NULL;
    if (!(there || *is_folder) || (l->marker != NULL && !known))
        rx_text_add(&l->odd, name);
    return RX_OK;
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

static rx_status list(listing *l, const char *inner, rx_error *err);

static rx_status list_entry(listing *l, const char *inner, const char *entry, rx_error *err)
{
    rx_text name = {0}, path = {0};
    int is_folder = 0;
    if (strcmp(entry, ".") == 0 || strcmp(entry, "..") == 0 ||
        (inner[0] == '\0' && strcmp(entry, MARKER) == 0))
        return RX_OK;
    rx_text_printf(&name, "%s%s%s", inner, inner[0] != '\0' ? "/" : "", entry);
    rx_text_printf(&path, "%s/%s", l->folder, name.failed ? "" : name.data);
    rx_status status = name.failed || path.failed ? rx_error_memory(err, 0)
                                                  : add_line(l, path.data, name.data, &is_folder, err);
    if (status == RX_OK && is_folder && l->odd.length == 0)
        status = list(l, name.data, err);
    rx_text_free(&name);
    rx_text_free(&path);
    return status;
}

/* In the order of names, so that the same report has the same marker. */
static rx_status list(listing *l, const char *inner, rx_error *err)
{
    struct dirent **entries = NULL;
    rx_text path = {0};
    rx_text_printf(&path, "%s/%s", l->folder, inner);
    const int n = path.failed ? -1 : scandir(path.data, &entries, NULL, by_name);
    rx_status status =
        path.failed ? rx_error_memory(err, 0)
        : n < 0     ? rx_error_at(err, RX_SYSTEM, path.data, -1, 0, "cannot be read: %s", strerror(errno))
                    : RX_OK;
    for (int i = 0; i < n; i++) {
        if (status == RX_OK && l->odd.length == 0)
            status = list_entry(l, inner, entries[i]->d_name, err);
        free(entries[i]);
    }
    free(entries);
    rx_text_free(&path);
    return status;
}

/* What went wrong with a file, said of the folder: it may still have a name that means nothing to a user. */
static rx_status of_folder(rx_status status, rx_error *trouble, const char *shown, rx_error *err)
{
    if (status == RX_OK)
        return RX_OK;
    if (trouble->where[0] != '\0') {
        snprintf(trouble->where, sizeof trouble->where, "%s", shown);
        trouble->status = RX_SYSTEM;
    }
    return rx_error_take(err, trouble);
}

rx_status rx_marker_write(const char *folder, const char *shown, rx_error *err)
{
    listing l = {.folder = folder};
    rx_text path = {0};
    rx_error trouble = rx_error_part(err);
    rx_text_add(&l.lines, HEAD);
    rx_text_printf(&path, "%s/%s", folder, MARKER);
    rx_status status = path.failed ? rx_error_memory(&trouble, 0) : list(&l, "", &trouble);
    if (status == RX_OK)
        status = rx_text_write_file(&l.lines, path.data, shown, &trouble);
    rx_text_free(&path);
    rx_text_free(&l.lines);
    rx_text_free(&l.odd);
    return of_folder(status, &trouble, shown, err);
}

/* The marker's text; an empty one where there is none that a run of this version wrote. */
static rx_status read_marker(const char *folder, char **text, int *there, rx_error *err)
{
    rx_text path = {0};
    struct stat info;
    *text = NULL;
    rx_text_printf(&path, "%s/%s", folder, MARKER);
    rx_status status = path.failed ? rx_error_memory(err, 0) : RX_OK;
    *there = status == RX_OK && lstat(path.data, &info) == 0;
    if (*there && S_ISREG(info.st_mode) &&
        rx_text_read_file(path.data, MOST_BYTES, text, NULL, NULL) == RX_OK &&
        strncmp(*text, HEAD, sizeof HEAD - 1) != 0)
        (*text)[0] = '\0';
    if (status == RX_OK && *text == NULL && (*text = rx_strdup("")) == NULL)
        status = rx_error_memory(err, 1);
    rx_text_free(&path);
    return status;
}

rx_status rx_marker_check(const char *folder, const char *shown, rx_error *err)
{
    static const char remedy[] =
        "so that it is not replaced; give another name, or move what you need elsewhere and "
        "remove the folder";
    listing l = {.folder = folder};
    rx_error trouble = rx_error_part(err);
    char *marker = NULL;
    int there = 0;
    rx_status status = read_marker(folder, &marker, &there, err);
    l.marker = marker;
    if (status == RX_OK)
        status = of_folder(list(&l, "", &trouble), &trouble, shown, err);
    if (status == RX_OK && l.odd.failed)
        status = rx_error_memory(err, 0);
    else if (status == RX_OK && there && marker[0] == '\0')
        status = rx_error_at(err, RX_USAGE, shown, -1, 0,
                             "its %s does not list the files that a run wrote (it is damaged, or of an older "
                             "version), %s",
                             MARKER, remedy);
    else if (status == RX_OK && l.odd.length > 0)
        status =
            there ? rx_error_at(err, RX_USAGE, shown, -1, 0,
                                "holds '%.200s', which is not what a run of rextract wrote there, %s",
                                l.odd.data, remedy)
                  : rx_error_at(err, RX_USAGE, shown, -1, 0,
                                "is a folder with other content, which is never replaced; give another name");
    rx_text_free(&l.lines);
    rx_text_free(&l.odd);
    free(marker);
    return status;
}
