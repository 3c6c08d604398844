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

static rx_status take_way(rx_settings *settings, const char *key, char *value, rx_error *err)
{
    const int row = rx_keyword_find(settings->table, key);
    return settings->origin[row] == RX_FROM_DEFAULT
               ? rx_keyword_assign(settings, row, &value, 1, (rx_place){0}, NULL, err)
               : RX_OK;
}

/* A survey's file that does without restoration means SExtractor's thresholds, filter and sky where it does not name its own; and
 * who names a filter, or a threshold, means sigmas of a pixel behind SExtractor's. */
static rx_status take_survey_ways(rx_settings *settings, rx_error *err)
{
    static const char *const sextractors[] = {"FILTER", "FILTER_NAME", "DETECT_THRESH", "THRESH_TYPE"};
    const rx_config *config = (const rx_config *)settings;
    bool conv = false;
    if (settings->repeated.n > 0)
        return RX_OK;
    if (settings->file != NULL && config->restore_type.n == 1 &&
        strcmp(config->restore_type.v[0], "NONE") == 0) {
        RX_TRY(take_way(settings, "THRESH_TYPE", "RELATIVE", err));
        RX_TRY(take_way(settings, "BACK_PASSES", "1", err));
        conv = true;
    }
    for (size_t i = 0; i < sizeof sextractors / sizeof *sextractors; i++)
        conv |= settings->origin[rx_keyword_find(settings->table, sextractors[i])] != RX_FROM_DEFAULT;
    if (conv)
        RX_TRY(take_way(settings, "FILTER_TYPE", "CONV", err));
    return strcmp(config->filter_type, "CONV") == 0 ? take_way(settings, "DETECT_THRESH", "1.5", err) : RX_OK;
}

/* The file that the row means, where that is not as given, into *path; nothing where it is, or where it is nowhere. */
static void look_for(const rx_settings *settings, const rx_keyword *key, const char *name, rx_text *path)
{
    const char *slash = settings->file != NULL ? strrchr(settings->file, '/') : NULL;
    const bool bare = strchr(name, '/') == NULL; /* its reader takes an installed file of that name first */
    rx_text_add(path, name);
    if (there(path)) {
        rx_text_free(path);
        if (key->search == RX_SEARCH_INSTALLED && bare)
            rx_text_printf(path, "./%s", name);
        return;
    }
    if (name[0] != '/' && slash != NULL) {
        rx_text_free(path);
        rx_text_printf(path, "%.*s/%s", (int)(slash - settings->file), settings->file, name);
    }
    if (!there(path) && bare) {
        rx_text_free(path);
        rx_text_printf(path, "%s/%s", RX_DATA_FOLDER, name);
    }
}

rx_status rx_settings_find_files(rx_settings *settings, rx_log *log, rx_error *err)
{
    rx_status status = RX_OK;
    rx_text said = {0}; /* in one line of the log */
    if (settings->table == rx_keytable_rextract())
        RX_TRY(take_survey_ways(settings, err));
    for (int i = 0; i < RX_PARTS && settings->part[i] != NULL; i++)
        if (settings->part[i]->table == rx_keytable_rextract())
            RX_TRY(take_survey_ways(settings->part[i], err));
    for (int row = 0; row < settings->table->nrows && status == RX_OK; row++) {
        const rx_keyword *key = &settings->table->rows[row];
        rx_text path = {0};
        if (key->search == RX_SEARCH_NONE || settings->origin[row] == RX_FROM_DEFAULT ||
            !rx_keyword_counts(settings, row))
            continue;
        const char *name = *(char *const *)((const char *)settings + key->offset);
        if (name[0] == '\0')
            continue;
        look_for(settings, key, name, &path);
        const char *joint = said.length > 0 ? "; " : "";
        if (path.failed)
            status = rx_error_memory(err, 0);
        else if (path.data != NULL && there(&path)) {
            char *found = path.data;
            rx_text_printf(&said, "%s%s %s is %s", joint, key->name, name, found);
            status = rx_keyword_assign(settings, row, &found, 1, (rx_place){0}, NULL, err);
        } else if (path.data != NULL && key->search == RX_SEARCH_BUILT_IN && strcmp(name, key->initial) == 0)
            rx_text_printf(&said, "%s%s %s is found nowhere: the built-in one is used", joint, key->name,
                           name);
        rx_text_free(&path);
    }
    if (said.failed && status == RX_OK)
        status = rx_error_memory(err, 0);
    else if (said.length > 0)
        rx_log_info(log, "%s", said.data);
    rx_text_free(&said);
    return status;
}
