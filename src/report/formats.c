/* Outside strings and numbers for HTML, JSON and ECSV, and the writers of these. */
#include "report/formats.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <strings.h>

/* --- strings --- */

static const char REPLACEMENT[] = "\xEF\xBF\xBD";

/* Unicode's ends of lines, at which YAML and readers of ECSV end theirs (astropy reads those of a quoted cell
 * as \n); 0 or their length. */
static int line_end(const char *c, const char **code)
{
    static const char *const ends[][2] = {
        {"\xC2\x85", "\\u0085"}, {"\xE2\x80\xA8", "\\u2028"}, {"\xE2\x80\xA9", "\\u2029"}};
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++)
        if (strncmp(c, ends[i][0], strlen(ends[i][0])) == 0) {
            *code = ends[i][1];
            return (int)strlen(ends[i][0]);
        }
    return 0;
}

/* `special` characters are given by `escaped`, at the same place of the list; coded: ends of lines by their
 * codes, else they are replaced. */
static void escape(rx_text *dst, const char *text, const char *special, const char *const *escaped,
                   bool coded)
{
    const char *code = NULL;
    for (const char *c = text != NULL ? text : ""; *c != '\0';) {
        const int end = line_end(c, &code);
        if (end > 0) {
            rx_text_add(dst, coded ? code : REPLACEMENT);
            c += end;
            continue;
        }
        int n = rx_text_utf8(c);
        const char *found = n == 1 ? strchr(special, *c) : NULL;
        if (found != NULL)
            rx_text_add(dst, escaped[found - special]);
        else if (n > 0)
            rx_text_add_bytes(dst, c, (size_t)n);
        else
            rx_text_add(dst, REPLACEMENT);
        c += n > 0 ? n : 1;
    }
}

void rx_escape_html(rx_text *dst, const char *text)
{
    static const char *const escaped[] = {"&amp;", "&lt;", "&gt;", "&quot;", "&#39;"};
    escape(dst, text, "&<>\"'", escaped, false);
}

/* With its quotes: a JSON string, also valid in YAML. */
static void escape_quoted(rx_text *dst, const char *text)
{
    static const char *const escaped[] = {"\\\"", "\\\\"};
    rx_text_add(dst, "\"");
    escape(dst, text, "\"\\", escaped, true);
    rx_text_add(dst, "\"");
}

static void keep_only(char *dst, size_t size, const char *text, const char *others, char instead)
{
    size_t n = 0;
    for (const char *c = text != NULL ? text : ""; *c != '\0' && n + 1 < size; c++) {
        bool letter = (*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') || (*c >= '0' && *c <= '9');
        dst[n++] = letter || strchr(others, *c) != NULL ? *c : instead;
    }
    dst[n] = '\0';
}

void rx_escape_plain(char *dst, size_t size, const char *text)
{
    keep_only(dst, size, text, " _-+.", '?');
}

void rx_escape_stem(char *dst, size_t size, const char *text)
{
    keep_only(dst, size, text, "_-", '_');
    if (dst[0] == '\0')
        memcpy(dst, "run", 4);
}

/* --- JSON --- */

/* What stands before a value: comma, line break, key. */
static void before(rx_json *json, const char *key)
{
    if (json->depth == 0)
        return;
    rx_json_level *level = &json->level[json->depth - 1];
    if (level->filled)
        rx_text_add(json->text, level->line ? ", " : ",");
    if (!level->line)
        rx_text_printf(json->text, "\n%*s", 2 * json->depth, "");
    level->filled = true;
    if (!level->array) {
        escape_quoted(json->text, key);
        rx_text_add(json->text, ": ");
    }
}

static void begin(rx_json *json, const char *key, bool array, bool line)
{
    before(json, key);
    if (json->depth >= RX_JSON_DEPTH) {
        json->text->failed = true;
        return;
    }
    bool inside_line = json->depth > 0 && json->level[json->depth - 1].line;
    json->level[json->depth++] = (rx_json_level){.array = array, .line = line || inside_line};
    rx_text_add(json->text, array ? "[" : "{");
}

void rx_json_object(rx_json *json, const char *key, bool line)
{
    begin(json, key, false, line);
}

void rx_json_array(rx_json *json, const char *key, bool line)
{
    begin(json, key, true, line);
}

void rx_json_end(rx_json *json)
{
    if (json->depth == 0) {
        json->text->failed = true;
        return;
    }
    rx_json_level level = json->level[--json->depth];
    if (!level.line && level.filled)
        rx_text_printf(json->text, "\n%*s", 2 * json->depth, "");
    rx_text_add(json->text, level.array ? "]" : "}");
    if (json->depth == 0)
        rx_text_add(json->text, "\n");
}

void rx_json_number(rx_json *json, const char *key, double value)
{
    before(json, key);
    if (isfinite(value))
        rx_text_printf(json->text, "%.9g", value == 0 ? 0 : value); /* no "-0" */
    else
        rx_text_add(json->text, "null");
}

void rx_json_count(rx_json *json, const char *key, uint64_t value)
{
    before(json, key);
    rx_text_printf(json->text, "%" PRIu64, value);
}

void rx_json_string(rx_json *json, const char *key, const char *value)
{
    before(json, key);
    if (value != NULL)
        escape_quoted(json->text, value);
    else
        rx_text_add(json->text, "null");
}

/* --- ECSV --- */

rx_ecsv rx_ecsv_on(rx_text *text)
{
    rx_text_add(text, "# %ECSV 1.0\n# ---\n# delimiter: ','\n");
    return (rx_ecsv){.text = text};
}

/* The line before the first entry, once. */
static void part_begin(rx_ecsv *table, bool *begun, const char *line)
{
    if (!*begun)
        rx_text_add(table->text, line);
    *begun = true;
}

void rx_ecsv_meta(rx_ecsv *table, const char *name, const char *value)
{
    part_begin(table, &table->in_meta, "# meta:\n");
    rx_text_printf(table->text, "#   %s: ", name);
    escape_quoted(table->text, value);
    rx_text_add(table->text, "\n");
}

void rx_ecsv_meta_number(rx_ecsv *table, const char *name, double value)
{
    part_begin(table, &table->in_meta, "# meta:\n");
    rx_text_printf(table->text, "#   %s: %.9g\n", name, value);
}

void rx_ecsv_column(rx_ecsv *table, const char *name, rx_ecsv_type type, const char *unit,
                    const char *description)
{
    static const char *const types[] = {"float64", "int64", "string"};
    /* YAML, the language of the header, takes these words for true and false */
    static const char *const truths[] = {"true", "false", "yes", "no", "on", "off"};
    const char *quote = "";
    part_begin(table, &table->in_columns, "# datatype:\n");
    for (size_t i = 0; i < sizeof truths / sizeof truths[0]; i++)
        quote = strcasecmp(name, truths[i]) == 0 ? "'" : quote;
    rx_text_printf(table->text, "# - {name: %s%s%s, datatype: %s", quote, name, quote, types[type]);
    if (unit[0] != '\0')
        rx_text_printf(table->text, ", unit: '%s'", unit);
    rx_text_printf(table->text, ", description: \"%s\"}\n", description);
    rx_text_printf(&table->names, "%s%s", table->names.length > 0 ? "," : "", name);
}

void rx_ecsv_columns_end(rx_ecsv *table)
{
    rx_text_printf(table->text, "# schema: astropy-2.0\n%s\n",
                   table->names.data != NULL ? table->names.data : "");
    table->text->failed = table->text->failed || table->names.failed;
    rx_text_free(&table->names);
}

static void next_cell(rx_ecsv *table)
{
    if (table->filled)
        rx_text_add(table->text, ",");
    table->filled = true;
}

void rx_ecsv_number(rx_ecsv *table, double value)
{
    next_cell(table);
    if (isfinite(value))
        rx_text_printf(table->text, "%.9g", value == 0 ? 0 : value);
    else
        rx_text_add(table->text, isnan(value) ? "nan" : value > 0 ? "inf" : "-inf");
}

void rx_ecsv_count(rx_ecsv *table, long value)
{
    next_cell(table);
    rx_text_printf(table->text, "%ld", value);
}

void rx_ecsv_text(rx_ecsv *table, const char *value)
{
    static const char *const escaped[] = {"\"\""};
    next_cell(table);
    rx_text_add(table->text, "\"");
    escape(table->text, value, "\"", escaped, false);
    rx_text_add(table->text, "\"");
}

void rx_ecsv_row_end(rx_ecsv *table)
{
    rx_text_add(table->text, "\n");
    table->filled = false;
}
