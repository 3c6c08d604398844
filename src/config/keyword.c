/* Finding rows of a keyword table. */
#include "config/keyword.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/point.h"
#include "config/tokens.h"

enum { MAX_NAMES = 512 };

int rx_keyword_find(const rx_keytable *table, const char *name)
{
    for (int row = 0; row < table->nrows; row++)
        if (table->rows[row].kind != RX_KIND_SECTION && strcasecmp(name, table->rows[row].name) == 0)
            return row;
    return -1;
}

const rx_gone *rx_keyword_gone(const rx_keytable *table, const char *name, const char *value)
{
#define GONE(PROGRAM, NAME, VALUE, INITIAL, INSTEAD) {PROGRAM, NAME, VALUE, INITIAL, INSTEAD},
    static const rx_gone rows[] = {
#include "config/gone.def"
        {0}};
#undef GONE
    for (const rx_gone *row = rows; row->name != NULL; row++)
        if (strcmp(row->program, table->program) == 0 && strcasecmp(row->name, name) == 0 &&
            (value == NULL ? row->value == NULL : row->value != NULL && strcasecmp(row->value, value) == 0))
            return row;
    return NULL;
}

bool rx_keyword_among(const char *const *names, const char *name)
{
    for (; *names != NULL; names++)
        if (strcmp(*names, name) == 0)
            return true;
    return false;
}

/* The part that a prefixed name is for, *name then behind the prefix; -1 when it is for the table itself. */
static int take_prefix(const rx_keytable *table, const char **name)
{
    for (int part = 0; part < RX_PARTS && table->part[part].prefix != NULL; part++) {
        size_t length = strlen(table->part[part].prefix);
        if (strncasecmp(*name, table->part[part].prefix, length) == 0) {
            *name += length;
            return part;
        }
    }
    return -1;
}

const char *rx_keyword_idle(const rx_settings *settings, int row)
{
    const rx_keyword *key = &settings->table->rows[row];
    return settings->idle != NULL && (key->role == RX_FILE_WRITES || key->role == RX_FILE_FOLDER ||
                                      rx_keyword_among(settings->idle, key->name))
               ? settings->where
               : NULL;
}

/* The own keyword of the table that is nearest, or NULL. */
static const char *nearest_row(const rx_keytable *table, const char *name)
{
    const char *names[MAX_NAMES];
    size_t n = 0;
    for (int row = 0; row < table->nrows && n < MAX_NAMES; row++)
        if (table->rows[row].kind != RX_KIND_SECTION)
            names[n++] = table->rows[row].name;
    return rx_text_nearest(name, names, n);
}

/* The part whose prefix is nearest to what stands before the dot, -1 where none is; *name moves behind the dot. */
static int nearest_part(const rx_keytable *table, const char **name)
{
    const char *prefixes[RX_PARTS] = {0};
    char head[16];
    size_t n = 0, length = strcspn(*name, ".") + 1;
    if (length >= sizeof head || (*name)[length - 1] != '.')
        return -1;
    snprintf(head, sizeof head, "%.*s", (int)length, *name);
    *name += length;
    for (; n < RX_PARTS && table->part[n].prefix != NULL; n++)
        prefixes[n] = table->part[n].prefix;
    const char *near = rx_text_nearest(head, prefixes, n);
    int part = (int)n - 1;
    while (part >= 0 && (near == NULL || prefixes[part] != near))
        part--;
    return part;
}

/* The known name that is nearest, with its prefix; dst empty when nothing is near. */
static void find_nearest(const rx_keytable *table, const char *name, char *dst, size_t size)
{
    const char *rest = name;
    int part = nearest_part(table, &rest);
    const char *near = part >= 0 ? nearest_row(table->part[part].table(), rest) : NULL;
    for (int i = 0; part < 0 && i < RX_PARTS && table->part[i].prefix != NULL; i++)
        if (rx_keyword_find(table->part[i].table(), name) >= 0) { /* only the prefix is missing */
            part = i;
            near = name;
        }
    const char *prefix = near != NULL ? table->part[part].prefix : "";
    if (near == NULL)
        near = nearest_row(table, name);
    snprintf(dst, size, "%s%s", prefix, near != NULL ? near : "");
}

static rx_status unknown_keyword(const rx_keytable *table, const char *name, rx_place place, rx_error *err)
{
    char near[64], hint[96] = "-dd lists all";
    if (place.file == NULL)
        snprintf(hint, sizeof hint, "see %s -h", table->program);
    find_nearest(table, name, near, sizeof near);
    if (near[0] != '\0')
        snprintf(hint, sizeof hint, "did you mean %s%s?", place.file != NULL ? "" : "-", near);
    if (place.file != NULL)
        return rx_error_at(err, RX_USAGE, place.file, -1, place.line, "unknown keyword '%.80s'; %s", name,
                           hint);
    return rx_error_set(err, RX_USAGE, "unknown keyword '-%.80s'; %s", name, hint);
}

rx_status rx_keyword_refuse(rx_place place, rx_error *err, const char *format, ...)
{
    char text[RX_ERROR_TEXT];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return place.file != NULL ? rx_error_at(err, RX_USAGE, place.file, -1, place.line, "%s", text)
                              : rx_error_set(err, RX_USAGE, "-%s", text);
}

static rx_status refuse_gone(const rx_gone *gone, const char *name, rx_place place, rx_error *err)
{
    return rx_keyword_refuse(place, err, "%.80s is no longer a keyword; %s", name, gone->instead);
}

rx_status rx_keyword_look_up(const rx_keytable *table, const char *name, rx_place place, rx_named *dst,
                             rx_error *err)
{
    const char *rest = name;
    dst->part = take_prefix(table, &rest);
    const rx_keytable *owner = dst->part < 0 ? table : table->part[dst->part].table();
    dst->row = rx_keyword_find(owner, rest);
    dst->gone = dst->row < 0 ? rx_keyword_gone(owner, rest, NULL) : NULL;
    return dst->row >= 0                ? RX_OK
           : dst->gone == NULL          ? unknown_keyword(table, name, place, err)
           : dst->gone->initial != NULL ? RX_OK
                                        : refuse_gone(dst->gone, name, place, err);
}

/* The same items, numbers by their value? */
static bool is_same_value(char *const *items, int n, char *const *others, int nothers)
{
    bool same = n == nothers;
    for (int i = 0; i < n && same; i++) {
        char *end[2];
        const double value = rx_point_number(items[i], &end[0]), other = rx_point_number(others[i], &end[1]);
        same = strcasecmp(items[i], others[i]) == 0 ||
               (*end[0] == '\0' && *end[1] == '\0' && end[0] != items[i] && value == other);
    }
    return same;
}

rx_status rx_keyword_check_gone(const rx_gone *gone, const char *name, char *const *values, int n,
                                rx_place place, rx_error *err)
{
    rx_tokens initial = {0};
    rx_status status = rx_tokens_read(gone->initial, &initial, err);
    const bool none =
        initial.n == 0 && n == 1 && (values[0][0] == '\0' || strcasecmp(values[0], "NONE") == 0);
    if (status == RX_OK && !none && !is_same_value(values, n, initial.v, initial.n))
        status = refuse_gone(gone, name, place, err);
    rx_tokens_free(&initial);
    return status;
}
