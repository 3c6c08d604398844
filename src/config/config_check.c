/* What one keyword says about another, and what has no effect here. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "config/keyword.h"

/* An error about keyword `row`, with the line that set it when a file did. */
#define REFUSE(NAME, ...) refuse(config, RX_KEY_##NAME, err, __VA_ARGS__)
RX_PRINTF(4, 5)
static rx_status refuse(const rx_config *config, int row, rx_error *err, const char *format, ...)
{
    char text[RX_ERROR_TEXT];
    const char *name = rx_keyword_row(row)->name;
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (config->origin[row] == RX_FROM_FILE)
        return rx_error_at(err, RX_USAGE, config->file, -1, config->line[row], "%s: %s", name, text);
    return rx_error_set(err, RX_USAGE, "-%s: %s", name, text);
}

static bool is(const char *word, const char *other)
{
    return strcmp(word, other) == 0;
}

static bool has(const rx_words *list, const char *word)
{
    for (int i = 0; i < list->n; i++)
        if (is(list->v[i], word))
            return true;
    return false;
}

static rx_status check_restorers(const rx_config *config, rx_error *err)
{
    const rx_words *list = &config->restore_type;
    for (int i = 0; i < list->n; i++)
        for (int j = 0; j < i; j++)
            if (is(list->v[i], list->v[j]))
                return REFUSE(RESTORE_TYPE, "%s is named twice; name each restorer once", list->v[i]);
    return RX_OK;
}

static rx_status check_images(const rx_config *config, rx_error *err)
{
    const rx_words *checks = &config->checkimage_type;
    const rx_words *weights = &config->weight_type;
    int wanted = 0;
    for (int i = 0; i < checks->n; i++)
        if (!is(checks->v[i], "NONE"))
            wanted = i + 1;
    if (wanted > config->checkimage_name.n)
        return REFUSE(CHECKIMAGE_NAME,
                      "names %d file(s) for %d check-image(s) of CHECKIMAGE_TYPE; give one each",
                      config->checkimage_name.n, wanted);
    bool maps = has(weights, "MAP_RMS") || has(weights, "MAP_VAR") || has(weights, "MAP_WEIGHT");
    if (maps && config->weight_image.n == 0)
        return REFUSE(WEIGHT_IMAGE, "is empty; name the weight map that WEIGHT_TYPE asks for");
    if (is(config->detect_type, "PHOTO"))
        return REFUSE(DETECT_TYPE, "PHOTO (photographic plates) is not offered; give CCD");
    return RX_OK;
}

static rx_status check_limits(const rx_config *config, rx_error *err)
{
    if (config->memory_pixstack_max < config->memory_pixstack)
        return REFUSE(MEMORY_PIXSTACK_MAX, "%d is below MEMORY_PIXSTACK, %d; give at least that",
                      config->memory_pixstack_max, config->memory_pixstack);
    if (config->deblend_maxobj_max < config->deblend_maxobj)
        return REFUSE(DEBLEND_MAXOBJ_MAX, "%d is below DEBLEND_MAXOBJ, %d; give at least that",
                      config->deblend_maxobj_max, config->deblend_maxobj);
    return RX_OK;
}

static rx_status check_report(const rx_config *config, rx_error *err)
{
    const double *range = config->qa_mag_range.v;
    if (config->qa_gates[0] != '\0' && config->reference_name[0] == '\0')
        return REFUSE(QA_GATES, "needs a reference catalogue; give REFERENCE_NAME too");
    if (config->reference_columns.n == 1 || config->reference_columns.n == 2)
        return REFUSE(REFERENCE_COLUMNS, "has %d item(s), needs <x>,<y>,<magnitude or flux>[,<error>]",
                      config->reference_columns.n);
    if (range[2] <= 0.0)
        return REFUSE(QA_MAG_RANGE, "the step %g must be above 0", range[2]);
    if (range[0] > range[1])
        return REFUSE(QA_MAG_RANGE, "%g is above %g; give <low>,<high>,<step>", range[0], range[1]);
    return RX_OK;
}

/* One warning per IGNORED keyword whose value is not the default. */
static rx_status warn_ignored(const rx_config *config, rx_log *log, rx_error *err)
{
    rx_config *defaults = NULL;
    rx_status status = rx_config_new(&defaults, err);
    for (int row = 0; row < RX_KEY_ROWS && status == RX_OK; row++) {
        const rx_keyword *key = rx_keyword_row(row);
        if (key->kind == RX_KIND_SECTION || key->status != RX_STATUS_IGNORED)
            continue;
        rx_text ours = {0}, normal = {0};
        rx_keyword_print(&ours, config, row, false);
        rx_keyword_print(&normal, defaults, row, false);
        if (ours.failed || normal.failed)
            status = rx_error_memory(err, 0);
        else if (!is(ours.data, normal.data))
            rx_log_warning(log, "%s %s has no effect here (%s)", key->name, ours.data, key->help);
        rx_text_free(&ours);
        rx_text_free(&normal);
    }
    rx_config_free(defaults);
    return status;
}

rx_status rx_config_check(const rx_config *config, rx_log *log, rx_error *err)
{
    rx_status status = check_restorers(config, err);
    if (status == RX_OK)
        status = check_images(config, err);
    if (status == RX_OK)
        status = check_limits(config, err);
    if (status == RX_OK)
        status = check_report(config, err);
    if (status == RX_OK)
        status = warn_ignored(config, log, err);
    return status;
}
