/* Provenance of the outputs. */
#include "stage/record.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "io/fits_write.h"

void rx_record_add(rx_record *record, const char *name, const char *comment, const char *format, ...)
{
    char value[2048];
    va_list args;
    va_start(args, format);
    vsnprintf(value, sizeof value, format, args);
    va_end(args);
    if (record->n == record->capacity) {
        int capacity = record->capacity > 0 ? 2 * record->capacity : 64;
        void *pairs = rx_regrow(record->pairs, (size_t)capacity, sizeof *record->pairs);
        if (pairs == NULL) {
            record->failed = true;
            return;
        }
        record->pairs = pairs;
        record->capacity = capacity;
    }
    char **pair = record->pairs[record->n];
    pair[0] = rx_strdup(name);
    pair[1] = rx_strdup(value);
    pair[2] = rx_strdup(comment);
    record->n++;
    if (pair[0] == NULL || pair[1] == NULL || pair[2] == NULL)
        record->failed = true;
}

static void add_keyword(void *user, const char *name, const char *value, const char *help)
{
    if (strcmp(name, "NTHREADS") != 0 && strcmp(name, "VERBOSE_TYPE") != 0)
        rx_record_add(user, name, help, "%s", value);
}

void rx_record_run(rx_record *record, const rx_config *config, const char *images)
{
    rx_record_add(record, "PROGRAM", "made by", "rextract");
    rx_record_add(record, "RXVERS", "version of rextract", "%s", RX_VERSION);
    rx_record_add(record, "RXINPUT", "input image", "%s", images);
    if (!rx_config_visit(config, add_keyword, record))
        record->failed = true;
}

void rx_record_cards(const rx_record *record, rx_text *cards)
{
    for (int i = 0; i < record->n; i++)
        rx_card_record(cards, record->pairs[i][0], record->pairs[i][1], record->pairs[i][2]);
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
