/* Settings and inputs of a campaign as names and values. */
#include "lab/report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

/* Keywords with a blank on each side. How the work is done and where it goes: decides nothing. */
static const char WORKING[] = " NTHREADS VERBOSE_TYPE OUTPUT_NAME JOURNAL_NAME SHARD MERGE ";
/* Used by the report alone: may change after the work is done. */
static const char REPORTING[] = " QA_FIGURES EXAMPLES PRECISIONS ";
/* Outputs and lists of the other programs that a campaign never makes or reads. */
static const char UNUSED[] =
    " CATALOG_NAME CATALOG_TYPE PARAMETERS_NAME CHECKIMAGE_TYPE CHECKIMAGE_NAME ASSOC_NAME REFERENCE_NAME "
    "QA_NAME QA_GATES XML_NAME IMAGE_NAME SHARP_NAME TRUTH_NAME TRUTH_TYPE FLAG_NAME HEADER_SUFFIX ";

static int among(const char *list, const char *name)
{
    char word[64];
    snprintf(word, sizeof word, " %s ", name);
    return strstr(list, word) != NULL;
}

/* The name without the prefix of its program; *kept: 0 where it says nothing of the campaign. */
static const char *bare(const char *name, int *kept)
{
    const char *dot = strchr(name, '.'), *keyword = dot != NULL ? dot + 1 : name;
    *kept = !among(WORKING, keyword) && !(dot != NULL && among(UNUSED, keyword));
    return keyword;
}

/* A fact for each file in a list of names apart by commas; [hdu] after a name belongs to the fact. */
static void add_files(rx_text *facts, const char *name, const char *value)
{
    char *copy = rx_strdup(value);
    if (copy == NULL) {
        facts->failed = true;
        return;
    }
    for (char *rest, *item = strtok_r(copy, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
        char text[160], digest[RX_HASH_TEXT];
        int there = 0;
        char *bracket = strchr(item, '[');
        if (bracket != NULL)
            *bracket = '\0';
        if (rx_hash_file(item, digest, &there, NULL) == RX_OK && there) {
            const char *part = bracket != NULL ? value + (bracket + 1 - copy) : "";
            const int length = bracket != NULL ? (int)strcspn(part, "]") : 0;
            snprintf(text, sizeof text, "%s%s%.*s", digest, length > 0 ? " " : "", length, part);
            rx_journal_fact(facts, name, text);
        }
    }
    free(copy);
}

static void visit_fact(void *user, const char *name, const char *value, const char *help)
{
    static const char *const ends[] = {"_NAME", "_IMAGE", "_CONFIG", "_MODEL"}; /* of those that name files */
    (void)help;
    int kept, is_file = 0;
    const char *keyword = bare(name, &kept);
    const size_t length = strlen(keyword);
    if (!kept || among(REPORTING, keyword))
        return;
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++)
        is_file |= length > strlen(ends[i]) && strcmp(keyword + length - strlen(ends[i]), ends[i]) == 0;
    if (is_file)
        add_files(user, name, value);
    else
        rx_journal_fact(user, name, value);
}

static void add_names(rx_text *dst, int n, const rx_lab_column *columns)
{
    for (int i = 0; i < n; i++)
        rx_text_printf(dst, "%s%s%s%s%s", dst->length > 0 ? " " : "", columns[i].name,
                       columns[i].unit[0] != '\0' ? "[" : "", columns[i].unit,
                       columns[i].unit[0] != '\0' ? "]" : "");
}

/* "= TABLE.name ..." */
static void add_schema(rx_text *facts, const rx_lab_schema *schema)
{
    rx_text names = {0};
    char name[64];
    snprintf(name, sizeof name, "TABLE.%s", schema->name);
    add_names(&names, schema->nown, schema->own);
    if (schema->neach > 0)
        rx_text_add(&names, names.length > 0 ? "; each run:" : "each run:");
    add_names(&names, schema->neach, schema->each);
    facts->failed |= names.failed;
    if (!names.failed)
        rx_journal_fact(facts, name, names.data);
    rx_text_free(&names);
}

/* Templates may come from a folder or a list: what was read counts. */
static void add_templates(rx_text *facts, const rx_templates *templates)
{
    char digest[RX_HASH_TEXT];
    rx_hash sum;
    rx_hash_begin(&sum);
    for (int i = 0; i < templates->n; i++) {
        const rx_template *one = &templates->list[i];
        const size_t n = (size_t)one->width * (size_t)one->height;
        const double numbers[] = {one->width, one->pixel_scale, one->fwhm};
        rx_hash_add(&sum, numbers, sizeof numbers);
        rx_hash_add(&sum, one->pixels, n * sizeof *one->pixels);
    }
    rx_hash_text(&sum, digest);
    rx_journal_fact(facts, "templates", digest);
}

rx_status rx_lab_facts(const rx_lab *lab, rx_text *dst, rx_error *err)
{
    int c = 0;
    rx_journal_fact(dst, "version", RX_VERSION);
    dst->failed |= !rx_settings_visit(&lab->config->settings, false, visit_fact, dst);
    if (lab->options->model != NULL)
        rx_journal_fact(dst, "model", lab->options->model->digest);
    while (c < lab->nskies && lab->sky[c].simulation == NULL)
        c++; /* templates are the same under every condition */
    if (c < lab->nskies && lab->sky[c].simulation->templates != NULL)
        add_templates(dst, lab->sky[c].simulation->templates);
    for (int t = 0; t < lab->kind->ntables; t++)
        add_schema(dst, &lab->kind->tables[t]);
    return dst->failed ? rx_error_memory(err, dst->length) : RX_OK;
}

/* --- for the report --- */

typedef struct visitor {
    const rx_settings *settings;
    rx_record *keywords;
    rx_text *command;
} visitor;

/* A keyword, and those of the command line as arguments that a shell takes. */
static void visit_record(void *user, const char *name, const char *value, const char *help)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.,/:+-@%=";
    (void)help;
    const visitor *v = user;
    int kept;
    bare(name, &kept);
    if (!kept)
        return;
    rx_record_add(v->keywords, name, "", "%s", value);
    const char *quote = value[0] != '\0' && value[strspn(value, plain)] == '\0' ? "" : "'";
    if (rx_settings_was_set(v->settings, name) == RX_FROM_COMMAND)
        rx_text_printf(v->command, " -%s %s%s%s", name, quote, value, quote);
}

rx_status rx_lab_settings(const rx_lab *lab, rx_record *keywords, rx_text *command, rx_error *err)
{
    const rx_settings *settings = &lab->config->settings;
    rx_text_add(command, "rextract-validate");
    if (settings->file != NULL)
        rx_text_printf(command, " -c %s", settings->file);
    rx_record_add(keywords, "version", "", "%s", RX_VERSION);
    return rx_settings_visit(settings, false, visit_record, &(visitor){settings, keywords, command}) &&
                   !keywords->failed && !command->failed
               ? RX_OK
               : rx_error_memory(err, 0);
}
