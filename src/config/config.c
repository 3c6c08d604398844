/* The configuration as a whole: made, read, overridden, checked, visited. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "config/keyword.h"
#include "config/tokens.h"

enum { MAX_FILE_BYTES = 1 << 20 };

rx_status rx_config_new(rx_config **dst, rx_error *err)
{
    rx_status status = RX_OK;
    rx_config *config = RX_NEW(rx_config, 1);
    if (config == NULL)
        return rx_error_memory(err, sizeof *config);
    for (int row = 0; row < RX_KEY_ROWS && status == RX_OK; row++) {
        const rx_keyword *key = rx_keyword_row(row);
        rx_tokens items = {0};
        if (key->kind == RX_KIND_SECTION)
            continue;
        status = rx_tokens_read(key->initial, &items, err);
        if (status == RX_OK)
            status = rx_keyword_assign(config, row, items.v, items.n, (rx_place){0}, NULL, err);
        rx_tokens_free(&items);
    }
    if (status == RX_OK) {
        *dst = config;
        config = NULL;
    }
    rx_config_free(config);
    return status;
}

void rx_config_free(rx_config *config)
{
    if (config == NULL)
        return;
    for (int row = 0; row < RX_KEY_ROWS; row++)
        if (rx_keyword_row(row)->kind != RX_KIND_SECTION)
            rx_keyword_clear(config, row);
    free(config->file);
    free(config);
}

static rx_status unknown_keyword(const char *name, rx_place place, rx_error *err)
{
    const char *near = rx_keyword_nearest(name);
    const char *dash = place.file != NULL ? "" : "-";
    char hint[96] = "-dd lists all";
    if (near != NULL)
        snprintf(hint, sizeof hint, "did you mean %s%s?", dash, near);
    if (place.file != NULL)
        return rx_error_at(err, RX_USAGE, place.file, -1, place.line, "unknown keyword '%.80s'; %s", name,
                           hint);
    return rx_error_set(err, RX_USAGE, "unknown keyword '-%.80s'; %s", name, hint);
}

/* One line of a file: nothing, or a keyword and its values. */
static rx_status read_line(rx_config *config, const char *line, rx_place place, rx_log *log, rx_error *err)
{
    rx_tokens items = {0};
    rx_status status = rx_tokens_read(line, &items, err);
    if (status == RX_USAGE && err != NULL) {
        snprintf(err->where, sizeof err->where, "%s", place.file);
        err->line = place.line;
    }
    if (status != RX_OK || items.n == 0)
        goto exit;
    int row = rx_keyword_find(items.v[0]);
    if (row < 0) {
        status = unknown_keyword(items.v[0], place, err);
        goto exit;
    }
    status = rx_keyword_assign(config, row, items.v + 1, items.n - 1, place, log, err);
    if (status != RX_OK)
        goto exit;
    config->origin[row] = RX_FROM_FILE;
    config->line[row] = place.line;
exit:
    rx_tokens_free(&items);
    return status;
}

rx_status rx_config_read(rx_config *config, const char *path, rx_log *log, rx_error *err)
{
    char *text = NULL;
    char *name = rx_strdup(path);
    if (name == NULL)
        return rx_error_memory(err, strlen(path));
    free(config->file);
    config->file = name;
    rx_status status = rx_text_read_file(path, MAX_FILE_BYTES, &text, NULL, err);
    if (status == RX_INPUT) { /* a configuration file is usage, not data */
        if (err != NULL)
            err->status = RX_USAGE;
        return RX_USAGE;
    }
    rx_place place = {.file = path, .line = 0};
    char *line = text;
    while (status == RX_OK && line != NULL && *line != '\0') {
        char *end = strchr(line, '\n');
        if (end != NULL)
            *end = '\0';
        place.line++;
        status = read_line(config, line, place, log, err);
        line = end != NULL ? end + 1 : NULL;
    }
    free(text);
    return status;
}

rx_status rx_config_set(rx_config *config, const char *name, const char *value, rx_log *log, rx_error *err)
{
    rx_tokens items = {0};
    int row = rx_keyword_find(name);
    if (row < 0)
        return unknown_keyword(name, (rx_place){0}, err);
    rx_status status = rx_keyword_row(row)->kind == RX_KIND_STRING ? rx_tokens_expand(value, &items, err)
                                                                   : rx_tokens_read(value, &items, err);
    if (status == RX_OK)
        status = rx_keyword_assign(config, row, items.v, items.n, (rx_place){0}, log, err);
    if (status == RX_OK)
        config->origin[row] = RX_FROM_COMMAND;
    rx_tokens_free(&items);
    return status;
}

rx_origin rx_config_was_set(const rx_config *config, const char *name)
{
    int row = rx_keyword_find(name);
    return row < 0 ? RX_FROM_DEFAULT : config->origin[row];
}

bool rx_config_visit(const rx_config *config, rx_config_visitor visit, void *user)
{
    bool complete = true;
    for (int row = 0; row < RX_KEY_ROWS && complete; row++) {
        const rx_keyword *key = rx_keyword_row(row);
        rx_text value = {0};
        if (key->kind == RX_KIND_SECTION)
            continue;
        rx_keyword_print(&value, config, row, false);
        complete = !value.failed;
        if (complete)
            visit(user, key->name, value.data, key->help);
        rx_text_free(&value);
    }
    return complete;
}
