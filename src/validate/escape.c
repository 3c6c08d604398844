/* Outside strings and numbers for HTML, JSON and ECSV. */
#include "validate/escape.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

static const char REPLACEMENT[] = "\xEF\xBF\xBD";

/* `special` characters are given by `escaped`, at the same place of the list. */
static void escape(rx_text *dst, const char *text, const char *special, const char *const *escaped)
{
    for (const char *c = text != NULL ? text : ""; *c != '\0';) {
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
    escape(dst, text, "&<>\"'", escaped);
}

void rx_escape_quoted(rx_text *dst, const char *text)
{
    static const char *const escaped[] = {"\\\"", "\\\\"};
    rx_text_add(dst, "\"");
    escape(dst, text, "\"\\", escaped);
    rx_text_add(dst, "\"");
}

void rx_escape_cell(rx_text *dst, const char *text)
{
    static const char *const escaped[] = {"\"\""};
    rx_text_add(dst, "\"");
    escape(dst, text, "\"", escaped);
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

void rx_number_json(rx_text *dst, double value)
{
    if (isfinite(value))
        rx_text_printf(dst, "%.9g", value == 0 ? 0 : value); /* no "-0" */
    else
        rx_text_add(dst, "null");
}

void rx_number_cell(rx_text *dst, double value)
{
    if (isnan(value))
        rx_text_add(dst, "nan");
    else if (isinf(value))
        rx_text_add(dst, value > 0 ? "inf" : "-inf");
    else
        rx_text_printf(dst, "%.9g", value == 0 ? 0 : value);
}
