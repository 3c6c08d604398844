/* Facts by name. */
#include "data/record.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/point.h"

/* The value becomes the record's. */
static void add_owned(rx_record *record, const char *name, const char *comment, char *value)
{
    if (record->n == record->capacity) {
        int capacity = record->capacity > 0 ? 2 * record->capacity : 64;
        void *pairs = rx_regrow(record->pairs, (size_t)capacity, sizeof *record->pairs);
        if (pairs == NULL) {
            record->failed = true;
            free(value);
            return;
        }
        record->pairs = pairs;
        record->capacity = capacity;
    }
    char **pair = record->pairs[record->n];
    pair[0] = rx_strdup(name);
    pair[1] = value;
    pair[2] = rx_strdup(comment);
    record->n++;
    if (pair[0] == NULL || pair[1] == NULL || pair[2] == NULL)
        record->failed = true;
}

void rx_record_add(rx_record *record, const char *name, const char *comment, const char *format, ...)
{
    va_list args;
    rx_point_locale locale;
    record->failed |= rx_point_locale_begin(&locale, NULL) != RX_OK;
    va_start(args, format);
    const int length = vsnprintf(NULL, 0, format, args);
    va_end(args);
    char *value = length < 0 ? NULL : rx_alloc((size_t)length + 1, 1);
    va_start(args, format);
    if (value != NULL)
        vsnprintf(value, (size_t)length + 1, format, args);
    va_end(args);
    rx_point_locale_end(&locale);
    add_owned(record, name, comment, value);
}

rx_status rx_record_list(const rx_record *record, const char *(**dst)[2], rx_error *err)
{
    const char *(*pairs)[2] = rx_alloc((size_t)record->n, sizeof *pairs);
    if (pairs == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < record->n; i++) {
        pairs[i][0] = record->pairs[i][0];
        pairs[i][1] = record->pairs[i][1];
    }
    *dst = pairs;
    return RX_OK;
}

void rx_record_free(rx_record *record)
{
    for (int i = 0; i < record->n; i++)
        for (int k = 0; k < 3; k++)
            free(record->pairs[i][k]);
    free(record->pairs);
    *record = (rx_record){0};
}
