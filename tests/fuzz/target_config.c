/* Targets: what a user writes for the programs. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "catalog/catalog.h"
#include "config/arguments.h"
#include "config/idle.h"
#include "config/kernel.h"
#include "config/tiles.h"
#include "fuzz.h"
#include "io/fits_file.h"
#include "measure/starclass.h"
#include "quality/gates.h"

static const rx_keytable *const *tables(void)
{
    static const rx_keytable *all[6];
    const rx_keytable *const wanted[] = {rx_keytable_rextract(), rx_keytable_simulate(),
                                         rx_keytable_validate(), rx_keytable_train(), rx_keytable_survey()};
    memcpy(all, wanted, sizeof wanted);
    return all;
}

/* The settings as a file of all keywords, read once more, are the same. */
static void dump_and_read(const rx_keytable *table, const rx_settings *settings)
{
    rx_settings *again = NULL;
    rx_text first = {0}, second = {0};
    rx_error err = RX_ERROR_NONE;
    rx_settings_dump(&first, table, settings, true);
    fuzz_require(rx_settings_new(table, &again, &err) == RX_OK, "settings can be made");
    const rx_status status = rx_settings_read(again, fuzz_file(1, first.data, first.length), NULL, &err);
    fuzz_require(status == RX_OK, "a dump can be read");
    rx_settings_dump(&second, table, again, true);
    fuzz_require(strcmp(first.data, second.data) == 0, "a dump reads back the same");
    rx_settings_free(again);
    rx_text_free(&first);
    rx_text_free(&second);
}

void fuzz_config(const uint8_t *data, size_t size)
{
    const char *path = fuzz_file(0, data, size);
    for (const rx_keytable *const *table = tables(); *table != NULL; table++) {
        rx_settings *settings = NULL;
        rx_error err = RX_ERROR_NONE;
        fuzz_require(rx_settings_new(*table, &settings, &err) == RX_OK, "settings can be made");
        if (rx_settings_read(settings, path, NULL, &err) == RX_OK) {
            rx_settings_check(settings, &err);
            rx_settings_warn_idle(settings, (rx_idle){0}, NULL, &err);
            dump_and_read(*table, settings);
        }
        rx_settings_free(settings);
    }
}

/* A line is a word of the command line, the first one a name besides. */
void fuzz_arguments(const uint8_t *data, size_t size)
{
    enum { MOST = 40 };
    char *text = malloc(size + 1), *words[MOST + 2] = {"rextract"};
    int n = 1;
    rx_fits_name name;
    FILE *nowhere = fopen("/dev/null", "w");
    fuzz_require(text != NULL && nowhere != NULL, "there is memory");
    memcpy(text, data, size);
    text[size] = '\0';
    for (char *at = text, *next; at != NULL && n <= MOST; at = next) {
        next = strchr(at, '\n');
        if (next != NULL)
            *next++ = '\0';
        words[n++] = at;
    }
    rx_fits_name_parse(words[1], &name, NULL);
    for (const rx_keytable *const *table = tables(); *table != NULL; table++) {
        rx_log log;
        rx_arguments arguments;
        rx_error err = RX_ERROR_NONE;
        char line[RX_ERROR_WHERE + RX_ERROR_TEXT + 100];
        rx_log_init(&log, "rextract", nowhere, RX_QUIET);
        if (rx_arguments_read(*table, n, words, &log, &arguments, &err) != RX_OK) {
            rx_error_format(&err, "rextract", line, sizeof line);
            for (const char *c = line; *c != '\0'; c++)
                fuzz_require((unsigned char)*c >= ' ' && *c != 127, "an error is one line without controls");
        }
        rx_arguments_free(&arguments);
    }
    fclose(nowhere);
    free(text);
}

void fuzz_tiles(const uint8_t *data, size_t size)
{
    rx_tiles *tiles = NULL;
    rx_settings *settings = NULL;
    fuzz_require(rx_settings_new(rx_keytable_rextract(), &settings, NULL) == RX_OK, "settings can be made");
    if (rx_tiles_read(fuzz_file(0, data, size), &tiles, NULL) == RX_OK) {
        rx_tiles_check(tiles, settings, NULL, NULL, NULL);
        rx_tiles_free(tiles);
    }
    rx_settings_free(settings);
}

void fuzz_param(const uint8_t *data, size_t size)
{
    rx_column_list *list = NULL;
    if (rx_columns_read(fuzz_file(0, data, size), NULL, &list, NULL) != RX_OK)
        return;
    fuzz_require(list->n > 0, "a list has columns");
    rx_columns_clip(list, "FLUX_APER", 3, "PHOT_APERTURES", NULL);
    rx_columns_free(list);
}

void fuzz_conv(const uint8_t *data, size_t size)
{
    rx_kernel *kernel = NULL;
    double sum = 0;
    if (rx_kernel_read(fuzz_file(0, data, size), &kernel, NULL) != RX_OK)
        return;
    fuzz_require(kernel->width > 0 && kernel->width <= RX_KERNEL_SIDE && kernel->height > 0 &&
                     kernel->height <= RX_KERNEL_SIDE,
                 "a filter has a size");
    for (int i = 0; i < kernel->width * kernel->height; i++)
        sum += fabs((double)kernel->values[i]);
    fuzz_require(isfinite(sum) && sum > 0, "a filter has finite values, not all 0");
    rx_kernel_free(kernel);
}

void fuzz_qa(const uint8_t *data, size_t size)
{
    rx_gates *gates = NULL;
    const rx_estimate estimate = {.value = 0.5, .low = 0.4, .high = 0.6, .n = 10};
    if (rx_gates_read(fuzz_file(0, data, size), &gates, NULL) != RX_OK)
        return;
    for (long i = 0; i < gates->n; i++) {
        const rx_gate *gate = &gates->gate[i];
        fuzz_require(gate->level >= 0.5 && gate->level <= 0.995, "the level of a gate is in its range");
        fuzz_require(gate->whole || gate->low < gate->high, "a gate has a range of magnitudes");
        rx_gate_judge(gate, &estimate);
    }
    rx_gates_free(gates);
}

void fuzz_nnw(const uint8_t *data, size_t size)
{
    rx_starclass *net = NULL;
    const rx_source source = {.iso = {30, 25, 20, 16, 12, 8, 4, 2}, .peak = 100};
    if (rx_starclass_read(fuzz_file(0, data, size), &net, NULL) != RX_OK)
        return;
    rx_starclass_evaluate(net, &source, 1.2, 0.4, 10);
    rx_starclass_free(net);
}
