/* JSON as text: the writer knows where commas and line breaks go. A key is NULL inside arrays and for the
 * outermost value. Numbers have 9 significant digits; what is not finite is null. */
#ifndef RX_REPORT_JSON_H
#define RX_REPORT_JSON_H

#include <stdbool.h>
#include <stdint.h>

#include "base/text.h"

enum { RX_JSON_DEPTH = 32 };

typedef struct rx_json_level {
    bool array, line, filled; /* line: all of it on one line */
} rx_json_level;

typedef struct rx_json {
    rx_text *text;
    int depth;
    rx_json_level level[RX_JSON_DEPTH];
} rx_json;

/* Writer onto `text`: rx_json j = rx_json_on(&text). */
rx_json rx_json_on(rx_text *text);

/* An object or array, and on one line when `line` (then all inside it is, too); rx_json_end closes the
 * innermost, the outermost with a line break. Deeper than RX_JSON_DEPTH: text->failed. */
void rx_json_object(rx_json *json, const char *key, bool line);
void rx_json_array(rx_json *json, const char *key, bool line);
void rx_json_end(rx_json *json);

void rx_json_number(rx_json *json, const char *key, double value);
void rx_json_count(rx_json *json, const char *key, uint64_t value);     /* whole, every digit */
void rx_json_string(rx_json *json, const char *key, const char *value); /* NULL = null */

#endif
