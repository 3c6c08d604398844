/* The flag columns as a table, for what shows flags to people. */
#ifndef RX_DATA_FLAGS_H
#define RX_DATA_FLAGS_H

#include "base/error.h"
#include "base/extern.h"
#include "base/text.h"

RX_BEGIN_DECLS

typedef struct rx_flag {
    const char *column, *name, *meaning; /* "FLAGS", "CROWDED" */
    int bit;
} rx_flag;

/* The n rows of flags.def, the bits of a column together, rising. */
const rx_flag *rx_flags(int *n);

/* A sum of flags as lines of text, column by column: "19", or "FLAGS_RESTORE=19" of one column; NULL: all bits of
 * all columns. Errors: RX_USAGE (no sum of flags, no such column), RX_SYSTEM. */
rx_status rx_flags_decode(const char *what, rx_text *dst, rx_error *err);

/* The bits of a column as a list in roff. */
void rx_flags_man(const char *column, rx_text *dst);

RX_END_DECLS

#endif
