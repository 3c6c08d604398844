/* Rows of a keyword table as data, and the values of one keyword: from items of text, back to text. Private
 * to config/. */
#ifndef RX_CONFIG_KEYWORD_H
#define RX_CONFIG_KEYWORD_H

#include <stddef.h>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "config/values.h"

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

/* What a STRING names: no file, one that is read (or a folder of such, or @LIST of them), one that is written, a folder
 * that a run replaces as a whole. */
typedef enum rx_file_role {
    RX_FILE_NONE,
    RX_FILE_TEXT,
    RX_FILE_READS,
    RX_FILE_WRITES,
    RX_FILE_FOLDER
} rx_file_role;

/* How a file that is read is looked for where it is not as given: not at all, beside the configuration file and among the installed
 * data, the same but with a built-in one in place of what is missing under the default's name, or first among the installed data. */
typedef enum rx_file_search {
    RX_SEARCH_NONE,
    RX_SEARCH_FOLDERS,
    RX_SEARCH_BUILT_IN,
    RX_SEARCH_INSTALLED
} rx_file_search;

typedef enum rx_level { RX_LEVEL_D, RX_LEVEL_DD } rx_level;

typedef struct rx_keyword {
    rx_kind kind;
    const char *name; /* title of a section */
    size_t offset;    /* of its field in the program's struct */
    const char *initial;
    double low, high;
    int nmin, nmax;
    const char *const *words; /* ends with NULL; NULL when the kind has none */
    rx_file_role role;
    rx_file_search search;
    bool each_restorer; /* several restorers write a file each */
    bool ordered;       /* the second number is not below the first */
    bool once;          /* no word comes twice */
    rx_keyword_status status;
    rx_level level;
    const char *help;
    const char *needs; /* NEEDS of the row, NULL = nothing */
} rx_keyword;

/* Words of the command line that are no option. */
typedef enum rx_plain { RX_PLAIN_NONE, RX_PLAIN_IMAGES, RX_PLAIN_FILE, RX_PLAIN_RECORDS } rx_plain;

struct rx_keytable {
    const char *program, *title; /* as it is called, and in the head of its configuration files */
    const rx_keyword *rows;
    int nrows;
    size_t size; /* of the struct that begins with rx_settings */
    rx_plain plain;
    const char *default_file; /* read where no other is named; NULL = none */
    bool describes;           /* -INFO FILE shows what is in a file that the program made */
    struct {
        const char *prefix;
        const rx_keytable *(*table)(void);
        size_t offset;           /* of the typed pointer to the part in the struct */
        const char *const *idle; /* keywords that have no effect there, besides outputs; ends with NULL */
        const char *where;       /* "in a campaign" */
    } part[RX_PARTS];

    /* Relations between keywords: values that follow from others, NULL: none; and what contradicts. */
    rx_status (*settle)(rx_settings *settings, rx_error *err);
    rx_status (*check)(const rx_settings *settings, rx_error *err);
};

/* The row of a name (case ignored), -1 when unknown. */
int rx_keyword_find(const rx_keytable *table, const char *name);

/* A row of gone.def: a keyword that earlier versions had (value NULL), or a word of one. */
typedef struct rx_gone {
    const char *program, *name, *value;
    const char *initial; /* default of the keyword, which changes nothing; NULL: every value is an error */
    const char *instead; /* "give ...": what to use now */
} rx_gone;

/* Where messages about a value say it comes from: file NULL for the command line. */
typedef struct rx_place {
    const char *file;
    long line;
} rx_place;

/* A name that is in the table or its parts, or was there. */
typedef struct rx_named {
    int part;            /* -1: the table's own */
    int row;             /* of that table; -1: gone, with a default that may still be stated */
    const rx_gone *gone; /* then */
} rx_named;
/* Errors: RX_USAGE, with the nearest name, or with what to use now. */
rx_status rx_keyword_look_up(const rx_keytable *table, const char *name, rx_place place, rx_named *dst,
                             rx_error *err);

/* A keyword that earlier versions had does no harm at its old default; RX_USAGE for another value. */
rx_status rx_keyword_check_gone(const rx_gone *gone, const char *name, char *const *values, int n,
                                rx_place place, rx_error *err);

/* Give the keyword of `row` the n items; on error the old value stays. */
rx_status rx_keyword_assign(rx_settings *settings, int row, char *const *items, int n, rx_place place,
                            rx_log *log, rx_error *err);

/* The value of that row in src, for dst as well; both of one table. A section has none. */
rx_status rx_keyword_copy(rx_settings *dst, const rx_settings *src, int row, rx_error *err);

/* Items of the value in a field; a scalar is one. */
int rx_keyword_count(rx_kind kind, const void *field);
/* Where item i stands, and its kind, that of a scalar. */
const void *rx_keyword_item(rx_kind kind, const void *field, int i, rx_kind *item);

/* Value as text, items joined by commas; quoted = so that reading it back gives the same. */
void rx_keyword_print(rx_text *dst, const rx_settings *settings, int row, bool quoted);

/* `what` becomes `with` in every string of the field; numbers and words stay. */
rx_status rx_keyword_replace(rx_settings *settings, int row, const char *what, const char *with,
                             rx_error *err);

/* Free what the field owns. */
void rx_keyword_clear(rx_settings *settings, int row);

/* RX_USAGE about the value of `name`: prefix and keyword, with the line that set it when a file did. */
rx_status rx_settings_refuse(const rx_settings *settings, const char *name, rx_error *err, const char *format,
                             ...) RX_PRINTF(4, 5);

/* Is what the row needs there (NEEDS), whatever the columns? A run opens the files of no other. */
bool rx_keyword_counts(const rx_settings *settings, int row);

/* In a part of other settings: why the keyword has no effect there, "in a campaign"; else NULL. */
const char *rx_keyword_idle(const rx_settings *settings, int row);

#endif
