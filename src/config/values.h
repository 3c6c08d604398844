/* Values of keywords, and what the settings of every program begin with. */
#ifndef RX_CONFIG_VALUES_H
#define RX_CONFIG_VALUES_H

#include <stdbool.h>

#include "data/record.h"

enum { RX_LIST = 32, RX_PARTS = 2 };

/* Lists: n used items. Words are static upper-case strings of the table, strings belong to the settings. */
typedef struct rx_strings {
    int n;
    char *v[RX_LIST];
} rx_strings;
typedef struct rx_words {
    int n;
    const char *v[RX_LIST];
} rx_words;
typedef struct rx_ints {
    int n;
    int v[RX_LIST];
} rx_ints;
typedef struct rx_reals {
    int n;
    double v[RX_LIST];
} rx_reals;
typedef struct rx_bools {
    int n;
    bool v[RX_LIST];
} rx_bools;

/* Field of a keyword by its kind; a STRING is never NULL ("" = none), a WORD is spelled as in the table.
 * Field name = keyword in lower case: cfg->detect_thresh.v[0], cfg->restore_type.n. */
#define RX_FIELD_STRING char *
#define RX_FIELD_INT int
#define RX_FIELD_REAL double
#define RX_FIELD_BOOL bool
#define RX_FIELD_WORD const char *
#define RX_FIELD_STRINGS rx_strings
#define RX_FIELD_INTS rx_ints
#define RX_FIELD_REALS rx_reals
#define RX_FIELD_BOOLS rx_bools
#define RX_FIELD_WORDS rx_words

/* Who set a value. RX_FROM_DUMP: a file that repeats the default, as one made by -d does on every line. */
typedef enum rx_origin { RX_FROM_DEFAULT, RX_FROM_DUMP, RX_FROM_FILE, RX_FROM_COMMAND } rx_origin;

/* The table of a program (config/keyword.h). */
typedef struct rx_keytable rx_keytable;

/* What all programs' settings begin with. */
typedef struct rx_settings rx_settings;
struct rx_settings {
    const rx_keytable *table;
    const char *prefix;      /* "SIM." where these are part of other settings, else "" */
    const char *const *idle; /* then: keywords without effect there, and "in a campaign"; else NULL */
    const char *where;
    rx_origin *origin;           /* what set the value of each row of the table */
    long *line;                  /* and on which line of `file`, 0 = not in the file */
    char *file;                  /* the configuration file last read, or NULL */
    rx_record repeated;          /* where that is an output: the record of its run; else empty */
    rx_settings *part[RX_PARTS]; /* settings of other programs, set by prefixed names; owned, or NULL */
};

#endif
