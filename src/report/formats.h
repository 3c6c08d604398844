/* Text in the formats of a report.
 *
 * Outside strings are made harmless: bytes that are not UTF-8 and control characters become U+FFFD, as do the ends of
 * lines U+0085, U+2028 and U+2029 where they have no code. Numbers have 9 significant digits; what is not finite is null in
 * JSON, nan and inf in ECSV. */
#ifndef RX_REPORT_FORMATS_H
#define RX_REPORT_FORMATS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/text.h"

void rx_escape_html(rx_text *dst, const char *text); /* text and quoted attributes */
void rx_escape_plain(char *dst, size_t size,
                     const char *text); /* letters, digits and " _-+." only, for figures */
void rx_escape_stem(char *dst, size_t size, const char *text); /* letters, digits, - and _, for file names */

/* --- JSON: the writer knows where commas and line breaks go --- */

enum { RX_JSON_DEPTH = 32 };

typedef struct rx_json_level {
    bool array, line, filled; /* line: all of it on one line */
} rx_json_level;

typedef struct rx_json {
    rx_text *text;
    int depth;
    rx_json_level level[RX_JSON_DEPTH];
} rx_json;

static inline rx_json rx_json_on(rx_text *text)
{
    return (rx_json){.text = text};
}

/* An object or array, and on one line when `line` (then all inside it is, too); rx_json_end closes the
 * innermost, the outermost with a line break. Deeper than RX_JSON_DEPTH: text->failed. A key is NULL inside arrays and for
 * the outermost value. */
void rx_json_object(rx_json *json, const char *key, bool line);
void rx_json_array(rx_json *json, const char *key, bool line);
void rx_json_end(rx_json *json);

void rx_json_number(rx_json *json, const char *key, double value);
void rx_json_count(rx_json *json, const char *key, uint64_t value);     /* whole, every digit */
void rx_json_string(rx_json *json, const char *key, const char *value); /* NULL = null */

/* --- ECSV 1.0 (Astropy's APE 6): text that astropy and every CSV reader open ---
 *
 *   rx_ecsv t = rx_ecsv_on(&text);
 *   rx_ecsv_meta(&t, "campaign", name);                          any number
 *   rx_ecsv_column(&t, "mag", RX_ECSV_FLOAT, "mag", "of the stars");  one or more
 *   rx_ecsv_columns_end(&t);
 *   rx_ecsv_number(&t, 18.5); ... one call per column, then rx_ecsv_row_end(&t); */

typedef enum rx_ecsv_type { RX_ECSV_FLOAT, RX_ECSV_LONG, RX_ECSV_TEXT } rx_ecsv_type;

typedef struct rx_ecsv {
    rx_text *text;
    rx_text names;
    bool in_meta, in_columns; /* begun */
    bool filled;              /* the row has a cell */
} rx_ecsv;

rx_ecsv rx_ecsv_on(rx_text *text);
void rx_ecsv_meta(rx_ecsv *table, const char *name, const char *value);
void rx_ecsv_meta_number(rx_ecsv *table, const char *name, double value);
/* unit "" = none; name is a plain word; description one line without quotes. */
void rx_ecsv_column(rx_ecsv *table, const char *name, rx_ecsv_type type, const char *unit,
                    const char *description);
void rx_ecsv_columns_end(rx_ecsv *table); /* also frees what the writer holds */

void rx_ecsv_number(rx_ecsv *table, double value);
void rx_ecsv_count(rx_ecsv *table, long value);
void rx_ecsv_text(rx_ecsv *table, const char *value); /* quoted and escaped */
void rx_ecsv_row_end(rx_ecsv *table);

#endif
