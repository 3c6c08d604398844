/* Provenance of the outputs. */
#include "stage/provenance.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/printable.h"
#include "io/fits_write.h"
#include "stage/inputs.h"
#include "stage/machine.h"

/* Visiting the keywords. */
typedef struct keywords {
    rx_record *record;
    const rx_config *config;
    rx_text set; /* names of those that were set */
} keywords;

static void add_keyword(void *user, const char *name, const char *value, const char *help)
{
    static const char *const apart[] = {"NTHREADS", "VERBOSE_TYPE", "PLAN", "PLAN_DENSITY"};
    keywords *k = user;
    for (size_t i = 0; i < sizeof apart / sizeof apart[0]; i++)
        if (strcmp(name, apart[i]) == 0)
            return;
    rx_record_add(k->record, name, help, "%s", value);
    if (rx_config_states(k->config, name))
        rx_text_printf(&k->set, "%s%s", k->set.length > 0 ? " " : "", name);
}

void rx_record_run(rx_record *record, const rx_config *config, const char *images)
{
    rx_text machine = {0};
    keywords k = {.record = record, .config = config};
    rx_machine_describe(&machine);
    rx_text_add(&k.set, "");
    rx_record_add(record, "PROGRAM", "made by", "rextract");
    rx_record_add(record, "RXVERS", "version of rextract", "%s", RX_VERSION);
    rx_record_add(record, "RXINPUT", "input image", "%s", images);
    rx_record_add(record, "RECORD", "rextract -REPLAY repeats the run from this line to END", "%s",
                  RX_RECORD_VERSION);
    rx_record_add(record, "VERSION", "of rextract", "%s", RX_VERSION);
    rx_record_add(record, "MACHINE", "class of machines that gives the same bits", "%s",
                  machine.data != NULL ? machine.data : "");
    rx_record_add(record, "IMAGE", "image, or two", "%s", images);
    if (!rx_config_visit(config, add_keyword, &k) || k.set.failed || machine.failed)
        record->failed = true;
    rx_record_add(record, "SET", "keywords that were set; the others are defaults", "%s",
                  k.set.data != NULL ? k.set.data : "");
    rx_text_free(&k.set);
    rx_text_free(&machine);
}

static void add_input(void *user, const char *key, const char *name, const char *digest)
{
    rx_record_add(user, "READ", "digest, keyword and name of a file that was read", "%s %s %s", digest, key,
                  name);
}

rx_status rx_record_inputs(rx_record *record, const rx_config *config, const rx_options *options,
                           const char *detect, const char *measure, rx_error *err)
{
    rx_status status =
        rx_inputs_visit(config, options, (const char *const[2]){detect, measure}, 1, add_input, record, err);
    return status == RX_OK && record->failed ? rx_error_memory(err, 0) : status;
}

rx_status rx_record_file(rx_record *record, const char *key, const char *name, rx_error *err)
{
    char digest[RX_HASH_TEXT];
    int there = 0;
    RX_TRY(rx_input_digest(key, name, digest, &there, err));
    if (!there)
        return rx_error_at(err, RX_INPUT, name, -1, 0, "was removed after it was read (%s)", key);
    const size_t used = strlen(digest) + strlen(key) + 2;
    for (int i = 0; i < record->n; i++) {
        const char *value = record->pairs[i][1];
        if (strcmp(record->pairs[i][0], "READ") == 0 && strlen(value) > used &&
            strcmp(value + used, name) == 0 && strncmp(value + strlen(digest) + 1, key, strlen(key)) == 0)
            return RX_OK;
    }
    add_input(record, key, name, digest);
    return record->failed ? rx_error_memory(err, 0) : RX_OK;
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

void rx_record_cards(const rx_record *record, rx_text *cards)
{
    for (int i = 0; i < record->n; i++)
        rx_card_record(cards, record->pairs[i][0], record->pairs[i][1], record->pairs[i][2]);
}
