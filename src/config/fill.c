/* From the values of keywords to the fields of params structs. */
#include "config/fill.h"

#include <string.h>
#include <strings.h>

#include "config/keyword.h"

/* Item i of a value as a number; words by what they mean. */
static double number_of(const rx_keyword *key, const int *words, const void *value, int i)
{
    rx_kind kind;
    const void *item = rx_keyword_item(key->kind, value, i, &kind);
    int at = 0;
    if (kind == RX_KIND_INT)
        return *(const int *)item;
    if (kind == RX_KIND_REAL)
        return *(const double *)item;
    if (kind == RX_KIND_BOOL)
        return *(const bool *)item;
    if (kind != RX_KIND_WORD)
        return 0;
    while (strcmp(key->words[at], *(const char *const *)item) != 0) /* the reader takes no other */
        at++;
    return words[at];
}

/* Items that the field can take. */
static int room_of(const rx_fill *row)
{
    switch (row->how) {
    case RX_FILL_ALL:
        return (int)(row->size / (row->type == RX_FILLS_INT ? sizeof(int) : sizeof(double)));
    case RX_FILL_COUNT:
        return 0;
    case RX_FILL_BIT:
        return 1;
    default:
        return row->arg + 1;
    }
}

/* Element `at` of the field; only arrays have more than one. */
static void put(void *field, rx_fill_type type, int at, double value)
{
    if (type == RX_FILLS_INT)
        ((int *)field)[at] = (int)value;
    else if (type == RX_FILLS_DOUBLE)
        ((double *)field)[at] = value;
    else if (type == RX_FILLS_UNSIGNED)
        *(unsigned *)field = (unsigned)value;
    else if (type == RX_FILLS_LONG)
        *(long *)field = (long)value;
    else if (type == RX_FILLS_UINT64)
        *(uint64_t *)field = (uint64_t)value;
    else if (type == RX_FILLS_BOOL)
        *(bool *)field = value != 0;
}

static void fill(const rx_fill *row, const rx_keyword *key, const int *words, const void *value, void *field)
{
    const int n = rx_keyword_count(key->kind, value), room = room_of(row);
    const int item = (room < n ? room : n) - 1;
    rx_kind kind;
    if (row->how == RX_FILL_COUNT)
        put(field, row->type, 0, n);
    else if (n == 0 || (row->how == RX_FILL_GIVEN && n < room))
        return;
    else if (row->type == RX_FILLS_STRING)
        *(const char **)field = *(const char *const *)rx_keyword_item(key->kind, value, item, &kind);
    else if (row->how == RX_FILL_ALL)
        for (int i = 0; i <= item; i++)
            put(field, row->type, i, number_of(key, words, value, i));
    else {
        const double number = number_of(key, words, value, item);
        put(field, row->type, 0,
            row->how == RX_FILL_NOT   ? number == 0
            : row->how == RX_FILL_BIT ? ((int)number & row->arg) == row->arg
                                      : number);
    }
}

void rx_fill_all(const rx_fill *rows, int n, const rx_settings *settings, void *dst)
{
    const rx_keyword *key = NULL;
    const int *words = NULL;
    for (int i = 0; i < n; i++)
        if (rows[i].keyword != NULL) {
            key = &settings->table->rows[rx_keyword_find(settings->table, rows[i].keyword)];
            words = rows[i].words;
        } else if (rows[i].type != RX_FILLS_NOTHING)
            fill(&rows[i], key, words, (const char *)settings + key->offset, (char *)dst + rows[i].offset);
}

rx_status rx_fill_one(const rx_fill *rows, int n, const rx_settings *settings, const char *name, void *dst,
                      rx_error *err)
{
    int first = 0, end, most = 0;
    while (first < n && (rows[first].keyword == NULL || strcasecmp(rows[first].keyword, name) != 0))
        first++; /* up to n where no row is the keyword's */
    for (end = first + 1; end < n && rows[end].keyword == NULL; end++)
        if (rows[end].type != RX_FILLS_NOTHING && rows[end].type != RX_FILLS_STRING &&
            room_of(&rows[end]) > most)
            most = room_of(&rows[end]);
    const rx_keyword *key = &settings->table->rows[rx_keyword_find(settings->table, name)];
    const int given = rx_keyword_count(key->kind, (const char *)settings + key->offset);
    if (most == 0)
        return rx_error_set(err, RX_USAGE, "%s sets none of these parameters", key->name);
    if (given > most)
        return rx_error_set(err, RX_USAGE, "%s: %d items are given, at most %d are taken here", key->name,
                            given, most);
    rx_fill_all(rows + first, end - first, settings, dst);
    return RX_OK;
}
