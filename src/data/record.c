/* Facts by name. */
#include "data/record.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/point.h"
#include "base/text.h"

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

const char *rx_record_find(const rx_record *record, const char *name)
{
    for (int i = 0; i < record->n; i++)
        if (strcmp(record->pairs[i][0], name) == 0)
            return record->pairs[i][1];
    return NULL;
}

bool rx_record_has(const rx_record *record, int from, const char *name, const char *value, size_t length)
{
    for (int i = from; i < record->n; i++)
        if (strcmp(record->pairs[i][0], name) == 0 && strncmp(record->pairs[i][1], value, length) == 0)
            return true;
    return false;
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

void rx_record_product(rx_record *products, const char *digest, int part, const char *name)
{
    rx_record_add(products, "MADE", "digest of pixels or rows, part and name of an output", "%s %d %s",
                  digest, part, name);
}

void rx_record_digest_line(rx_hash *sum, const char *name, const char *printable)
{
    rx_hash_add(sum, name, strlen(name));
    rx_hash_add(sum, " = ", 3);
    rx_hash_add(sum, printable, strlen(printable));
    rx_hash_add(sum, "\n", 1);
}

static void copy(rx_record *dst, const rx_record *src)
{
    for (int i = 0; i < src->n; i++)
        rx_record_add(dst, src->pairs[i][0], src->pairs[i][2], "%s", src->pairs[i][1]);
}

/* The line END. */
static void end_record(rx_record *record)
{
    char digest[RX_HASH_TEXT];
    rx_hash sum;
    rx_text value = {0};
    int i = 0;
    rx_hash_begin(&sum);
    while (i < record->n && strcmp(record->pairs[i][0], "RECORD") != 0)
        i++;
    for (; i < record->n && !value.failed; i++) {
        value.length = 0;
        rx_printable_add(&value, record->pairs[i][1]);
        if (!value.failed)
            rx_record_digest_line(&sum, record->pairs[i][0], value.data);
    }
    record->failed |= value.failed;
    rx_hash_text(&sum, digest);
    rx_record_add(record, "END", "digest of the lines from RECORD on", "%s", digest);
    rx_text_free(&value);
}

rx_status rx_record_of(const rx_record *run, const rx_record *products, const char *output, rx_record *dst,
                       rx_error *err)
{
    if (run->failed || products->failed)
        return rx_error_memory(err, 0);
    copy(dst, run);
    copy(dst, products);
    rx_record_add(dst, "OUTPUT", "name of this output", "%s", output);
    if (!dst->failed)
        end_record(dst);
    return dst->failed ? rx_error_memory(err, 0) : RX_OK;
}

void rx_record_free(rx_record *record)
{
    for (int i = 0; i < record->n; i++)
        for (int k = 0; k < 3; k++)
            free(record->pairs[i][k]);
    free(record->pairs);
    *record = (rx_record){0};
}
