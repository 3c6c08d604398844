/* One line of a configuration into its items, by SExtractor's rules and a few more. Private to config/. */
#ifndef RX_CONFIG_TOKENS_H
#define RX_CONFIG_TOKENS_H

#include "base/error.h"

typedef struct rx_tokens {
    int n;
    char **v; /* owned */
} rx_tokens;

/* Items of `line`: apart by blanks, commas, '=' and ';'; '#' at the start of an item ends the line; "..."
 * keeps everything ("" inside stands for one quote); outside of quotes [...] keeps blanks and commas, as in
 * file names with sections; $NAME, ${NAME} come from the environment, $$ is a dollar. Errors: RX_USAGE
 * (variable not set, quote not closed), RX_SYSTEM. rx_tokens_free() after success and failure. */
rx_status rx_tokens_read(const char *line, rx_tokens *dst, rx_error *err);

/* The same replacement of $NAME alone: `text` as one item. */
rx_status rx_tokens_expand(const char *text, rx_tokens *dst, rx_error *err);

/* Words as a shell parts them: by blanks alone; "quotes" keep blanks, '#' at the start of a word ends the
 * line. Dollars stay: the values are read once more. */
rx_status rx_tokens_words(const char *line, rx_tokens *dst, rx_error *err);

void rx_tokens_free(rx_tokens *tokens);

#endif
