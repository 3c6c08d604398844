/* The words of keys.def for whoever reads it for the fields that keywords fill: what is not about fields is nothing. Include it
 * behind all others, define PIPELINE, BACKGROUNDS, STAGE, TILES, PIPELINE_WORDS and STAGE_WORDS, and read keys.def. */
#ifndef RX_CONFIG_FILL_ROWS_H
#define RX_CONFIG_FILL_ROWS_H

#include "config/fill.h"

/* clang-format off */
#define SECTION(id, title)
#define KEY RX_FILL_KEY
#define NOWORDS NULL
#define RANGE NULL
#define TEXT NULL
#define READS NULL
#define SEARCHED NULL
#define SEARCHED_OR_BUILT_IN NULL
#define SEARCHED_INSTALLED NULL
#define WRITES NULL
#define WRITES_EACH NULL
#define FOLDER NULL
#define WORDLIST(...) NULL
#define ONCE(...) NULL
#define W(word, value) value
#define NEEDS(text) RX_FILL_NOTHING
/* clang-format on */

#endif
