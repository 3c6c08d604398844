/* struct rx_config: one field per keyword of keys.def, made by the preprocessor.
 * Types by kind as config.h says; field = keyword in lower case. */
#ifndef RX_CONFIG_CONFIG_FIELDS_H
#define RX_CONFIG_CONFIG_FIELDS_H

#include "config/config.h"

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

/* Rows of keys.def, section titles counted too. */
enum {
#define SECTION(id, title) RX_SECTION_##id,
#define KEY(kind, NAME, ...) RX_KEY_##NAME,
#include "config/keys.def"
#undef KEY
#undef SECTION
    RX_KEY_ROWS
};

struct rx_config {
#define SECTION(id, title)
#define KEY(kind, NAME, field, ...) RX_FIELD_##kind field;
#include "config/keys.def"
#undef KEY
#undef SECTION
    rx_origin origin[RX_KEY_ROWS]; /* who set the row's value */
    long line[RX_KEY_ROWS];        /* and on which line of `file`, 0 = not in the file */
    char *file;                    /* the configuration file last read, or NULL */
};

#endif
