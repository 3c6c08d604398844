/* Settings as a whole: made, copied, read, overridden, checked, visited. */
#include "config/settings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/lines.h"
#include "base/memory.h"
#include "config/keyword.h"
#include "config/tokens.h"
#include "io/record_read.h"

/* Hand the finished settings over, their parts typed, or free them. */
static void hand_over(rx_status status, rx_settings *settings, rx_settings **dst)
{
    if (status != RX_OK) {
        rx_settings_free(settings);
        return;
    }
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL; i++)
        memcpy((char *)settings + settings->table->part[i].offset, &settings->part[i],
               sizeof settings->part[i]);
    *dst = settings;
}

/* A struct of the table without any value. */
static rx_status make_room(const rx_keytable *table, rx_settings **dst, rx_error *err)
{
    rx_settings *settings = rx_alloc(1, table->size);
    if (settings == NULL)
        return rx_error_memory(err, table->size);
    settings->table = table;
    settings->prefix = "";
    settings->origin = RX_NEW(rx_origin, (size_t)table->nrows);
    settings->line = RX_NEW(long, (size_t)table->nrows);
    *dst = settings;
    if (settings->origin == NULL || settings->line == NULL)
        return rx_error_memory(err, (size_t)table->nrows * sizeof *settings->line);
    return RX_OK;
}

rx_status rx_settings_new(const rx_keytable *table, rx_settings **dst, rx_error *err)
{
    rx_settings *settings = NULL;
    rx_status status = make_room(table, &settings, err);
    for (int row = 0; row < table->nrows && status == RX_OK; row++) {
        rx_tokens items = {0};
        if (table->rows[row].kind == RX_KIND_SECTION)
            continue;
        status = rx_tokens_read(table->rows[row].initial, &items, err);
        if (status == RX_OK)
            status = rx_keyword_assign(settings, row, items.v, items.n, (rx_place){0}, NULL, err);
        rx_tokens_free(&items);
    }
    for (int i = 0; i < RX_PARTS && table->part[i].prefix != NULL && status == RX_OK; i++) {
        status = rx_settings_new(table->part[i].table(), &settings->part[i], err);
        if (status == RX_OK) {
            settings->part[i]->prefix = table->part[i].prefix;
            settings->part[i]->idle = table->part[i].idle;
            settings->part[i]->where = table->part[i].where;
        }
    }
    hand_over(status, settings, dst);
    return status;
}

rx_status rx_settings_copy(const rx_settings *src, rx_settings **dst, rx_error *err)
{
    const rx_keytable *table = src->table;
    rx_settings *settings = NULL;
    rx_status status = make_room(table, &settings, err);
    for (int row = 0; row < table->nrows && status == RX_OK; row++) {
        settings->origin[row] = src->origin[row];
        settings->line[row] = src->line[row];
        status = rx_keyword_copy(settings, src, row, err);
    }
    if (status == RX_OK && src->file != NULL) {
        settings->file = rx_strdup(src->file);
        status = settings->file != NULL ? RX_OK : rx_error_memory(err, strlen(src->file));
    }
    for (int i = 0; i < RX_PARTS && src->part[i] != NULL && status == RX_OK; i++)
        status = rx_settings_copy(src->part[i], &settings->part[i], err);
    if (status == RX_OK) {
        settings->prefix = src->prefix;
        settings->idle = src->idle;
        settings->where = src->where;
    }
    hand_over(status, settings, dst);
    return status;
}

void rx_settings_free(rx_settings *settings)
{
    if (settings == NULL)
        return;
    for (int row = 0; row < settings->table->nrows; row++)
        rx_keyword_clear(settings, row);
    for (int i = 0; i < RX_PARTS; i++)
        rx_settings_free(settings->part[i]);
    free(settings->origin);
    free(settings->line);
    free(settings->file);
    rx_record_free(&settings->repeated);
    free(settings);
}

/* The settings and the row that a name is for; of a keyword that is gone, row -1 and the row of gone.def. */
typedef struct target {
    rx_settings *owner;
    int row;
    const rx_gone *gone;
} target;

static rx_status find(rx_settings *settings, const char *name, rx_place place, target *dst, rx_error *err)
{
    rx_named found;
    RX_TRY(rx_keyword_look_up(settings->table, name, place, &found, err));
    *dst = (target){found.part < 0 ? settings : settings->part[found.part], found.row, found.gone};
    return RX_OK;
}

/* One line of a file: nothing, or a keyword and its values; the names of those that are gone are added to *old. */
static rx_status read_line(rx_settings *settings, const char *line, rx_place place, rx_text *old, rx_log *log,
                           rx_error *err)
{
    rx_tokens items = {0};
    rx_text before = {0}, now = {0};
    target at;
    rx_status status = rx_tokens_read(line, &items, err);
    if (status == RX_USAGE)
        status = rx_error_where(err, status, place.file, -1, place.line);
    if (status != RX_OK || items.n == 0)
        goto exit;
    RX_TRY_EXIT(find(settings, items.v[0], place, &at, err));
    if (at.gone != NULL) {
        rx_text_printf(old, "%s%s", old->length > 0 ? ", " : "", items.v[0]);
        RX_TRY_EXIT(rx_keyword_check_gone(at.gone, items.v[0], items.v + 1, items.n - 1, place, err));
        goto exit;
    }
    rx_keyword_print(&before, at.owner, at.row, true);
    RX_TRY_EXIT(rx_keyword_assign(at.owner, at.row, items.v + 1, items.n - 1, place, log, err));
    rx_keyword_print(&now, at.owner, at.row, true);
    if (before.failed || now.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    /* does the file give the value that the keyword has anyway? */
    rx_origin *origin = &at.owner->origin[at.row];
    *origin = *origin <= RX_FROM_DUMP && strcmp(now.data, before.data) == 0 ? RX_FROM_DUMP : RX_FROM_FILE;
    at.owner->line[at.row] = place.line;
exit:
    rx_text_free(&now);
    rx_text_free(&before);
    rx_tokens_free(&items);
    return status;
}

/* Remember which file is read: lines are reported with it. */
static rx_status keep_name(rx_settings *settings, const char *path, rx_error *err)
{
    char *name = rx_strdup(path);
    if (name == NULL)
        return rx_error_memory(err, strlen(path));
    free(settings->file);
    settings->file = name;
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL; i++)
        RX_TRY(keep_name(settings->part[i], path, err));
    return RX_OK;
}

static rx_status read_file(rx_settings *settings, const char *path, rx_log *log, rx_error *err)
{
    rx_lines lines = {0};
    rx_text old = {0}; /* one warning for all */
    char *line = NULL;
    rx_status status = rx_lines_open(&lines, path, 0, err);
    while (status == RX_OK && (status = rx_lines_next(&lines, &line, err)) == RX_OK && line != NULL)
        status = read_line(settings, line, (rx_place){.file = path, .line = lines.number}, &old, log, err);
    rx_lines_close(&lines);
    if (status == RX_OK && old.failed)
        status = rx_error_memory(err, 0);
    if (status == RX_OK && old.length > 0)
        rx_log_warning(log, "%s: no longer keywords, and without effect at their old defaults: %s", path,
                       old.data);
    rx_text_free(&old);
    if (status == RX_INPUT) { /* a configuration file is usage, not data */
        if (err != NULL)
            err->status = RX_USAGE;
        return RX_USAGE;
    }
    return status;
}

/* The value as one word of text; `whole`: a STRING takes it as it is. */
static rx_status give(rx_settings *settings, const char *name, const char *value, bool whole,
                      rx_origin origin, rx_log *log, rx_error *err)
{
    rx_tokens items = {0};
    target at;
    RX_TRY(find(settings, name, (rx_place){0}, &at, err));
    whole = whole && at.gone == NULL && at.owner->table->rows[at.row].kind == RX_KIND_STRING;
    rx_status status = whole ? rx_tokens_expand(value, &items, err) : rx_tokens_read(value, &items, err);
    if (status == RX_OK && at.gone != NULL) {
        status = rx_keyword_check_gone(at.gone, name, items.v, items.n, (rx_place){0}, err);
        if (status == RX_OK && log != NULL)
            rx_log_warning(log, "%s is no longer a keyword, and without effect at its old default", name);
    } else if (status == RX_OK && (status = rx_keyword_assign(at.owner, at.row, items.v, items.n,
                                                              (rx_place){0}, log, err)) == RX_OK)
        at.owner->origin[at.row] = origin;
    rx_tokens_free(&items);
    return status;
}

rx_status rx_settings_set(rx_settings *settings, const char *name, const char *value, rx_log *log,
                          rx_error *err)
{
    return give(settings, name, value, true, RX_FROM_COMMAND, log, err);
}

/* Keywords stand between IMAGE and SET, which names those that were set. */
static rx_status take_record(rx_settings *settings, const rx_record *record, rx_error *err)
{
    rx_error why = rx_error_part(err);
    rx_text set = {0};
    char word[80];
    int i = 0;
    rx_text_printf(&set, " %s ", rx_record_find(record, "SET"));
    rx_status status = set.failed ? rx_error_memory(&why, 0) : RX_OK;
    while (strcmp(record->pairs[i][0], "IMAGE") != 0)
        i++;
    for (i++; i < record->n && strcmp(record->pairs[i][0], "SET") != 0 && status == RX_OK; i++) {
        snprintf(word, sizeof word, " %s ", record->pairs[i][0]);
        status = give(settings, record->pairs[i][0], record->pairs[i][1], false,
                      strstr(set.data, word) != NULL ? RX_FROM_FILE : RX_FROM_DEFAULT, NULL, &why);
    }
    rx_text_free(&set);
    if (status == RX_USAGE) /* a header is data */
        return rx_error_at(err, RX_INPUT, settings->file, -1, 0, "its record cannot be used: %.300s",
                           why.text);
    return status == RX_OK ? RX_OK : rx_error_take(err, &why);
}

rx_status rx_settings_read(rx_settings *settings, const char *path, rx_log *log, rx_error *err)
{
    bool found = false;
    RX_TRY(keep_name(settings, path, err));
    if (settings->table == rx_keytable_rextract()) {
        RX_TRY(rx_record_read(path, &settings->repeated, &found, err));
        if (found)
            return take_record(settings, &settings->repeated, err);
    }
    return read_file(settings, path, log, err);
}

rx_status rx_settings_name_tile(rx_settings *settings, const char *tile, rx_error *err)
{
    for (int row = 0; row < settings->table->nrows; row++)
        RX_TRY(rx_keyword_replace(settings, row, "{tile}", tile, err));
    return RX_OK;
}

rx_origin rx_settings_was_set(const rx_settings *settings, const char *name)
{
    rx_named found;
    if (rx_keyword_look_up(settings->table, name, (rx_place){0}, &found, NULL) != RX_OK || found.row < 0)
        return RX_FROM_DEFAULT;
    return (found.part < 0 ? settings : settings->part[found.part])->origin[found.row];
}

bool rx_settings_states(const rx_settings *settings, const char *name)
{
    return rx_settings_was_set(settings, name) > RX_FROM_DUMP;
}

bool rx_settings_visit(const rx_settings *settings, bool exact, rx_settings_visitor visit, void *user)
{
    const rx_keytable *table = settings->table;
    bool complete = true;
    for (int row = 0; row < table->nrows && complete; row++) {
        rx_text name = {0}, value = {0};
        if (table->rows[row].kind == RX_KIND_SECTION)
            continue;
        rx_text_printf(&name, "%s%s", settings->prefix, table->rows[row].name);
        rx_keyword_print(&value, settings, row, exact);
        complete = !name.failed && !value.failed;
        if (complete)
            visit(user, name.data, value.data, table->rows[row].help);
        rx_text_free(&name);
        rx_text_free(&value);
    }
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL && complete; i++)
        complete = rx_settings_visit(settings->part[i], exact, visit, user);
    return complete;
}

/* What a row says of its own value: each word once, <from>,<to>[,<step>] in this order. */
static rx_status check_row(const rx_settings *settings, const rx_keyword *key, rx_error *err)
{
    const void *field = (const char *)settings + key->offset;
    const rx_words *words = field;
    const rx_reals *range = field;
    for (int i = 0; key->once && i < words->n; i++)
        for (int j = 0; j < i; j++)
            if (strcmp(words->v[i], words->v[j]) == 0)
                return rx_settings_refuse(settings, key->name, err, "%s is named twice; name each once",
                                          words->v[i]);
    if (key->ordered && range->n > 1 && range->v[0] > range->v[1])
        return rx_settings_refuse(settings, key->name, err, "%g is above %g; give <from>,<to>%s", range->v[0],
                                  range->v[1], range->n > 2 ? ",<step>" : "");
    return RX_OK;
}

rx_status rx_settings_check(const rx_settings *settings, rx_error *err)
{
    for (int row = 0; row < settings->table->nrows; row++)
        RX_TRY(check_row(settings, &settings->table->rows[row], err));
    RX_TRY(settings->table->check(settings, err));
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL; i++)
        RX_TRY(rx_settings_check(settings->part[i], err));
    return RX_OK;
}

/* --- where the files that a configuration names are --- */

static bool there(const rx_text *path)
{
    return !path->failed && access(path->data, F_OK) == 0;
}

/* The file that the row means, where that is not as given, into *path; nothing where it is, or where it is nowhere. */
static void look_for(const rx_settings *settings, const rx_keyword *key, const char *name, rx_text *path)
{
    const char *slash = settings->file != NULL ? strrchr(settings->file, '/') : NULL;
    const bool bare = strchr(name, '/') == NULL; /* its reader takes an installed file of that name first */
    rx_text_add(path, name);
    if (there(path)) {
        rx_text_free(path);
        if (key->search == RX_SEARCH_INSTALLED && bare)
            rx_text_printf(path, "./%s", name);
        return;
    }
    if (name[0] != '/' && slash != NULL) {
        rx_text_free(path);
        rx_text_printf(path, "%.*s/%s", (int)(slash - settings->file), settings->file, name);
    }
    if (!there(path) && bare) {
        rx_text_free(path);
        rx_text_printf(path, "%s/%s", RX_DATA_FOLDER, name);
    }
}

/* Values that follow from others; then the names of input files become those of the files that are meant (rx_file_search). What
 * is not found keeps its name: its reader refuses it. */
static rx_status find_files(rx_settings *settings, rx_log *log, rx_error *err)
{
    rx_status status = RX_OK;
    rx_text said = {0}; /* in one line of the log */
    if (settings->table->settle != NULL)
        RX_TRY(settings->table->settle(settings, err));
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL; i++)
        if (settings->part[i]->table->settle != NULL)
            RX_TRY(settings->part[i]->table->settle(settings->part[i], err));
    for (int row = 0; row < settings->table->nrows && status == RX_OK; row++) {
        const rx_keyword *key = &settings->table->rows[row];
        rx_text path = {0};
        if (key->search == RX_SEARCH_NONE || settings->origin[row] == RX_FROM_DEFAULT ||
            !rx_keyword_counts(settings, row))
            continue;
        const char *name = *(char *const *)((const char *)settings + key->offset);
        if (name[0] == '\0')
            continue;
        look_for(settings, key, name, &path);
        const char *joint = said.length > 0 ? "; " : "";
        if (path.failed)
            status = rx_error_memory(err, 0);
        else if (path.data != NULL && there(&path)) {
            char *found = path.data;
            rx_text_printf(&said, "%s%s %s is %s", joint, key->name, name, found);
            status = rx_keyword_assign(settings, row, &found, 1, (rx_place){0}, NULL, err);
        } else if (path.data != NULL && key->search == RX_SEARCH_BUILT_IN && strcmp(name, key->initial) == 0)
            rx_text_printf(&said, "%s%s %s is found nowhere: the built-in one is used", joint, key->name,
                           name);
        rx_text_free(&path);
    }
    if (said.failed && status == RX_OK)
        status = rx_error_memory(err, 0);
    else if (said.length > 0)
        rx_log_info(log, "%s", said.data);
    rx_text_free(&said);
    return status;
}

rx_status rx_settings_complete(rx_settings *settings, rx_log *log, rx_error *err)
{
    RX_TRY(find_files(settings, log, err));
    return rx_settings_check(settings, err);
}
