/* Values of keywords: items of text into fields, with range and word checks, and back. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "base/point.h"
#include "config/keyword.h"

/* A value while it is read, before it replaces the old one. */
typedef union scratch {
    char *string;
    rx_strings strings;
    rx_ints ints;
    rx_reals reals;
    rx_bools bools;
    rx_words words;
} scratch;

/* The keyword that is read, with its prefix, and from where. */
typedef struct target {
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
    if (at->place.file != NULL)
        return rx_error_at(err, RX_USAGE, at->place.file, -1, at->place.line, "%s%s: %s", at->prefix,
                           at->key->name, text);
    return rx_error_set(err, RX_USAGE, "-%s%s: %s", at->prefix, at->key->name, text);
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

static rx_status read_int(const target *at, const char *item, int *dst, rx_error *err)
{
    double value;
    RX_TRY(read_real(at, item, &value, err));
    if (value != floor(value))
        return refuse(at, err, "%.80s is not a whole number", item);
    *dst = (int)value;
    return RX_OK;
}

static rx_status read_bool(const target *at, const char *item, bool *dst, rx_error *err)
{
    *dst = strcasecmp(item, "Y") == 0 || strcasecmp(item, "YES") == 0;
    if (*dst || strcasecmp(item, "N") == 0 || strcasecmp(item, "NO") == 0)
        return RX_OK;
    return refuse(at, err, "'%.80s' is not Y or N", item);
}

static rx_status read_word(const target *at, const char *item, const char **dst, rx_error *err)
{
    size_t n = 0;
    for (; at->key->words[n] != NULL; n++)
        if (strcasecmp(item, at->key->words[n]) == 0) {
            *dst = at->key->words[n];
            return RX_OK;
        }
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

static bool is_list(rx_kind kind)
{
    return kind >= RX_KIND_STRINGS;
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
    if (is_list(at->key->kind) || at->place.file == NULL)
        return refuse(at, err, "has %d items, takes at most %d", *n, at->key->nmax);
    rx_log_warning(log, "%s:%ld: %s%s takes one value, '%s' is ignored", at->place.file, at->place.line,
                   at->prefix, at->key->name, items[at->key->nmax]);
    *n = at->key->nmax;
    return RX_OK;
}

/* Item i into the scratch value; scalars are lists of one until the end. */
static rx_status read_item(const target *at, const char *item, int i, scratch *value, rx_error *err)
{
    switch (at->key->kind) {
    case RX_KIND_STRING:
    case RX_KIND_STRINGS:
        value->strings.v[i] = rx_strdup(item);
        value->strings.n = i + 1;
        return value->strings.v[i] != NULL ? RX_OK : rx_error_memory(err, strlen(item));
    case RX_KIND_INT:
    case RX_KIND_INTS:
        return read_int(at, item, &value->ints.v[i], err);
    case RX_KIND_REAL:
    case RX_KIND_REALS:
        return read_real(at, item, &value->reals.v[i], err);
    case RX_KIND_BOOL:
    case RX_KIND_BOOLS:
        return read_bool(at, item, &value->bools.v[i], err);
    case RX_KIND_WORD:
    case RX_KIND_WORDS:
        return read_word(at, item, &value->words.v[i], err);
    case RX_KIND_SECTION:
        break;
    }
    return RX_OK;
}

/* The read value of n items takes the place of the field's old one. */
static void move_in(rx_settings *settings, int row, const scratch *value, int n)
{
    const rx_keyword *key = &settings->table->rows[row];
    void *field = (char *)settings + key->offset;
    rx_keyword_clear(settings, row);
    switch (key->kind) {
    case RX_KIND_STRING:
        *(char **)field = value->strings.v[0];
        break;
    case RX_KIND_INT:
        *(int *)field = value->ints.v[0];
        break;
    case RX_KIND_REAL:
        *(double *)field = value->reals.v[0];
        break;
    case RX_KIND_BOOL:
        *(bool *)field = value->bools.v[0];
        break;
    case RX_KIND_WORD:
        *(const char **)field = value->words.v[0];
        break;
    case RX_KIND_STRINGS:
        *(rx_strings *)field = value->strings;
        ((rx_strings *)field)->n = n;
        break;
    case RX_KIND_INTS:
        *(rx_ints *)field = value->ints;
        ((rx_ints *)field)->n = n;
        break;
    case RX_KIND_REALS:
        *(rx_reals *)field = value->reals;
        ((rx_reals *)field)->n = n;
        break;
    case RX_KIND_BOOLS:
        *(rx_bools *)field = value->bools;
        ((rx_bools *)field)->n = n;
        break;
    case RX_KIND_WORDS:
        *(rx_words *)field = value->words;
        ((rx_words *)field)->n = n;
        break;
    case RX_KIND_SECTION:
        break;
    }
}

rx_status rx_keyword_assign(rx_settings *settings, int row, char *const *items, int n, rx_place place,
                            rx_log *log, rx_error *err)
{
    const rx_keyword *key = &settings->table->rows[row];
    const target at = {.key = key, .prefix = settings->prefix, .place = place};
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
    for (int i = 0; i < n; i++) {
        status = items[i][0] == '\0' && key->nmin > 0
                     ? refuse(&at, err, "has an empty value; give one, or remove the keyword")
                     : read_item(&at, items[i], i, &value, err);
        if (status != RX_OK) {
            if (key->kind == RX_KIND_STRING || key->kind == RX_KIND_STRINGS)
                for (int j = 0; j < value.strings.n; j++)
                    free(value.strings.v[j]);
            return status;
        }
    }
    move_in(settings, row, &value, n);
    return RX_OK;
}

static size_t field_size(rx_kind kind)
{
    switch (kind) {
    case RX_KIND_STRING:
        return sizeof(char *);
    case RX_KIND_INT:
        return sizeof(int);
    case RX_KIND_REAL:
        return sizeof(double);
    case RX_KIND_BOOL:
        return sizeof(bool);
    case RX_KIND_WORD:
        return sizeof(const char *);
    case RX_KIND_STRINGS:
        return sizeof(rx_strings);
    case RX_KIND_INTS:
        return sizeof(rx_ints);
    case RX_KIND_REALS:
        return sizeof(rx_reals);
    case RX_KIND_BOOLS:
        return sizeof(rx_bools);
    case RX_KIND_WORDS:
        return sizeof(rx_words);
    case RX_KIND_SECTION:
        break;
    }
    return 0;
}

rx_status rx_keyword_copy(rx_settings *dst, const rx_settings *src, int row, rx_error *err)
{
    const rx_keyword *key = &src->table->rows[row];
    const void *from = (const char *)src + key->offset;
    void *to = (char *)dst + key->offset;
    rx_keyword_clear(dst, row);
    if (key->kind == RX_KIND_STRING) {
        const char *value = *(char *const *)from;
        *(char **)to = rx_strdup(value);
        return *(char **)to != NULL ? RX_OK : rx_error_memory(err, strlen(value));
    }
    if (key->kind != RX_KIND_STRINGS) {
        memcpy(to, from, field_size(key->kind));
        return RX_OK;
    }
    rx_strings *list = to;
    for (int i = 0; i < ((const rx_strings *)from)->n; i++) {
        const char *value = ((const rx_strings *)from)->v[i];
        list->v[i] = rx_strdup(value);
        if (list->v[i] == NULL)
            return rx_error_memory(err, strlen(value));
        list->n = i + 1;
    }
    return RX_OK;
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
    const rx_keyword *key = &settings->table->rows[row];
    void *field = (char *)settings + key->offset;
    rx_status status = RX_OK;
    if (key->kind == RX_KIND_STRING)
        status = replace(field, what, with, err);
    for (int i = 0; key->kind == RX_KIND_STRINGS && i < ((rx_strings *)field)->n && status == RX_OK; i++)
        status = replace(&((rx_strings *)field)->v[i], what, with, err);
    return status;
}

void rx_keyword_clear(rx_settings *settings, int row)
{
    const rx_keyword *key = &settings->table->rows[row];
    void *field = (char *)settings + key->offset;
    if (key->kind == RX_KIND_STRING) {
        free(*(char **)field);
        *(char **)field = NULL;
    } else if (key->kind == RX_KIND_STRINGS) {
        rx_strings *list = field;
        for (int i = 0; i < list->n; i++)
            free(list->v[i]);
        *list = (rx_strings){0};
    }
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

int rx_keyword_count(rx_kind kind, const void *field)
{
    switch (kind) {
    case RX_KIND_STRINGS:
        return ((const rx_strings *)field)->n;
    case RX_KIND_INTS:
        return ((const rx_ints *)field)->n;
    case RX_KIND_REALS:
        return ((const rx_reals *)field)->n;
    case RX_KIND_BOOLS:
        return ((const rx_bools *)field)->n;
    case RX_KIND_WORDS:
        return ((const rx_words *)field)->n;
    default:
        return 1;
    }
}

static void print_value(rx_text *dst, rx_kind kind, const void *field, int i, bool quoted)
{
    switch (kind) {
    case RX_KIND_STRING:
        print_string(dst, *(char *const *)field, quoted);
        break;
    case RX_KIND_STRINGS:
        print_string(dst, ((const rx_strings *)field)->v[i], quoted);
        break;
    case RX_KIND_INT:
        rx_text_printf(dst, "%d", *(const int *)field);
        break;
    case RX_KIND_INTS:
        rx_text_printf(dst, "%d", ((const rx_ints *)field)->v[i]);
        break;
    case RX_KIND_REAL:
        print_real(dst, *(const double *)field);
        break;
    case RX_KIND_REALS:
        print_real(dst, ((const rx_reals *)field)->v[i]);
        break;
    case RX_KIND_BOOL:
        rx_text_add(dst, *(const bool *)field ? "Y" : "N");
        break;
    case RX_KIND_BOOLS:
        rx_text_add(dst, ((const rx_bools *)field)->v[i] ? "Y" : "N");
        break;
    case RX_KIND_WORD:
        rx_text_add(dst, *(const char *const *)field);
        break;
    case RX_KIND_WORDS:
        rx_text_add(dst, ((const rx_words *)field)->v[i]);
        break;
    case RX_KIND_SECTION:
        break;
    }
}

void rx_keyword_print(rx_text *dst, const rx_settings *settings, int row, bool quoted)
{
    const rx_keyword *key = &settings->table->rows[row];
    const void *field = (const char *)settings + key->offset;
    int n = rx_keyword_count(key->kind, field);
    rx_text_add(dst, ""); /* never NULL, even for an empty value */
    for (int i = 0; i < n; i++) {
        if (i > 0)
            rx_text_add(dst, ",");
        print_value(dst, key->kind, field, i, quoted);
    }
}
