/* Checks that go for every table. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "config/keyword.h"

rx_status rx_settings_refuse(const rx_settings *settings, const char *name, rx_error *err, const char *format,
                             ...)
{
    char text[RX_ERROR_TEXT];
    int row = rx_keyword_find(settings->table, name);
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (row >= 0 && settings->line[row] > 0 && settings->origin[row] != RX_FROM_COMMAND)
        return rx_error_at(err, RX_USAGE, settings->file, -1, settings->line[row], "%s%s: %s",
                           settings->prefix, name, text);
    return rx_error_set(err, RX_USAGE, "-%s%s: %s", settings->prefix, name, text);
}

static const char *idle(const rx_settings *settings, rx_idle_function *function, const rx_keyword *key)
{
    if (key->status == RX_STATUS_IGNORED)
        return "here";
    return function != NULL ? function(settings, key->name) : NULL;
}

/* One warning per keyword that has no effect and a value that is not the default. */
static rx_status warn_idle(const rx_settings *settings, rx_idle_function *function, rx_log *log,
                           rx_error *err)
{
    rx_settings *defaults = NULL;
    rx_status status = rx_settings_new(settings->table, &defaults, err);
    for (int row = 0; row < settings->table->nrows && status == RX_OK; row++) {
        const rx_keyword *key = &settings->table->rows[row];
        const char *why = key->kind != RX_KIND_SECTION ? idle(settings, function, key) : NULL;
        if (why == NULL)
            continue;
        rx_text ours = {0}, normal = {0};
        rx_keyword_print(&ours, settings, row, false);
        rx_keyword_print(&normal, defaults, row, false);
        if (ours.failed || normal.failed)
            status = rx_error_memory(err, 0);
        else if (strcmp(ours.data, normal.data) != 0)
            rx_log_warning(log, "%s%s %s has no effect %s (%s)", settings->prefix, key->name, ours.data, why,
                           key->help);
        rx_text_free(&ours);
        rx_text_free(&normal);
    }
    rx_settings_free(defaults);
    return status;
}

rx_idle_function *rx_settings_part_idle(const rx_settings *settings, int i)
{
    rx_idle_function *instead = settings->table->part[i].idle;
    return instead != NULL ? instead : settings->part[i]->table->idle;
}

static rx_status check(const rx_settings *settings, rx_idle_function *function, rx_log *log, rx_error *err)
{
    rx_status status = settings->table->check(settings, err);
    if (status == RX_OK)
        status = warn_idle(settings, function, log, err);
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL && status == RX_OK; i++)
        status = check(settings->part[i], rx_settings_part_idle(settings, i), log, err);
    return status;
}

rx_status rx_settings_check(const rx_settings *settings, rx_log *log, rx_error *err)
{
    return check(settings, settings->table->idle, log, err);
}

rx_status rx_settings_complete(rx_settings *settings, rx_log *log, rx_error *err)
{
    if (settings->table->find_files != NULL)
        RX_TRY(settings->table->find_files(settings, log, err));
    return rx_settings_check(settings, log, err);
}
