/* Rows of a keyword table, and the values of one keyword: items of text into its field, with range and word checks, and back. */
#include "config/keyword.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "base/point.h"
#include "config/tokens.h"

enum { MAX_NAMES = 384 };

/* --- names --- */

int rx_keyword_find(const rx_keytable *table, const char *name)
{
    for (int row = 0; row < table->nrows; row++)
        if (table->rows[row].kind != RX_KIND_SECTION && strcasecmp(name, table->rows[row].name) == 0)
            return row;
    return -1;
}

/* The row of keyword `name` without prefix and word `value`, NULL where there is none. */
static const rx_gone *gone_row(const rx_keytable *table, const char *name, const char *value)
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

/* Is `name` in a list that ends with NULL? */
static bool is_among(const char *const *names, const char *name)
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
                                      is_among(settings->idle, key->name))
               ? settings->where
               : NULL;
}

/* The known name that is nearest, with its prefix; dst empty when nothing is near. */
static void find_nearest(const rx_keytable *table, const char *name, char *dst, size_t size)
{
    char room[MAX_NAMES][32]; /* a prefix and a name */
    const char *names[MAX_NAMES];
    size_t n = 0;
    for (int part = -1; part < RX_PARTS && (part < 0 || table->part[part].prefix != NULL); part++) {
        const rx_keytable *of = part < 0 ? table : table->part[part].table();
        for (int row = 0; row < of->nrows && n < MAX_NAMES; row++) {
            const char *own = of->rows[row].name;
            if (of->rows[row].kind == RX_KIND_SECTION)
                continue;
            snprintf(room[n], sizeof room[n], "%s%s", part < 0 ? "" : table->part[part].prefix, own);
            if (part >= 0 && strcasecmp(own, name) == 0) { /* only the prefix is missing */
                snprintf(dst, size, "%s", room[n]);
                return;
            }
            names[n] = room[n];
            n++;
        }
    }
    const char *near = rx_text_nearest(name, names, n);
    snprintf(dst, size, "%s", near != NULL ? near : "");
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

/* RX_USAGE at a place; of the command line the text has a dash in front. */
RX_PRINTF(3, 4)
static rx_status refuse_at(rx_place place, rx_error *err, const char *format, ...)
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
    return refuse_at(place, err, "%.80s is no longer a keyword; %s", name, gone->instead);
}

rx_status rx_keyword_look_up(const rx_keytable *table, const char *name, rx_place place, rx_named *dst,
                             rx_error *err)
{
    const char *rest = name;
    dst->part = take_prefix(table, &rest);
    const rx_keytable *owner = dst->part < 0 ? table : table->part[dst->part].table();
    dst->row = rx_keyword_find(owner, rest);
    dst->gone = dst->row < 0 ? gone_row(owner, rest, NULL) : NULL;
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

rx_status rx_settings_refuse(const rx_settings *settings, const char *name, rx_error *err, const char *format,
                             ...)
{
    char text[RX_ERROR_TEXT];
    rx_place place = {0};
    const int row = rx_keyword_find(settings->table, name);
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (row >= 0 && settings->line[row] > 0 && settings->origin[row] != RX_FROM_COMMAND)
        place = (rx_place){.file = settings->file, .line = settings->line[row]};
    return refuse_at(place, err, "%s%s: %s", settings->prefix, name, text);
}

/* --- values --- */

/* A value while it is read, before it replaces the old one; a scalar is a list of one until then. */
typedef union scratch {
    rx_strings strings;
    rx_ints ints;
    rx_reals reals;
    rx_bools bools;
    rx_words words;
} scratch;

/* How a kind lies in memory: one item, or a list that begins with their number. */
typedef struct layout {
    rx_kind item;
    bool list;
    size_t size, field, first; /* of an item, of the field; where a list's items begin */
} layout;

#define LAYOUT(ITEM, IS_LIST, TYPE, LIST)                                                                    \
    {                                                                                                        \
        ITEM, IS_LIST, sizeof(TYPE), (IS_LIST) ? sizeof(LIST) : sizeof(TYPE), offsetof(LIST, v)              \
    }

static const layout *layout_of(rx_kind kind)
{
    static const layout all[] = {
        [RX_KIND_STRING] = LAYOUT(RX_KIND_STRING, false, char *, rx_strings),
        [RX_KIND_INT] = LAYOUT(RX_KIND_INT, false, int, rx_ints),
        [RX_KIND_REAL] = LAYOUT(RX_KIND_REAL, false, double, rx_reals),
        [RX_KIND_BOOL] = LAYOUT(RX_KIND_BOOL, false, bool, rx_bools),
        [RX_KIND_WORD] = LAYOUT(RX_KIND_WORD, false, const char *, rx_words),
        [RX_KIND_STRINGS] = LAYOUT(RX_KIND_STRING, true, char *, rx_strings),
        [RX_KIND_INTS] = LAYOUT(RX_KIND_INT, true, int, rx_ints),
        [RX_KIND_REALS] = LAYOUT(RX_KIND_REAL, true, double, rx_reals),
        [RX_KIND_BOOLS] = LAYOUT(RX_KIND_BOOL, true, bool, rx_bools),
        [RX_KIND_WORDS] = LAYOUT(RX_KIND_WORD, true, const char *, rx_words),
    };
    return &all[kind];
}

int rx_keyword_count(rx_kind kind, const void *field)
{
    return layout_of(kind)->list ? *(const int *)field : 1;
}

const void *rx_keyword_item(rx_kind kind, const void *field, int i, rx_kind *item)
{
    const layout *l = layout_of(kind);
    *item = l->item;
    return (const char *)field + (l->list ? l->first + (size_t)i * l->size : 0);
}

/* The keyword that is read, with its prefix, and from where. */
typedef struct target {
    const rx_keytable *table;
    const rx_keyword *key;
    const char *prefix;
    rx_place place;
} target;

/* "KEY: text" with the place in front. */
RX_PRINTF(3, 4)
static rx_status refuse(const target *at, rx_error *err, const char *format, ...)
{
    char text[RX_ERROR_TEXT];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return refuse_at(at->place, err, "%s%s: %s", at->prefix, at->key->name, text);
}

static rx_status read_real(const target *at, const char *item, double *dst, rx_error *err)
{
    char *end = NULL;
    *dst = rx_point_number(item, &end);
    if (end == item || *end != '\0' || !isfinite(*dst) || strpbrk(item, "xX") != NULL)
        return refuse(at, err, "'%.80s' is not a number", item);
    if (*dst < at->key->low || *dst > at->key->high)
        return refuse(at, err, "%.80s is out of range, give %.10g to %.10g", item, at->key->low,
                      at->key->high);
    return RX_OK;
}

static rx_status read_word(const target *at, const char *item, const char **dst, rx_error *err)
{
    size_t n = 0;
    for (; at->key->words[n] != NULL; n++)
        if (strcasecmp(item, at->key->words[n]) == 0) {
            *dst = at->key->words[n];
            return RX_OK;
        }
    const rx_gone *gone = gone_row(at->table, at->key->name, item);
    if (gone != NULL)
        return refuse(at, err, "%s is no longer offered; %s", gone->value, gone->instead);
    static const char *const tables[] = {"CSV", "ECSV", "TSV", "PARQUET", "HDF5"};
    for (size_t i = 0; is_among(at->key->words, "ASCII_VOTABLE") && i < sizeof tables / sizeof *tables; i++)
        if (strcasecmp(item, tables[i]) == 0)
            return refuse(
                at, err,
                "%s is not written; give FITS_1.0 or ASCII_VOTABLE, which astropy, stilts and TOPCAT "
                "turn into it (docs/from-sextractor.md)",
                tables[i]);
    rx_text text = {0};
    const char *near = rx_text_nearest(item, at->key->words, n);
    rx_text_printf(&text, "unknown word '%.80s'", item);
    if (near != NULL)
        rx_text_printf(&text, " (did you mean %s?)", near);
    rx_text_add(&text, "; give one of ");
    for (size_t i = 0; i < n; i++)
        rx_text_printf(&text, "%s%s", i > 0 ? ", " : "", at->key->words[i]);
    rx_status status = refuse(at, err, "%s", text.failed ? "unknown word" : text.data);
    rx_text_free(&text);
    return status;
}

/* Number of items against what the row allows. A scalar in a file may be followed by other text, as
 * SExtractor has it: a warning; everywhere else too many is an error. *n becomes the used number. */
static rx_status count_items(const target *at, char *const *items, int *n, rx_log *log, rx_error *err)
{
    if (*n < at->key->nmin && *n == 0)
        return refuse(at, err, "has no value; give one, or remove the keyword");
    if (*n < at->key->nmin)
        return refuse(at, err, "has %d item(s), needs at least %d", *n, at->key->nmin);
    if (*n <= at->key->nmax)
        return RX_OK;
    if (layout_of(at->key->kind)->list || at->place.file == NULL)
        return refuse(at, err, "has %d items, takes at most %d", *n, at->key->nmax);
    rx_log_warning(log, "%s:%ld: %s%s takes one value, '%s' is ignored", at->place.file, at->place.line,
                   at->prefix, at->key->name, items[at->key->nmax]);
    *n = at->key->nmax;
    return RX_OK;
}

/* Item i into the scratch value. */
static rx_status read_item(const target *at, const char *item, int i, scratch *value, rx_error *err)
{
    const bool yes = strcasecmp(item, "Y") == 0 || strcasecmp(item, "YES") == 0;
    double number = 0;
    switch (layout_of(at->key->kind)->item) {
    case RX_KIND_STRING:
        value->strings.v[i] = rx_strdup(item);
        value->strings.n = i + 1;
        return value->strings.v[i] != NULL ? RX_OK : rx_error_memory(err, strlen(item));
    case RX_KIND_INT:
        RX_TRY(read_real(at, item, &number, err));
        value->ints.v[i] = (int)number;
        return number == floor(number) ? RX_OK : refuse(at, err, "%.80s is not a whole number", item);
    case RX_KIND_REAL:
        return read_real(at, item, &value->reals.v[i], err);
    case RX_KIND_BOOL:
        value->bools.v[i] = yes;
        return yes || strcasecmp(item, "N") == 0 || strcasecmp(item, "NO") == 0
                   ? RX_OK
                   : refuse(at, err, "'%.80s' is not Y or N", item);
    case RX_KIND_WORD:
        return read_word(at, item, &value->words.v[i], err);
    default:
        return RX_OK;
    }
}

rx_status rx_keyword_assign(rx_settings *settings, int row, char *const *items, int n, rx_place place,
                            rx_log *log, rx_error *err)
{
    const rx_keyword *key = &settings->table->rows[row];
    const target at = {.table = settings->table, .key = key, .prefix = settings->prefix, .place = place};
    scratch value;
    char *empty[] = {""};
    memset(&value, 0, sizeof value);
    if (key->kind == RX_KIND_STRINGS && n == 1 && items[0][0] == '\0')
        n = 0;
    rx_status status = RX_OK;
    RX_TRY(count_items(&at, items, &n, log, err));
    if (key->kind == RX_KIND_STRING && key->nmin == 0 && (n == 0 || strcasecmp(items[0], "NONE") == 0)) {
        items = empty;
        n = 1;
    }
    const layout *l = layout_of(key->kind);
    for (int i = 0; i < n && status == RX_OK; i++)
        status = items[i][0] == '\0' && key->nmin > 0
                     ? refuse(&at, err, "has an empty value; give one, or remove the keyword")
                     : read_item(&at, items[i], i, &value, err);
    for (int i = 0; status != RX_OK && l->item == RX_KIND_STRING && i < value.strings.n; i++)
        free(value.strings.v[i]);
    if (status != RX_OK)
        return status;
    value.ints.n = n;
    rx_keyword_clear(settings, row);
    memcpy((char *)settings + key->offset, (const char *)&value + (l->list ? 0 : l->first), l->field);
    return RX_OK;
}

/* The strings of a field, NULL where it holds others; *n of them. */
static char **strings_of(const rx_keyword *key, void *field, int *n)
{
    const layout *l = layout_of(key->kind);
    *n = rx_keyword_count(key->kind, field);
    return l->item == RX_KIND_STRING ? (char **)((char *)field + (l->list ? l->first : 0)) : NULL;
}

rx_status rx_keyword_copy(rx_settings *dst, const rx_settings *src, int row, rx_error *err)
{
    const rx_keyword *key = &src->table->rows[row];
    void *to = (char *)dst + key->offset;
    int n;
    rx_keyword_clear(dst, row);
    memcpy(to, (const char *)src + key->offset, layout_of(key->kind)->field);
    char **strings = strings_of(key, to, &n);
    bool failed = false;
    for (int i = 0; strings != NULL && i < n; i++) {
        strings[i] = failed ? NULL : rx_strdup(strings[i]);
        failed |= strings[i] == NULL;
    }
    return failed ? rx_error_memory(err, 0) : RX_OK;
}

static rx_status replace(char **string, const char *what, const char *with, rx_error *err)
{
    rx_text text = {0};
    const char *rest = *string;
    for (const char *at; (at = strstr(rest, what)) != NULL; rest = at + strlen(what)) {
        rx_text_add_bytes(&text, rest, (size_t)(at - rest));
        rx_text_add(&text, with);
    }
    if (rest == *string)
        return RX_OK;
    rx_text_add(&text, rest);
    if (text.failed) {
        rx_text_free(&text);
        return rx_error_memory(err, 0);
    }
    free(*string);
    *string = text.data;
    return RX_OK;
}

rx_status rx_keyword_replace(rx_settings *settings, int row, const char *what, const char *with,
                             rx_error *err)
{
    int n;
    char **strings =
        strings_of(&settings->table->rows[row], (char *)settings + settings->table->rows[row].offset, &n);
    for (int i = 0; strings != NULL && i < n; i++)
        RX_TRY(replace(&strings[i], what, with, err));
    return RX_OK;
}

void rx_keyword_clear(rx_settings *settings, int row)
{
    const rx_keyword *key = &settings->table->rows[row];
    int n;
    void *field = (char *)settings + key->offset;
    char **strings = strings_of(key, field, &n);
    for (int i = 0; strings != NULL && i < n; i++)
        free(strings[i]);
    memset(field, 0, layout_of(key->kind)->field);
}

/* Shortest decimal that reads back as the same double. */
static void print_real(rx_text *dst, double value)
{
    char text[40] = "";
    rx_point_locale locale;
    (void)rx_point_locale_begin(&locale, NULL);
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value)
            break;
    }
    rx_point_locale_end(&locale);
    rx_text_add(dst, text);
}

/* Quotes where the reader would cut or drop something; '$' and '"' doubled. */
static void print_string(rx_text *dst, const char *value, bool quoted)
{
    bool marks = quoted && (value[0] == '\0' || strpbrk(value, " \t\r\n\v\f=,;\"#[]") != NULL);
    if (marks)
        rx_text_add(dst, "\"");
    for (const char *c = value; *c != '\0'; c++) {
        rx_text_add_bytes(dst, c, 1);
        if (quoted && (*c == '$' || *c == '"'))
            rx_text_add_bytes(dst, c, 1);
    }
    if (marks)
        rx_text_add(dst, "\"");
}

void rx_keyword_print(rx_text *dst, const rx_settings *settings, int row, bool quoted)
{
    const rx_keyword *key = &settings->table->rows[row];
    const void *field = (const char *)settings + key->offset;
    rx_text_add(dst, ""); /* never NULL, even for an empty value */
    for (int i = 0; i < rx_keyword_count(key->kind, field); i++) {
        rx_kind kind;
        const void *item = rx_keyword_item(key->kind, field, i, &kind);
        if (i > 0)
            rx_text_add(dst, ",");
        if (kind == RX_KIND_STRING)
            print_string(dst, *(char *const *)item, quoted);
        else if (kind == RX_KIND_INT)
            rx_text_printf(dst, "%d", *(const int *)item);
        else if (kind == RX_KIND_REAL)
            print_real(dst, *(const double *)item);
        else
            rx_text_add(dst, kind != RX_KIND_BOOL  ? *(const char *const *)item
                             : *(const bool *)item ? "Y"
                                                   : "N");
    }
}
