/* JSON as text. */
#include "report/json.h"

#include <inttypes.h>
#include <math.h>

#include "report/escape.h"

rx_json rx_json_on(rx_text *text)
{
    return (rx_json){.text = text};
}

static void new_line(rx_json *json)
{
    rx_text_printf(json->text, "\n%*s", 2 * json->depth, "");
}

/* What stands before a value: comma, line break, key. */
static void before(rx_json *json, const char *key)
{
    if (json->depth == 0)
        return;
    rx_json_level *level = &json->level[json->depth - 1];
    if (level->filled)
        rx_text_add(json->text, level->line ? ", " : ",");
    if (!level->line)
        new_line(json);
    level->filled = true;
    if (!level->array) {
        rx_escape_quoted(json->text, key);
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
        new_line(json);
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
        rx_escape_quoted(json->text, value);
    else
        rx_text_add(json->text, "null");
}
