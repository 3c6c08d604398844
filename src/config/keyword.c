/* Finding rows of a keyword table. */
#include "config/keyword.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

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

int rx_keyword_part(const rx_keytable *table, const char **name)
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

/* The prefix that is nearest to what stands before the dot, or NULL; *name moves behind the dot. */
static const char *nearest_prefix(const rx_keytable *table, const char **name, int *part)
{
    const char *prefixes[RX_PARTS] = {0};
    char head[16];
    size_t n = 0, length = strcspn(*name, ".") + 1;
    if (length >= sizeof head || (*name)[length - 1] != '.')
        return NULL;
    memcpy(head, *name, length);
    head[length] = '\0';
    *name += length;
    while (n < RX_PARTS && table->part[n].prefix != NULL) {
        prefixes[n] = table->part[n].prefix;
        n++;
    }
    const char *near = rx_text_nearest(head, prefixes, n);
    for (size_t i = 0; i < n; i++)
        if (prefixes[i] == near)
            *part = (int)i;
    return near;
}

void rx_keyword_nearest(const rx_keytable *table, const char *name, char *dst, size_t size)
{
    int part = 0;
    const char *rest = name, *prefix = nearest_prefix(table, &rest, &part);
    const char *near = NULL;
    dst[0] = '\0';
    if (prefix != NULL)
        near = nearest_row(table->part[part].table(), rest);
    for (int i = 0; prefix == NULL && i < RX_PARTS && table->part[i].prefix != NULL; i++)
        if (rx_keyword_find(table->part[i].table(), name) >= 0) { /* only the prefix is missing */
            prefix = table->part[i].prefix;
            near = name;
        }
    if (near == NULL) {
        prefix = NULL;
        near = nearest_row(table, name);
    }
    if (near != NULL)
        snprintf(dst, size, "%s%s", prefix != NULL ? prefix : "", near);
}
