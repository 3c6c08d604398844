/* Targets: what our programs have written and read again. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fuzz.h"
#include "io/folders.h"
#include "lab/journal.h"
#include "nn/psfnet.h"
#include "survey/rollup.h"
#include "train/state.h"

static rx_status print(void *text, const rx_tile_record *record, int64_t at, rx_error *err)
{
    (void)at;
    (void)err;
    rx_tile_record_print(text, record);
    return RX_OK;
}

/* Records are printed as they are read, and a roll-up of them has a page and JSON without surprises. */
void fuzz_records(const uint8_t *data, size_t size)
{
    rx_text first = {0}, second = {0};
    char folder[] = "/tmp/rextract-fuzz-XXXXXX", output[64], name[96];
    const char *path = fuzz_file(0, data, size);
    if (rx_tile_record_read(path, 0, 0, print, &first, NULL) != RX_OK || first.length == 0) {
        rx_text_free(&first);
        return;
    }
    fuzz_require(rx_tile_record_read(fuzz_file(1, first.data, first.length), 0, 0, print, &second, NULL) ==
                     RX_OK,
                 "records as they are printed can be read");
    fuzz_require(first.length == second.length && memcmp(first.data, second.data, first.length) == 0,
                 "records read back the same");
    rx_settings *settings = NULL;
    fuzz_require(mkdtemp(folder) != NULL, "there is a folder");
    snprintf(output, sizeof output, "%s/survey", folder);
    fuzz_require(rx_settings_new(rx_keytable_survey(), &settings, NULL) == RX_OK &&
                     rx_settings_set(settings, "OUTPUT_NAME", output, NULL, NULL) == RX_OK &&
                     rx_settings_set(settings, "QA_FIGURES", "N", NULL, NULL) == RX_OK,
                 "there are settings");
    if (rx_rollup_files((const rx_survey_config *)settings, path, NULL, NULL) == RX_OK) {
        char *page = NULL, *json = NULL;
        snprintf(name, sizeof name, "%s/report.html", output);
        fuzz_require(rx_text_read_file(name, 1 << 28, &page, NULL, NULL) == RX_OK, "it has a page");
        snprintf(name, sizeof name, "%s/summary.json", output);
        fuzz_require(rx_text_read_file(name, 1 << 28, &json, NULL, NULL) == RX_OK, "and a summary");
        fuzz_require(strstr(page, "<script") == NULL, "no script comes into the page");
        for (const char *c = json; *c != '\0'; c++)
            fuzz_require((unsigned char)*c >= ' ' || *c == '\n', "JSON holds no control characters");
        free(page);
        free(json);
    }
    rx_output_remove(folder);
    rx_settings_free(settings);
    rx_text_free(&first);
    rx_text_free(&second);
}

/* Each line gets the digest that it needs to be taken for one of ours; one that ends in '!' keeps what it
 * has. */
void fuzz_journal(const uint8_t *data, size_t size)
{
    enum { UNITS = 6 };
    rx_text facts = {0}, file = {0};
    rx_unit_values *values = calloc(UNITS, sizeof *values);
    fuzz_require(values != NULL, "there is memory");
    rx_journal_fact(&facts, "SEED", "1");
    rx_text_printf(&file, "rextract-validate journal 3\n%s", facts.data);
    char header[RX_HASH_TEXT], digest[RX_HASH_TEXT];
    rx_journal_digest("", file.data, file.length, header);
    rx_text_printf(&file, "* %s\n", header);
    for (const uint8_t *at = data, *end = data + size; at < end;) {
        const uint8_t *stop = memchr(at, '\n', (size_t)(end - at));
        const size_t n = (size_t)((stop != NULL ? stop : end) - at);
        rx_text_add_bytes(&file, (const char *)at, n);
        if (n == 0 || at[n - 1] != '!') {
            rx_journal_digest(header, (const char *)at, n, digest);
            rx_text_printf(&file, " %s", digest);
        }
        rx_text_add(&file, stop != NULL ? "\n" : "");
        at += n + (stop != NULL);
    }
    rx_journal_open(fuzz_file(0, file.data, file.length), &facts, UNITS, values, NULL, NULL);
    rx_journal_open(fuzz_file(0, data, size), &facts, UNITS, values, NULL, NULL);
    rx_unit_values_free(UNITS, values);
    rx_text_free(&facts);
    rx_text_free(&file);
}

static rx_train_state *new_state(void)
{
    const rx_psfnet_shape shape = {.width = 1, .blocks = 1, .stem_kernel = 1, .kernel = 1};
    const double fwhm[2] = {2, 8}, sigma[2] = {1, 15};
    rx_selection selection;
    rx_train_state *state = NULL;
    rx_model *model = rx_model_new();
    fuzz_require(model != NULL, "there is memory");
    fuzz_require(rx_psfnet_new(&shape, 3, &model->restore, NULL) == RX_OK, "a network can be made");
    fuzz_require(rx_selection_begin((const int[]){2, 1}, fwhm, sigma, 40, 1, &selection, NULL) == RX_OK,
                 "so can a grid");
    fuzz_require(rx_train_state_new(model, &selection, &state, NULL) == RX_OK, "and a state");
    rx_model_free(model);
    return state;
}

void fuzz_checkpoint(const uint8_t *data, size_t size)
{
    rx_train_state *kept = new_state(), *now = new_state();
    rx_text file = {0};
    int found = 0, within = 0;
    rx_text_add_bytes(&file, (const char *)data, size);
    const size_t digits = RX_HASH_TEXT - 1;
    if (size > digits) {
        char digest[RX_HASH_TEXT];
        rx_journal_digest("", (const char *)data, size - digits, digest);
        memcpy(file.data + size - digits, digest, digits);
    }
    rx_checkpoint_read(fuzz_file(0, file.data, file.length), "SEED 1\nWIDTH 1\n", kept, now, &found, &within,
                       NULL);
    rx_text_free(&file);
    rx_train_state_free(kept);
    rx_train_state_free(now);
}
