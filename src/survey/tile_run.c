/* Tiles through the stage. */
#include "survey/survey.h"

#include <stdlib.h>
#include <sys/stat.h>

#include "base/names.h"
#include "base/reserve.h"
#include "config/config_fields.h"
#include "io/output.h"
#include "stage/options.h"
#include "stage/stage.h"
#include "survey/tile_record.h"

static rx_status write_file(const char *path, const rx_text *text, rx_log *log, rx_error *err)
{
    rx_outputs *outputs = NULL;
    const char *temporary = NULL;
    rx_status status = rx_outputs_new(&outputs, err);
    if (status == RX_OK)
        status = rx_outputs_file(outputs, path, &temporary, err);
    if (status == RX_OK)
        status = rx_text_write_file(text, temporary, path, err);
    if (status == RX_OK)
        status = rx_outputs_commit(outputs, err);
    if (status == RX_OK)
        rx_outputs_log(outputs, NULL, log);
    rx_outputs_free(outputs);
    return status;
}

static rx_status write_record(const char *path, const char *image, rx_status ended, const rx_error *why,
                              const rx_tile_facts *facts, rx_log *log, rx_error *err)
{
    rx_text text = {0};
    char line[RX_ERROR_WHERE + RX_ERROR_TEXT + 128] = "";
    rx_tile_record record = {.image = (char *)image, /* lent, as all of it */
                             .name = rx_name_stem(image),
                             .version = RX_VERSION,
                             .status = (int)ended,
                             .what = line,
                             .facts = *facts};
    if (ended != RX_OK)
        rx_error_format(why, "rextract", line, sizeof line);
    if (record.name != NULL)
        rx_tile_record_print(&text, &record);
    rx_status status =
        record.name == NULL || text.failed ? rx_error_memory(err, 0) : write_file(path, &text, log, err);
    free(record.name);
    rx_text_free(&text);
    return status;
}

static int by_others(const rx_tile_facts *facts)
{
    int n = 0;
    for (int k = 0; k < facts->n; k++)
        for (int i = 0; i < facts->extension[k].nruns; i++)
            n += facts->extension[k].run[i].by[0] != '\0';
    return n;
}

rx_status rx_tile_run(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                      int *others, rx_error *err)
{
    const rx_config *config = (const rx_config *)settings;
    rx_tile_facts facts = {0};
    rx_error why = rx_error_part(err), trouble = rx_error_part(err);
    rx_log_tile_begin(log);
    rx_status status = rx_stage_run(config, image, standard_out, log, &facts, &why);
    status = rx_reserve_end(status, &why);
    rx_log_progress_end(log);
    if (config->record_name[0] != '\0' && status != RX_INTERRUPTED) {
        const rx_status written =
            write_record(config->record_name, image, status, &why, &facts, log, &trouble);
        if (status == RX_OK && written != RX_OK) {
            status = written;
            why = trouble;
        }
    }
    rx_log_tile_end(log, status != RX_OK);
    if (others != NULL)
        *others = by_others(&facts);
    rx_error_take(err, &why);
    rx_tile_facts_free(&facts);
    return status;
}

rx_status rx_tile_run_listed(const rx_tiles *tiles, int i, const rx_settings *common, FILE *standard_out,
                             rx_log *log, int *others, rx_error *err)
{
    rx_settings *settings = NULL;
    *others = 0;
    rx_status status = rx_tiles_settings(tiles, i, common, log, &settings, err);
    if (status == RX_OK)
        status = rx_tile_run(settings, rx_tiles_image(tiles, i), standard_out, log, others, err);
    rx_settings_free(settings);
    return status;
}

rx_status rx_tile_check(const rx_settings *common, const rx_tiles *tiles, rx_log *log, rx_error *err)
{
    const rx_config *config = (const rx_config *)common;
    rx_column_list *columns = NULL;
    struct stat info;
    /* a FIFO can be read only once, by the tile; errors are those of the tiles, too */
    if (stat(config->parameters_name, &info) != 0 || S_ISREG(info.st_mode))
        rx_options_columns(config, NULL, &columns, NULL);
    rx_idle idle = rx_options_idle(columns);
    const rx_status status =
        tiles != NULL ? rx_tiles_check(tiles, common, &idle, log, err) : rx_idle_add(&idle, common, err);
    if (status == RX_OK)
        rx_idle_warn(&idle, log);
    rx_idle_free(&idle);
    rx_columns_free(columns);
    return status;
}
