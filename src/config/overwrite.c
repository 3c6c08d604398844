/* Comparing outputs with inputs, and with each other. */
#include "config/overwrite.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/lines.h"
#include "base/memory.h"
#include "base/names.h"
#include "config/config_fields.h"

/* --- which files there are --- */

static rx_status add(rx_run_files *dst, rx_file_role role, const char *prefix, const char *key,
                     const char *shown, const char *path, rx_error *err)
{
    RX_TRY(RX_GROW(dst->of, (size_t)dst->n + 1, err));
    rx_run_file *file = &dst->of[dst->n++];
    *file = (rx_run_file){role, prefix, key, rx_strdup(shown), rx_strdup(path)};
    return file->shown == NULL || file->path == NULL ? rx_error_memory(err, strlen(path)) : RX_OK;
}

static rx_status add_input(rx_run_files *dst, const char *prefix, const char *key, const char *name,
                           rx_error *err);

/* What a list holds; that it cannot be read, its reader says. */
static rx_status add_listed(rx_run_files *dst, const char *list, rx_error *err)
{
    rx_lines lines;
    struct stat info;
    char *line = NULL;
    if (stat(list, &info) != 0 || !S_ISREG(info.st_mode)) /* a pipe can be read once */
        return RX_OK;
    rx_status status = RX_OK, more = rx_lines_open(&lines, list, 0, NULL);
    while (status == RX_OK && more == RX_OK && (more = rx_lines_next(&lines, &line, NULL)) == RX_OK &&
           line != NULL) {
        line += strspn(line, " \t");
        for (size_t n = strlen(line); n > 0 && isspace((unsigned char)line[n - 1]); n--)
            line[n - 1] = '\0';
        if (line[0] == '#' || line[0] == '\0' || line[0] == '@')
            continue;
        status = add_input(dst, "", "", line, err);
        char *comment = strchr(line, '#'); /* where the list's reader has it so */
        if (comment != NULL && status == RX_OK) {
            *comment = '\0';
            line[strcspn(line, " \t")] = '\0';
            status = add_input(dst, "", "", line, err);
        }
    }
    rx_lines_close(&lines);
    return status;
}

/* A copy of an input's name without what stands in brackets, where there is a file of that name. */
static char *file_of(const char *name)
{
    struct stat info;
    char *path = rx_strdup(name);
    if (path == NULL || stat(path, &info) == 0)
        return path;
    for (char *bracket = path; (bracket = strchr(bracket, '[')) != NULL; *bracket++ = '[') {
        *bracket = '\0';
        if (stat(path, &info) == 0 && !S_ISDIR(info.st_mode))
            return path;
    }
    path[strcspn(path, "[")] = '\0';
    return path;
}

static rx_status add_input(rx_run_files *dst, const char *prefix, const char *key, const char *name,
                           rx_error *err)
{
    const bool list = name[0] == '@';
    char *path = file_of(name + list);
    rx_status status = path == NULL ? rx_error_memory(err, strlen(name))
                                    : add(dst, RX_FILE_READS, prefix, key, name, path, err);
    if (status == RX_OK && list)
        status = add_listed(dst, path, err);
    free(path);
    return status;
}

/* The file that becomes of an output's name: with several restorers there is one of each, of a campaign's journal one of each
 * shard. NULL without memory; the caller frees. */
static char *output_name(const rx_settings *settings, const rx_keyword *key, const char *name, int restorer)
{
    const rx_campaign_config *campaign = (const rx_campaign_config *)settings;
    rx_text text = {0};
    int k, n;
    if (restorer >= 0)
        return rx_name_with_tag(name, ((const rx_config *)settings)->restore_type.v[restorer]);
    if (settings->table != rx_keytable_validate() || key->role != RX_FILE_WRITES ||
        rx_campaign_config_shard(campaign, &k, &n, NULL) != RX_OK || n == 1)
        return rx_strdup(name);
    rx_text_printf(&text, "%s.%d", name, k);
    if (text.failed)
        rx_text_free(&text);
    return text.data;
}

static rx_status add_item(rx_run_files *dst, const rx_settings *settings, const rx_keyword *key,
                          const char *name, rx_error *err)
{
    const int n = key->each_restorer ? ((const rx_config *)settings)->restore_type.n : 1;
    rx_status status = RX_OK;
    if (key->role == RX_FILE_READS)
        return add_input(dst, settings->prefix, key->name, name, err);
    for (int i = 0; i < n && status == RX_OK; i++) {
        char *path = output_name(settings, key, name, n > 1 ? i : -1);
        status = path == NULL ? rx_error_memory(err, strlen(name))
                              : add(dst, key->role, settings->prefix, key->name, path, path, err);
        if (status == RX_OK && strcmp(key->name, "CATALOG_NAME") == 0 &&
            ((const rx_config *)settings)->positions_name[0] != '\0') {
            char *forced = rx_name_with_tag(path, RX_FORCED_TAG);
            status = forced == NULL ? rx_error_memory(err, strlen(name))
                                    : add(dst, key->role, settings->prefix, key->name, forced, forced, err);
            free(forced);
        }
        free(path);
    }
    return status;
}

static rx_status add_row(rx_run_files *dst, const rx_settings *settings, const rx_keyword *key, rx_error *err)
{
    const void *field = (const char *)settings + key->offset;
    const rx_words *images = strcmp(key->name, "CHECKIMAGE_NAME") == 0
                                 ? &((const rx_config *)settings)->checkimage_type
                                 : NULL; /* a file for each */
    for (int i = 0; i < rx_keyword_count(key->kind, field); i++) {
        rx_kind kind;
        const char *name = *(char *const *)rx_keyword_item(key->kind, field, i, &kind);
        if (name[0] != '\0' && (images == NULL || (i < images->n && strcmp(images->v[i], "NONE") != 0)))
            RX_TRY(add_item(dst, settings, key, name, err));
    }
    return RX_OK;
}

static rx_status add_settings(rx_run_files *dst, const rx_settings *settings, rx_error *err)
{
    const rx_keytable *table = settings->table;
    rx_status status = settings->file != NULL ? add_input(dst, "", "", settings->file, err) : RX_OK;
    for (int row = 0; row < table->nrows && status == RX_OK; row++) {
        const rx_keyword *key = &table->rows[row];
        /* an input that the command line names is not written, whether it is read or not */
        const bool named = key->role == RX_FILE_READS && settings->origin[row] == RX_FROM_COMMAND;
        if (key->role >= RX_FILE_READS && rx_keyword_idle(settings, row) == NULL &&
            (named || rx_keyword_counts(settings, row)))
            status = add_row(dst, settings, key, err);
    }
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL && status == RX_OK; i++)
        status = add_settings(dst, settings->part[i], err);
    return status;
}

static rx_status add_words(rx_run_files *dst, const rx_keytable *table, const char *image, rx_error *err)
{
    char *first = NULL, *second = NULL;
    rx_status status = RX_OK;
    if (table->plain == RX_PLAIN_IMAGES) {
        if (!rx_name_split_images(image, &first, &second))
            return rx_error_memory(err, strlen(image));
        status = add_input(dst, "", "IMAGE", first, err);
        if (status == RX_OK && second != NULL)
            status = add_input(dst, "", "IMAGE", second, err);
    } else {
        first = rx_strdup(image);
        status = first == NULL ? rx_error_memory(err, strlen(image)) : RX_OK;
        for (char *rest = NULL, *name = first;
             status == RX_OK && (name = strtok_r(name, "\n", &rest)) != NULL; name = NULL)
            status = add_input(dst, "", "", name, err);
    }
    free(first);
    free(second);
    return status;
}

rx_status rx_run_files_of(const rx_settings *settings, const char *image, rx_run_files *dst, rx_error *err)
{
    *dst = (rx_run_files){0};
    if (image != NULL)
        RX_TRY(add_words(dst, settings->table, image, err));
    return add_settings(dst, settings, err);
}

void rx_run_files_free(rx_run_files *files)
{
    for (int i = 0; i < files->n; i++) {
        free(files->of[i].shown);
        free(files->of[i].path);
    }
    free(files->of);
    *files = (rx_run_files){0};
}

/* --- two of them --- */

/* A file as it is on the disk. */
typedef struct place {
    const rx_run_file *file;
    char *real; /* NULL: of an input, where its name does not matter */
    struct stat info;
    bool there;
} place;

/* With a list of many tiles following all links of all inputs takes its time. */
static rx_status find(const rx_run_file *file, bool named, place *dst, rx_error *err)
{
    *dst = (place){.file = file, .real = named ? rx_name_real(file->path) : NULL};
    dst->there = stat(file->path, &dst->info) == 0;
    return named && dst->real == NULL ? rx_error_memory(err, strlen(file->path)) : RX_OK;
}

/* A device takes the place of nothing, and a catalogue may go to standard output. */
static bool is_same(const place *a, const place *b)
{
    if ((a->there && !S_ISREG(a->info.st_mode) && !S_ISDIR(a->info.st_mode)) ||
        (strcmp(a->file->key, "CATALOG_NAME") == 0 && strcmp(a->file->path, "STDOUT") == 0))
        return false;
    return (b->real != NULL && strcmp(a->real, b->real) == 0) ||
           (a->there && b->there && a->info.st_dev == b->info.st_dev && a->info.st_ino == b->info.st_ino);
}

/* Does a file, which need not exist, lie in that folder, both by their real names? `deep`: or in one below it? */
static bool lies_in(const char *file, const char *folder, bool deep)
{
    const size_t n = strcmp(folder, "/") == 0 ? 0 : strlen(folder);
    return strncmp(file, folder, n) == 0 && file[n] == '/' && (deep || strchr(file + n + 1, '/') == NULL);
}

/* The same by what the folders are, which may have two names: bind mounts, names without case. */
static rx_status lies_in_folder(const char *file, const place *folder, bool *lies, rx_error *err)
{
    char *way = rx_strdup(file), *slash;
    struct stat info;
    *lies = lies_in(file, folder->real, true);
    if (way == NULL)
        return rx_error_memory(err, strlen(file));
    while (!*lies && folder->there && (slash = strrchr(way, '/')) != NULL && slash > way) {
        *slash = '\0';
        *lies =
            stat(way, &info) == 0 && info.st_dev == folder->info.st_dev && info.st_ino == folder->info.st_ino;
    }
    free(way);
    return RX_OK;
}

static rx_status refuse_read(const rx_run_file *output, const rx_run_file *input, const char *how,
                             rx_error *err)
{
    return rx_error_set(err, RX_USAGE, "%s%s %.200s is also read, %s %.200s; give the output another name",
                        output->prefix, output->key, output->shown, how, input->shown);
}

/* `output` is written; `other` read or written. */
static rx_status compare(const place *output, const place *other, rx_error *err)
{
    const rx_run_file *of = output->file, *with = other->file;
    const bool folder = of->role == RX_FILE_FOLDER, read = with->role == RX_FILE_READS;
    if (is_same(output, other))
        return read ? refuse_read(of, with, "as", err)
                    : rx_error_set(err, RX_USAGE, "%s%s %.200s is also %s%s; give each output its own name",
                                   of->prefix, of->key, of->shown, with->prefix, with->key);
    bool lies = false;
    if (folder && other->real != NULL)
        RX_TRY(lies_in_folder(other->real, output, &lies, err));
    if (lies)
        return rx_error_set(
            err, RX_USAGE,
            "%.200s lies in the folder %.200s, which is replaced as a whole (%s%s); keep it elsewhere",
            with->shown, of->shown, of->prefix, of->key);
    if (folder || !read || !output->there || !other->there || !S_ISDIR(other->info.st_mode))
        return RX_OK;
    char *real = rx_name_real(with->path);
    if (real == NULL)
        return rx_error_memory(err, strlen(with->path));
    const bool from = lies_in(output->real, real, false);
    free(real);
    return from ? refuse_read(of, with, "from the folder", err) : RX_OK;
}

/* The outputs among the files with all of them from `first` on. */
static rx_status compare_all(const rx_run_files *files, int first, rx_error *err)
{
    place *outputs = NULL;
    int n = 0;
    bool replaces = false; /* a folder that is there, and may hold inputs */
    rx_status status = RX_MAKE(outputs, (size_t)files->n + 1, err);
    for (int i = 0; i < files->n && status == RX_OK; i++)
        if (files->of[i].role != RX_FILE_READS) {
            status = find(&files->of[i], true, &outputs[n], err);
            replaces |= files->of[i].role == RX_FILE_FOLDER && outputs[n].there;
            n++;
        }
    for (int i = first; i < files->n && status == RX_OK; i++) {
        place other;
        const bool written = files->of[i].role != RX_FILE_READS;
        status = find(&files->of[i], written || replaces, &other, err);
        for (int k = 0; k < n && status == RX_OK; k++)
            if (outputs[k].file != other.file)
                status = compare(&outputs[k], &other, err);
        free(other.real);
    }
    for (int k = 0; k < n; k++)
        free(outputs[k].real);
    free(outputs);
    return status;
}

/* Compares where what was collected is complete, and frees it. */
static rx_status finish(rx_run_files *files, int first, rx_status status, rx_error *err)
{
    if (status == RX_OK)
        status = compare_all(files, first, err);
    rx_run_files_free(files);
    return status;
}

/* A run that is repeated replaces nothing that the command line does not name. */
static rx_status check_repeated(const rx_settings *settings, const rx_run_files *files, rx_error *err)
{
    rx_text found = {0};
    struct stat info;
    for (const rx_run_file *file = files->of; file < files->of + files->n; file++)
        if (file->role != RX_FILE_READS && rx_settings_was_set(settings, file->key) != RX_FROM_COMMAND &&
            stat(file->path, &info) == 0 && (S_ISREG(info.st_mode) || S_ISDIR(info.st_mode)))
            rx_text_printf(&found, "%s%s %s", found.length > 0 ? ", " : "", file->key, file->path);
    const rx_status status =
        found.failed        ? rx_error_memory(err, 0)
        : found.length == 0 ? RX_OK
                            : rx_error_at(err, RX_USAGE, settings->file, -1, 0,
                                          "is not repeated over outputs that are there (%.400s); give others "
                                          "by -KEYWORD NAME",
                                          found.data);
    rx_text_free(&found);
    return status;
}

rx_status rx_overwrite_check(const rx_settings *settings, const char *image, rx_error *err)
{
    rx_run_files files;
    rx_status status = rx_run_files_of(settings, image, &files, err);
    if (status == RX_OK && settings->repeated.n > 0)
        status = check_repeated(settings, &files, err);
    return finish(&files, 0, status, err);
}

rx_status rx_settings_check_read(const rx_settings *settings, const char *name, rx_error *err)
{
    rx_run_files files;
    rx_status status = rx_run_files_of(settings, NULL, &files, err);
    const int known = files.n;
    if (status == RX_OK)
        status = add_input(&files, "", "", name, err);
    return finish(&files, known, status, err);
}

rx_status rx_settings_check_folder(const rx_settings *settings, const char *image, const char *key,
                                   const char *folder, rx_error *err)
{
    rx_run_files files;
    rx_status status = rx_run_files_of(settings, image, &files, err);
    if (status == RX_OK)
        status = add(&files, RX_FILE_FOLDER, settings->prefix, key, folder, folder, err);
    return finish(&files, 0, status, err);
}

rx_status rx_settings_check_inputs(const rx_settings *settings, const rx_settings *others, const char *image,
                                   rx_error *err)
{
    rx_run_files files, inputs = {0};
    rx_status status = rx_run_files_of(settings, NULL, &files, err);
    const int known = files.n;
    if (status == RX_OK)
        status = rx_run_files_of(others, image, &inputs, err);
    for (int i = 0; i < inputs.n && status == RX_OK; i++)
        if (inputs.of[i].role == RX_FILE_READS)
            status = add_input(&files, "", "", inputs.of[i].path, err);
    rx_run_files_free(&inputs);
    return finish(&files, known, status, err);
}
