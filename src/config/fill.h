/* From the values of keywords to the fields of params structs, by a table: the last items of a row of keys.def
 * name the fields that the keyword fills.
 *
 * Whoever owns the struct reads keys.def with KEY = RX_FILL_KEY, with macros of its own for the fields that are
 * its business (RX_FILL) and RX_FILL_NOTHING for those of others, likewise for words (RX_FILL_WORDS, or NULL).
 * The type of a field is taken from the struct by the compiler, which refuses one that is not known here.
 */
#ifndef RX_CONFIG_FILL_H
#define RX_CONFIG_FILL_H

#include <stddef.h>
#include <stdint.h>

#include "config/settings.h"

typedef enum rx_fill_type {
    RX_FILLS_NOTHING,
    RX_FILLS_INT,
    RX_FILLS_UNSIGNED, /* enums, too */
    RX_FILLS_LONG,
    RX_FILLS_UINT64,
    RX_FILLS_DOUBLE,
    RX_FILLS_BOOL,
    RX_FILLS_STRING /* points into the settings */
} rx_fill_type;

typedef enum rx_fill_how {
    RX_FILL_ITEM,  /* item `arg` of a list, or its last one where it is shorter; of a scalar, item 0 is all */
    RX_FILL_GIVEN, /* the same, only where there is such an item */
    RX_FILL_NOT,   /* as RX_FILL_ITEM; 0 becomes 1, everything else 0 */
    RX_FILL_BIT,   /* 1 where the first item has the bits `arg`, else 0 */
    RX_FILL_ALL,   /* all items into an array, as many as it has room for */
    RX_FILL_COUNT  /* how many items there are */
} rx_fill_how;

/* A keyword, or a field that the last keyword before it fills. A list without items leaves its fields as they
 * are, but for RX_FILL_COUNT. */
typedef struct rx_fill {
    const char *keyword; /* NULL: a field */
    const int *words; /* of a keyword: what its words mean, in their order; NULL: fields take them as text */
    rx_fill_type type;
    rx_fill_how how;
    int arg;
    size_t offset, size; /* of the field in its struct */
} rx_fill;

/* clang-format off */
#define RX_FILL_TYPE(value)                                                                                  \
    _Generic((value),                                                                                        \
        int: RX_FILLS_INT, int *: RX_FILLS_INT, unsigned: RX_FILLS_UNSIGNED, long: RX_FILLS_LONG,            \
        uint64_t: RX_FILLS_UINT64, double: RX_FILLS_DOUBLE, double *: RX_FILLS_DOUBLE,                       \
        bool: RX_FILLS_BOOL, const char *: RX_FILLS_STRING)

#define RX_FILL_HOW_VALUE RX_FILL_ITEM, .arg = 0
#define RX_FILL_HOW_ITEM(i) RX_FILL_ITEM, .arg = (i)
#define RX_FILL_HOW_GIVEN(i) RX_FILL_GIVEN, .arg = (i)
#define RX_FILL_HOW_NOT(i) RX_FILL_NOT, .arg = (i)
#define RX_FILL_HOW_BIT(bits) RX_FILL_BIT, .arg = (bits)
#define RX_FILL_HOW_ALL RX_FILL_ALL
#define RX_FILL_HOW_COUNT RX_FILL_COUNT

#define RX_FILL(struct_, how_, field)                                                                        \
    {.type = RX_FILL_TYPE(((struct_ *)NULL)->field), .how = RX_FILL_HOW_##how_,                              \
     .offset = offsetof(struct_, field), .size = sizeof((struct_ *)NULL)->field}
#define RX_FILL_NOTHING {.type = RX_FILLS_NOTHING}
#define RX_FILL_WORDS(...) ((const int[]){__VA_ARGS__})
#define RX_FILL_KEY(kind, NAME, field, initial, low, high, nmin, nmax, words_, status, level, ...)           \
    {.keyword = #NAME, .words = words_}, RX_FILL_BEHIND(__VA_ARGS__, )
#define RX_FILL_BEHIND(help, ...) __VA_ARGS__
/* clang-format on */

/* Every field of the n rows, from settings of the table that the rows were made from. */
void rx_fill_all(const rx_fill *rows, int n, const rx_settings *settings, void *dst);

/* Only the fields that keyword `name`, one of the table's, fills. Strings are not among them: this is for settings that
 * do not stay. Errors: RX_USAGE (it fills no field here, or there are items that none takes); dst is then as it was. */
rx_status rx_fill_one(const rx_fill *rows, int n, const rx_settings *settings, const char *name, void *dst,
                      rx_error *err);

#endif
