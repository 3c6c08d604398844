/* Which keywords were given in vain. */
#include "config/idle.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "config/keyword.h"

enum { NO_ROW = -1, COLUMN = -2 };
static const char NOT[] = "no ";

/* Does the keyword have this item? Without a word: is it on, that is, not empty, NONE, N or 0? */
static bool has_item(const rx_settings *settings, int row, const char *word)
{
    const rx_kind kind = settings->table->rows[row].kind;
    const void *field = (const char *)settings + settings->table->rows[row].offset;
    for (int i = 0; i < rx_keyword_count(kind, field); i++) {
        rx_kind is;
        const void *item = rx_keyword_item(kind, field, i, &is);
        const char *text = is == RX_KIND_BOOL   ? (*(const bool *)item ? "Y" : "N")
                           : is == RX_KIND_INT  ? (*(const int *)item != 0 ? "1" : "")
                           : is == RX_KIND_REAL ? (*(const double *)item != 0 ? "1" : "")
                                                : *(char *const *)item;
        const bool on = text[0] != '\0' && strcmp(text, "NONE") != 0 && strcmp(text, "N") != 0;
        if (word == NULL ? on : strcmp(text, word) == 0)
            return true;
    }
    return false;
}

/* One condition, up to a semicolon: alternatives by commas and "or", each a keyword that is on, a keyword with one of
 * its words, or "column" with parts of names; or "no" and a keyword that is not on. Is one of them met, and is a keyword
 * among them stated? *only: the row of the keyword, where there is but one. */
static bool is_met(const rx_idle *idle, const rx_settings *settings, const char *condition, size_t length,
                   bool *stated, int *only)
{
    int row = NO_ROW;
    bool met = false, alone = false;
    *stated = false;
    *only = NO_ROW;
    if (strncmp(condition, NOT, strlen(NOT)) == 0) {
        char name[48];
        snprintf(name, sizeof name, "%.*s", (int)(length - strlen(NOT)), condition + strlen(NOT));
        return !has_item(settings, rx_keyword_find(settings->table, name), NULL);
    }
    for (size_t at = 0, size = 0; at < length; at += size + strspn(condition + at + size, " ,")) {
        char word[48];
        size = strcspn(condition + at, " ,;");
        snprintf(word, sizeof word, "%.*s", (int)size, condition + at);
        const int named = strcmp(word, "column") == 0 ? COLUMN : rx_keyword_find(settings->table, word);
        if (strcmp(word, "or") == 0)
            continue;
        if (named == NO_ROW) {
            met |= row == COLUMN ? idle->has_column == NULL || idle->has_column(idle->columns, word)
                                 : has_item(settings, row, word);
            alone = false;
            continue;
        }
        met |= alone && has_item(settings, row, NULL);
        *only = row == NO_ROW ? named : COLUMN;
        row = named;
        alone = row != COLUMN;
        /* A file that states what decides over a keyword holds that ready on purpose. Own keywords are stated by a
         * line that is not the default's: a dump that was edited has them all, and those who come from SExtractor do
         * not know them. */
        *stated |=
            settings->table != rx_keytable_train() && /* whose files hold nothing ready */
            (row == COLUMN || settings->origin[row] > RX_FROM_DUMP ||
             (settings->origin[row] == RX_FROM_DUMP && settings->table->rows[row].status == RX_STATUS_SEX));
    }
    return met || (alone && has_item(settings, row, NULL));
}

/* The first condition of a keyword that is not met, its length behind *length; NULL = it has its effect. A condition that
 * names one keyword has the conditions of that one as well. `strict`: whether a file states what decides or not. */
static const char *unmet(const rx_idle *idle, const rx_settings *settings, int row, bool strict, int *length)
{
    const char *condition = settings->table->rows[row].needs, *deeper;
    while (condition != NULL && *condition != '\0') {
        const size_t size = strcspn(condition, ";");
        bool stated;
        int only;
        if (!is_met(idle, settings, condition, size, &stated, &only) && (strict || !stated)) {
            *length = (int)size;
            return condition;
        }
        if (only >= 0 && (deeper = unmet(idle, settings, only, strict, length)) != NULL)
            return deeper;
        condition += size + strspn(condition + size, "; ");
    }
    return NULL;
}

bool rx_keyword_counts(const rx_settings *settings, int row)
{
    const rx_idle any_column = {0};
    int length;
    return unmet(&any_column, settings, row, true, &length) == NULL;
}

/* Why row has no effect, into *why; nothing when it has, or when it was not given. */
static void explain(const rx_idle *idle, const rx_settings *settings, int row, rx_text *why)
{
    const rx_keyword *key = &settings->table->rows[row];
    const char *where = key->status == RX_STATUS_IGNORED ? "here" : rx_keyword_idle(settings, row);
    const char *condition = NULL;
    rx_text value = {0};
    int length = 0;
    if (settings->origin[row] <= RX_FROM_DUMP)
        return;
    if (where == NULL && settings->prefix[0] == '\0')
        condition = unmet(idle, settings, row, settings->origin[row] == RX_FROM_COMMAND, &length);
    const int skip = condition != NULL && strncmp(condition, NOT, strlen(NOT)) == 0 ? (int)strlen(NOT) : 0;
    rx_keyword_print(&value, settings, row, false);
    if (value.failed)
        why->failed = true;
    else if (where != NULL && strcmp(value.data, key->initial) != 0)
        rx_text_printf(why, "%s%s %s has no effect %s (%s)", settings->prefix, key->name, value.data, where,
                       key->help);
    else if (skip > 0)
        rx_text_printf(why, "%s %s has no effect with %.*s", key->name, value.data, length - skip,
                       condition + skip);
    else if (condition != NULL)
        rx_text_printf(why, "%s %s has no effect without %.*s", key->name, value.data, length, condition);
    rx_text_free(&value);
}

/* The rows from *at on. */
static rx_status add_rows(rx_idle *idle, int *at, const rx_settings *settings, rx_error *err)
{
    for (int row = 0; row < settings->table->nrows; row++, ++*at) {
        rx_text why = {0};
        if (settings->table->rows[row].kind == RX_KIND_SECTION)
            continue;
        explain(idle, settings, row, &why);
        if (why.length == 0)
            idle->counts[*at] |= settings->origin[row] > RX_FROM_DUMP;
        if (!why.failed && idle->why[*at] == NULL) {
            idle->why[*at] = why.data;
            continue;
        }
        const bool failed = why.failed;
        rx_text_free(&why);
        if (failed)
            return rx_error_memory(err, 0);
    }
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL; i++)
        RX_TRY(add_rows(idle, at, settings->part[i], err));
    return RX_OK;
}

static int count_rows(const rx_settings *settings)
{
    int n = settings->table->nrows;
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL; i++)
        n += count_rows(settings->part[i]);
    return n;
}

rx_status rx_idle_add(rx_idle *idle, const rx_settings *settings, rx_error *err)
{
    int at = 0;
    if (idle->why == NULL) {
        idle->nrows = count_rows(settings);
        RX_TRY(RX_MAKE(idle->why, (size_t)idle->nrows, err));
        RX_TRY(RX_MAKE(idle->counts, (size_t)idle->nrows, err));
    }
    return add_rows(idle, &at, settings, err);
}

void rx_idle_warn(rx_idle *idle, rx_log *log)
{
    rx_text all = {0};
    const char *last = ""; /* a reason that several keywords have in turn is given once */
    for (int row = 0; row < idle->nrows && idle->why != NULL && idle->counts != NULL; row++) {
        const char *why = idle->why[row], *reason = why != NULL ? strstr(why, " has no effect") : NULL;
        if (reason == NULL || idle->counts[row])
            continue;
        if (strcmp(reason, last) == 0)
            rx_text_printf(&all, "; nor has %.*s", (int)(reason - why), why);
        else
            rx_text_printf(&all, "%s%s", all.length > 0 ? "; " : "", why);
        last = reason;
    }
    if (!all.failed && all.length > 0)
        rx_log_warning(log, "%s", all.data);
    rx_text_free(&all);
}

void rx_idle_free(rx_idle *idle)
{
    for (int row = 0; row < idle->nrows && idle->why != NULL; row++)
        free(idle->why[row]);
    free(idle->why);
    free(idle->counts);
    *idle = (rx_idle){.has_column = idle->has_column, .columns = idle->columns};
}

rx_status rx_settings_warn_idle(const rx_settings *settings, rx_idle idle, rx_log *log, rx_error *err)
{
    const rx_status status = rx_idle_add(&idle, settings, err);
    if (status == RX_OK)
        rx_idle_warn(&idle, log);
    rx_idle_free(&idle);
    return status;
}
