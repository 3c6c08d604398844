/* Outside strings for HTML, JSON and ECSV. */
#include "report/escape.h"

#include <stdbool.h>
#include <string.h>

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

void rx_escape_quoted(rx_text *dst, const char *text)
{
    static const char *const escaped[] = {"\\\"", "\\\\"};
    rx_text_add(dst, "\"");
    escape(dst, text, "\"\\", escaped, true);
    rx_text_add(dst, "\"");
}

void rx_escape_cell(rx_text *dst, const char *text)
{
    static const char *const escaped[] = {"\"\""};
    rx_text_add(dst, "\"");
    escape(dst, text, "\"", escaped, false);
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
