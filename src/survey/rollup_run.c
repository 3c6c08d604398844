/* Records in, report out. */
#include "survey/rollup_run.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "io/output.h"
#include "survey/rollup.h"
#include "survey/rollup_report.h"

enum { MAX_LIST_BYTES = 1 << 28 };

/* A file name per line; blank lines and those that begin with '#' do not count. */
static rx_status read_listed(const char *path, rx_tile_records *dst, rx_error *err)
{
    char *text = NULL;
    rx_status status = rx_text_read_file(path, MAX_LIST_BYTES, &text, NULL, err);
    char *rest = NULL;
    for (char *line = status == RX_OK ? strtok_r(text, "\r\n", &rest) : NULL; line != NULL && status == RX_OK;
         line = strtok_r(NULL, "\r\n", &rest))
        if (line[0] != '#' && line[strspn(line, " \t")] != '\0') {
            status = rx_tile_records_read(dst, line, err);
            if (status == RX_OK)
                status = rx_interrupt_check(err);
        }
    free(text);
    return status;
}

static rx_status write_merged(const char *path, const rx_tile_records *records, rx_outputs *outputs,
                              rx_error *err)
{
    const char *temporary = NULL;
    rx_status status = rx_outputs_file(outputs, path, &temporary, err);
    FILE *file = status == RX_OK ? fopen(temporary, "w") : NULL;
    int failed = status == RX_OK && file == NULL;
    for (int i = 0; file != NULL && i < records->n && !failed && status == RX_OK; i++) {
        rx_text text = {0};
        rx_tile_record_print(&text, &records->record[i]);
        if (text.failed)
            status = rx_error_memory(err, text.length);
        else
            failed = fwrite(text.data, 1, text.length, file) != text.length;
        rx_text_free(&text);
    }
    failed |= file != NULL && fclose(file) != 0;
    return failed ? rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be written; is the disk full?") : status;
}

static void tell(const rx_rollup *r, rx_log *log)
{
    rx_log_info(
        log,
        "%d tiles: %d fine, %d failed, %d without a record, %d with a quality gate that failed, %d with "
        "one that is undecided",
        r->records->n + r->nmissing, r->fine, r->failed, r->nmissing, r->gates, r->undecided);
    for (int i = 0; i < r->nruns; i++) {
        const rx_rollup_run *run = &r->run[i];
        const rx_rollup_cell *cell = &run->whole;
        char bias[40] = ", no bias within 50 mag";
        if (isfinite(cell->bias))
            snprintf(bias, sizeof bias, ", bias %+.4f mag", cell->bias);
        if (cell->recall.n > 0)
            rx_log_info(log, "%-8s %ld sources on %ld images; recall %.3f, precision %.3f%s", run->name,
                        run->sources, run->tiles, cell->recall.value, cell->precision.value,
                        cell->pairs > 0 ? bias : ", nothing matched");
        else
            rx_log_info(log, "%-8s %ld sources on %ld images, without a reference catalogue", run->name,
                        run->sources, run->tiles);
    }
}

rx_status rx_rollup_files(const rx_survey_config *config, const char *name, rx_log *log, rx_error *err)
{
    rx_tile_records records = {0};
    rx_tiles *tiles = NULL;
    rx_rollup rollup = {0};
    rx_outputs *outputs = NULL;
    const char *folder = NULL;
    rx_status status =
        name[0] == '@' ? read_listed(name + 1, &records, err) : rx_tile_records_read(&records, name, err);
    if (status == RX_OK)
        status = rx_tile_records_settle(&records, err);
    if (status == RX_OK && config->tiles_name[0] != '\0')
        status = rx_tiles_read(config->tiles_name, &tiles, err);
    if (status == RX_OK && records.n == 0 && tiles == NULL)
        status = rx_error_at(err, RX_INPUT, name + (name[0] == '@'), -1, 0,
                             "holds no record of a tile; give what RECORD_NAME of rextract has written");
    if (status == RX_OK)
        status = rx_rollup_make(config, &records, tiles, &rollup, err);
    if (status == RX_OK)
        status = rx_outputs_new(&outputs, err);
    if (status == RX_OK && config->merged_name[0] != '\0')
        status = write_merged(config->merged_name, &records, outputs, err);
    if (status == RX_OK)
        status = rx_outputs_folder(outputs, config->output_name, &folder, err);
    if (status == RX_OK)
        status = rx_rollup_report(&rollup, config->qa_figures, folder, config->output_name, log, err);
    if (status == RX_OK)
        status = rx_outputs_commit(outputs, err);
    if (status == RX_OK)
        tell(&rollup, log);
    rx_outputs_free(outputs);
    rx_rollup_free(&rollup);
    rx_tiles_free(tiles);
    rx_tile_records_free(&records);
    return status;
}
