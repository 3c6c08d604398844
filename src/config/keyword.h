/* Rows of keys.def as data, and the values of one keyword: from items of text, back to text. Private to
 * config/. */
#ifndef RX_CONFIG_KEYWORD_H
#define RX_CONFIG_KEYWORD_H

#include <stddef.h>

#include "config/config_fields.h"

typedef enum rx_kind {
    RX_KIND_SECTION,
    RX_KIND_STRING,
    RX_KIND_INT,
    RX_KIND_REAL,
    RX_KIND_BOOL,
    RX_KIND_WORD,
    RX_KIND_STRINGS,
    RX_KIND_INTS,
    RX_KIND_REALS,
    RX_KIND_BOOLS,
    RX_KIND_WORDS
} rx_kind;

typedef enum rx_keyword_status {
    RX_STATUS_SEX,
    RX_STATUS_OURS,
    RX_STATUS_IGNORED,
    RX_STATUS_INERT
} rx_keyword_status;

typedef enum rx_level { RX_LEVEL_D, RX_LEVEL_DD } rx_level;

typedef struct rx_keyword {
    rx_kind kind;
    const char *name; /* title of a section */
    size_t offset;    /* of its field in rx_config */
    const char *initial;
    double low, high;
    int nmin, nmax;
    const char *const *words; /* ends with NULL; NULL when the kind has none */
    rx_keyword_status status;
    rx_level level;
    const char *help;
} rx_keyword;

/* Row 0 <= row < RX_KEY_ROWS, and the row of a name (case ignored), -1 when unknown. */
const rx_keyword *rx_keyword_row(int row);
int rx_keyword_find(const char *name);
const char *rx_keyword_nearest(const char *name); /* NULL when nothing is near */

/* Where messages about a value say it comes from: file NULL for the command line. */
typedef struct rx_place {
    const char *file;
    long line;
} rx_place;

/* Give the keyword of `row` the n items; on error the old value stays. */
rx_status rx_keyword_assign(rx_config *config, int row, char *const *items, int n, rx_place place,
                            rx_log *log, rx_error *err);

/* Value as text, items joined by commas; quoted = so that reading it back gives the same. */
void rx_keyword_print(rx_text *dst, const rx_config *config, int row, bool quoted);

/* Free what the field owns. */
void rx_keyword_clear(rx_config *config, int row);

#endif
