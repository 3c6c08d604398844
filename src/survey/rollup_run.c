/* Records in, report out. */
#include "survey/rollup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/interrupt.h"
#include "base/lines.h"
#include "base/memory.h"
#include "io/output.h"

/* Names of files: one by one, or in lists, "@FILE", one a line (blank lines and those that begin with # do not count). */
typedef struct file_names {
    int n;
    char **of; /* [n] owned */
} file_names;

static rx_status add_name(file_names *files, const char *name, rx_error *err)
{
    char **grown = rx_regrow(files->of, (size_t)files->n + 1, sizeof *grown), *own = rx_strdup(name);
    if (grown != NULL)
        files->of = grown;
    if (grown == NULL || own == NULL) {
        free(own);
        return rx_error_memory(err, 0);
    }
    files->of[files->n++] = own;
    return RX_OK;
}

static rx_status read_list(file_names *files, const char *path, rx_error *err)
{
    rx_lines lines;
    char *line = NULL;
    rx_status status = rx_lines_open(&lines, path, 0, err);
    while (status == RX_OK && (status = rx_lines_next(&lines, &line, err)) == RX_OK && line != NULL) {
        line[strcspn(line, "\r")] = '\0';
        if (line[0] != '#' && line[strspn(line, " \t")] != '\0')
            status = add_name(files, line, err);
    }
    rx_lines_close(&lines);
    return status;
}

static rx_status read_names(const char *given, file_names *dst, rx_error *err)
{
    rx_status status = RX_OK;
    *dst = (file_names){0};
    for (const char *at = given; *at != '\0' && status == RX_OK;) {
        const size_t length = strcspn(at, "\n");
        char *one = strndup(at, length);
        status = one == NULL     ? rx_error_memory(err, length)
                 : one[0] == '@' ? read_list(dst, one + 1, err)
                                 : add_name(dst, one, err);
        free(one);
        at += length + (at[length] == '\n');
    }
    return status;
}

static void free_names(file_names *names)
{
    for (int i = 0; i < names->n; i++)
        free(names->of[i]);
    free(names->of);
    *names = (file_names){0};
}

static rx_status read_records(rx_rollup *rollup, const char *path, rx_error *err)
{
    rx_record_reader *reader = NULL;
    const rx_tile_record *record = NULL;
    int64_t at = 0;
    rx_status status = rx_record_reader_open(path, 0, &reader, err);
    while (status == RX_OK && (status = rx_record_reader_next(reader, &record, &at, err)) == RX_OK &&
           record != NULL) {
        status = rx_rollup_add(rollup, record, path, at, err);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
    }
    rx_record_reader_close(reader);
    return status;
}

/* The record of a tile once more, from its file. */
static rx_status print_again(rx_text *dst, const rx_rollup_tile *tile, rx_error *err)
{
    rx_record_reader *reader = NULL;
    const rx_tile_record *record = NULL;
    int64_t at = 0;
    rx_status status;
    RX_TRY_EXIT(rx_record_reader_open(tile->path, tile->at, &reader, err));
    RX_TRY_EXIT(rx_record_reader_next(reader, &record, &at, err));
    rx_hash sum;
    char digest[RX_HASH_TEXT] = "";
    if (record != NULL) {
        rx_tile_record_print(dst, record);
        if (dst->failed)
            RX_TRY_EXIT(rx_error_memory(err, dst->length));
        rx_hash_begin(&sum);
        rx_hash_add(&sum, dst->data, dst->length);
        rx_hash_text(&sum, digest);
    }
    if (strcmp(digest, tile->digest) != 0)
        status = rx_error_at(err, RX_INPUT, tile->path, -1, 0,
                             "has changed while it was read; give a file that nothing writes to");
exit:
    rx_record_reader_close(reader);
    return status;
}

static rx_status write_merged(const char *path, const rx_rollup *rollup, rx_outputs *outputs, rx_error *err)
{
    const char *temporary = NULL;
    rx_text_file file = {0};
    RX_TRY(rx_outputs_file(outputs, path, &temporary, err));
    rx_status status = rx_text_file_open(&file, temporary, path, err);
    for (int i = 0; i < rollup->ntiles && status == RX_OK; i++) {
        rx_text text = {0};
        status = print_again(&text, rollup->tile[i], err);
        if (status == RX_OK)
            status = rx_text_file_add(&file, &text, err);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
        rx_text_free(&text);
    }
    return rx_text_file_close(&file, status, err);
}

static void tell(const rx_rollup *r, rx_log *log)
{
    rx_log_info(
        log,
        "%d tiles: %d fine, %d failed, %d without a record, %d with a quality gate that failed, %d with "
        "one that is undecided, %d others stand out",
        r->ntiles + r->nmissing, r->fine, r->failed, r->nmissing, r->gates, r->undecided, r->apart);
    if (r->lower > 0)
        rx_log_info(log, "%d of %d images have a PSF that is not from several stars of their own: psfs.ecsv",
                    r->lower, r->npsfs);
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

static rx_status read_all(rx_rollup *rollup, const rx_survey_config *config, const file_names *files,
                          rx_error *err)
{
    rx_status status = RX_OK;
    struct stat info;
    const bool merges = config->merged_name[0] != '\0';
    for (int i = 0; i < files->n && status == RX_OK; i++) {
        if (merges && stat(files->of[i], &info) == 0 && (S_ISFIFO(info.st_mode) || S_ISCHR(info.st_mode)))
            return rx_error_at(err, RX_INPUT, files->of[i], -1, 0,
                               "is no file, and MERGED_NAME has to read it twice; give a file");
        status = read_records(rollup, files->of[i], err);
    }
    return status;
}

static rx_status write_all(const rx_rollup *rollup, const rx_survey_config *config, rx_log *log,
                           rx_error *err)
{
    rx_outputs *outputs = NULL;
    const char *folder = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_outputs_new(&outputs, err));
    if (config->merged_name[0] != '\0')
        RX_TRY_EXIT(write_merged(config->merged_name, rollup, outputs, err));
    RX_TRY_EXIT(rx_outputs_folder(outputs, config->output_name, &folder, err));
    RX_TRY_EXIT(rx_rollup_report(rollup, config->qa_figures, folder, config->output_name, log, err));
    RX_TRY_EXIT(rx_outputs_commit(outputs, err));
    tell(rollup, log);
    rx_outputs_log(outputs, NULL, log);
exit:
    rx_outputs_free(outputs);
    return status;
}

rx_status rx_rollup_files(const rx_survey_config *config, const char *given, rx_log *log, rx_error *err)
{
    rx_tiles *tiles = NULL;
    rx_rollup rollup;
    file_names files = {0};
    rx_status status;
    rx_rollup_begin(config, &rollup);
    RX_TRY_EXIT(read_names(given, &files, err));
    RX_TRY_EXIT(read_all(&rollup, config, &files, err));
    if (config->tiles_name[0] != '\0')
        RX_TRY_EXIT(rx_tiles_read(config->tiles_name, &tiles, err));
    if (rollup.ntiles == 0 && tiles == NULL)
        RX_TRY_EXIT(
            files.n == 1
                ? rx_error_at(err, RX_INPUT, files.of[0], -1, 0,
                              "holds no record of a tile; give what RECORD_NAME of rextract has written")
                : rx_error_set(err, RX_INPUT,
                               "none of the %d files holds a record of a tile; give what RECORD_NAME of "
                               "rextract has written",
                               files.n));
    RX_TRY_EXIT(rx_rollup_end(&rollup, tiles, err));
    RX_TRY_EXIT(write_all(&rollup, config, log, err));
exit:
    rx_rollup_free(&rollup);
    rx_tiles_free(tiles);
    free_names(&files);
    return status;
}
