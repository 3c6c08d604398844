/* Cutting lines into items. */
#include "config/tokens.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/text.h"

static const char BLANKS[] = " \t\r\n\v\f", SEPARATORS[] = " \t\r\n\v\f=,;";

static rx_status append(rx_tokens *dst, rx_text *item, rx_error *err)
{
    rx_text_add(item, "");
    char **v = rx_regrow(dst->v, (size_t)dst->n + 1, sizeof *v);
    if (v != NULL)
        dst->v = v;
    if (v == NULL || item->failed)
        return rx_error_memory(err, item->length);
    dst->v[dst->n++] = item->data;
    *item = (rx_text){0};
    return RX_OK;
}

/* *text stands on '$'; its replacement goes to item, *text moves behind it. */
static rx_status expand_variable(const char **text, rx_text *item, rx_error *err)
{
    char name[256];
    const char *begin = *text + 1;
    bool braces = *begin == '{';
    begin += braces;
    size_t length = 0;
    while (isalnum((unsigned char)begin[length]) || begin[length] == '_')
        length++;
    if (!braces && length == 0) { /* "$$", or a dollar that stands alone */
        rx_text_add(item, "$");
        *text += begin[0] == '$' ? 2 : 1;
        return RX_OK;
    }
    if (length == 0 || length >= sizeof name || (braces && begin[length] != '}'))
        return rx_error_set(err, RX_USAGE, "'%.40s' is no name of an environment variable; write ${NAME}",
                            *text);
    memcpy(name, begin, length);
    name[length] = '\0';
    const char *value = getenv(name);
    if (value == NULL)
        return rx_error_set(err, RX_USAGE,
                            "environment variable %s is not set; set it, or write $$ for a dollar", name);
    rx_text_add(item, value);
    *text = begin + length + braces;
    return RX_OK;
}

/* One item from *line on (no separator, no comment there), up to one of `separators`. Between blanks alone brackets, doubled
 * quotes and dollars mean nothing. */
static rx_status read_item(const char **line, const char *separators, rx_text *item, rx_error *err)
{
    const bool rich = separators != BLANKS;
    bool quoted = false;
    int depth = 0;
    const char *c = *line;
    while (*c != '\0' && (quoted || depth > 0 || strchr(separators, *c) == NULL)) {
        if (rich && *c == '$') {
            RX_TRY(expand_variable(&c, item, err));
            continue;
        }
        if (rich && *c == '"' && quoted && c[1] == '"') {
            c++;
        } else if (*c == '"') {
            quoted = !quoted;
            c++;
            continue;
        }
        if (rich && *c == '[' && !quoted && (depth > 0 || strchr(c, ']') != NULL))
            depth++;
        else if (*c == ']' && !quoted && depth > 0)
            depth--;
        rx_text_add_bytes(item, c++, 1);
    }
    *line = c;
    return quoted ? rx_error_set(err, RX_USAGE, "a quote is not closed; add the missing \"") : RX_OK;
}

static rx_status cut(const char *line, const char *separators, rx_tokens *dst, rx_error *err)
{
    rx_status status = RX_OK;
    rx_text item = {0};
    *dst = (rx_tokens){0};
    for (line += strspn(line, separators); *line != '\0' && *line != '#' && status == RX_OK;
         line += strspn(line, separators)) {
        status = read_item(&line, separators, &item, err);
        if (status == RX_OK)
            status = append(dst, &item, err);
    }
    rx_text_free(&item);
    return status;
}

rx_status rx_tokens_read(const char *line, rx_tokens *dst, rx_error *err)
{
    return cut(line, SEPARATORS, dst, err);
}

rx_status rx_tokens_words(const char *line, rx_tokens *dst, rx_error *err)
{
    return cut(line, BLANKS, dst, err);
}

rx_status rx_tokens_expand(const char *text, rx_tokens *dst, rx_error *err)
{
    rx_status status = RX_OK;
    rx_text item = {0};
    *dst = (rx_tokens){0};
    while (*text != '\0' && status == RX_OK) {
        if (*text == '$')
            status = expand_variable(&text, &item, err);
        else
            rx_text_add_bytes(&item, text++, 1);
    }
    if (status == RX_OK)
        status = append(dst, &item, err);
    rx_text_free(&item);
    return status;
}

void rx_tokens_free(rx_tokens *tokens)
{
    for (int i = 0; i < tokens->n; i++)
        free(tokens->v[i]);
    free(tokens->v);
    *tokens = (rx_tokens){0};
}
