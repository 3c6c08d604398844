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

rx_idle_function *rx_settings_part_idle(const rx_settings *settings, int i)
{
    rx_idle_function *instead = settings->table->part[i].idle;
    return instead != NULL ? instead : settings->part[i]->table->idle;
}

rx_status rx_settings_check(const rx_settings *settings, rx_error *err)
{
    rx_status status = settings->table->check(settings, err);
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL && status == RX_OK; i++)
        status = rx_settings_check(settings->part[i], err);
    return status;
}

rx_status rx_settings_complete(rx_settings *settings, rx_log *log, rx_error *err)
{
    if (settings->table->find_files != NULL)
        RX_TRY(settings->table->find_files(settings, log, err));
    return rx_settings_check(settings, err);
}
