/* rextract: where the files that a configuration names are. */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/text.h"
#include "config/config_fields.h"
#include "config/keyword.h"

static bool there(const rx_text *path)
{
    return !path->failed && access(path->data, F_OK) == 0;
}

static bool reads_network(const rx_config *config)
{
    for (int i = 0; i < config->restore_type.n; i++)
        if (strcmp(config->restore_type.v[i], "NET") == 0 || strcmp(config->restore_type.v[i], "AUTO") == 0)
            return true;
    return false;
}

/* A survey's file that does without restoration means SExtractor's thresholds and sky where it does not name its own. */
static rx_status take_survey_ways(rx_settings *settings, rx_error *err)
{
    const rx_config *config = (const rx_config *)settings;
    const struct {
        const char *key;
        char *value;
    } ways[] = {{"THRESH_TYPE", "RELATIVE"}, {"BACK_PASSES", "1"}};
    if (settings->file == NULL || config->restore_type.n != 1 ||
        strcmp(config->restore_type.v[0], "NONE") != 0)
        return RX_OK;
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
        const int row = rx_keyword_find(settings->table, ways[i].key);
        char *value = ways[i].value;
        if (settings->origin[row] == RX_FROM_DEFAULT)
            RX_TRY(rx_keyword_assign(settings, row, &value, 1, (rx_place){0}, NULL, err));
    }
    return RX_OK;
}

rx_status rx_config_find_files(rx_settings *settings, rx_log *log, rx_error *err)
{
    const rx_config *config = (const rx_config *)settings;
    const struct {
        const char *key, *name;
        bool read;      /* or nothing of the configuration asks for it */
        bool built_in;  /* where a file of the default's name is missing */
        bool installed; /* its reader takes a name without a slash for an installed file first */
    } files[] = {{"PARAMETERS_NAME", config->parameters_name, true, true, false},
                 {"FILTER_NAME", config->filter_name, config->filter, true, false},
                 {"NOISE_KERNEL_NAME", config->noise_kernel_name,
                  strcmp(config->noise_correlation, "FILE") == 0, false, false},
                 {"STARNNW_NAME", config->starnnw_name, true, false, false},
                 {"QA_GATES", config->qa_gates, config->reference_name[0] != '\0', false, false},
                 {"NET_MODEL", config->net_model, reads_network(config), false, true}};
    const char *file = settings->file != NULL ? settings->file : "", *slash = strrchr(file, '/');
    rx_status status = take_survey_ways(settings, err);
    rx_text said = {0}; /* in one line of the log */
    for (size_t i = 0; i < sizeof files / sizeof files[0] && status == RX_OK; i++) {
        const int row = rx_keyword_find(settings->table, files[i].key);
        const char *name = files[i].name;
        rx_text path = {0};
        rx_text_add(&path, name);
        if (settings->origin[row] == RX_FROM_DEFAULT || !files[i].read || name[0] == '\0' ||
            (there(&path) && !(files[i].installed && strchr(name, '/') == NULL))) {
            rx_text_free(&path);
            continue;
        }
        if (there(&path)) { /* named and here: not the installed one */
            rx_text_free(&path);
            rx_text_printf(&path, "./%s", name);
        } else if (name[0] != '/' && slash != NULL) {
            rx_text_free(&path);
            rx_text_printf(&path, "%.*s/%s", (int)(slash - file), file, name);
        }
        if (!there(&path) && strchr(name, '/') == NULL) {
            rx_text_free(&path);
            rx_text_printf(&path, "%s/%s", RX_DATA_FOLDER, name);
        }
        if (there(&path)) {
            rx_text_printf(&said, "%s%s %s is %s", said.length > 0 ? "; " : "", files[i].key, name,
                           path.data);
            char *found = path.data;
            status = rx_keyword_assign(settings, row, &found, 1, (rx_place){0}, NULL, err);
        } else if (path.failed)
            status = rx_error_memory(err, 0);
        else if (files[i].built_in && strcmp(name, settings->table->rows[row].initial) == 0)
            rx_text_printf(&said, "%s%s %s is found nowhere: the built-in one is used",
                           said.length > 0 ? "; " : "", files[i].key, name);
        rx_text_free(&path);
    }
    if (said.failed && status == RX_OK)
        status = rx_error_memory(err, 0);
    else if (said.length > 0)
        rx_log_info(log, "%s", said.data);
    rx_text_free(&said);
    return status;
}
