/* One tile after the other, their records, and the account of a list. */
#include "survey/survey.h"

#include <stdlib.h>
#include <sys/stat.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/names.h"
#include "config/config_fields.h"
#include "io/output.h"
#include "stage/options.h"
#include "stage/stage.h"
#include "survey/tile_record.h"

enum { LINE = RX_ERROR_WHERE + RX_ERROR_TEXT + 128 };

/* --- one tile --- */

/* The record as a file. */
static rx_status write_record(const char *path, const rx_tile_record *record, rx_log *log, rx_error *err)
{
    rx_outputs *outputs = NULL;
    const char *temporary = NULL;
    rx_text text = {0};
    rx_status status;
    rx_tile_record_print(&text, record);
    if (text.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(rx_outputs_new(&outputs, err));
    RX_TRY_EXIT(rx_outputs_file(outputs, path, &temporary, err));
    RX_TRY_EXIT(rx_text_write_file(&text, temporary, path, err));
    RX_TRY_EXIT(rx_outputs_commit(outputs, err));
    rx_outputs_log(outputs, NULL, log);
exit:
    rx_outputs_free(outputs);
    rx_text_free(&text);
    return status;
}

/* The tile, then its record. *others: images that another restorer did than was asked for, once for each restorer. Status
 * and errors of the run; where that is fine, those of writing the record. */
static rx_status run_tile(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                          int *others, rx_error *err)
{
    const rx_config *config = (const rx_config *)settings;
    char line[LINE] = "";
    rx_error why = rx_error_part(err), trouble = rx_error_part(err);
    rx_tile_record record = {.image = (char *)image, /* lent, as all but name and facts */
                             .version = RX_VERSION,
                             .what = line};
    rx_log_tile_begin(log);
    rx_status status = rx_stage_run(config, image, standard_out, log, &record.facts, &why);
    status = rx_memory_end(status, &why);
    rx_log_progress_end(log);
    if (config->record_name[0] != '\0' && status != RX_INTERRUPTED) {
        record.status = (int)status;
        record.name = rx_name_stem(image);
        if (status != RX_OK)
            rx_error_format(&why, "rextract", line, sizeof line);
        const rx_status written = record.name != NULL
                                      ? write_record(config->record_name, &record, log, &trouble)
                                      : rx_error_memory(&trouble, 0);
        if (status == RX_OK && written != RX_OK) {
            status = written;
            why = trouble;
        }
        free(record.name);
    }
    rx_log_tile_end(log, status != RX_OK);
    for (int k = 0; k < record.facts.n; k++)
        for (int i = 0; i < record.facts.extension[k].nruns; i++)
            *others += record.facts.extension[k].run[i].by[0] != '\0';
    rx_error_take(err, &why);
    rx_tile_facts_free(&record.facts);
    return status;
}

/* Before the first tile: the list, where it is not NULL, and a warning of the keywords that were given in vain. */
static rx_status check(const rx_settings *common, const rx_tiles *tiles, rx_log *log, rx_error *err)
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

/* --- a list --- */

rx_status rx_survey_open(rx_survey_list *s, const char *path, rx_error *err)
{
    s->begun = rx_seconds();
    RX_TRY(rx_tiles_read(path, &s->tiles, err));
    RX_TRY(check(s->common, s->tiles, s->log, err));
    return RX_MAKE(s->outcome, (size_t)s->tiles->n, err);
}

rx_outcome rx_survey_tile(const rx_survey_list *s, int i, rx_error *why)
{
    const double begun = rx_seconds();
    rx_settings *settings = NULL;
    rx_outcome outcome = {.done = 1,
                          .status = rx_tiles_settings(s->tiles, i, s->common, s->log, &settings, why)};
    if (outcome.status == RX_OK)
        outcome.status =
            run_tile(settings, rx_tiles_image(s->tiles, i), s->standard_out, s->log, &outcome.others, why);
    rx_settings_free(settings);
    outcome.seconds = rx_seconds() - begun;
    return outcome;
}

rx_status rx_survey_add(rx_survey_list *s, int i, rx_outcome outcome, const rx_error *why, rx_error *err)
{
    char line[LINE];
    rx_error named = *why;
    const char *verdict = outcome.status == RX_GATE_FAIL           ? "a quality gate failed"
                          : outcome.status == RX_GATE_INSUFFICIENT ? "too few sources for a quality gate"
                                                                   : "failed";
    if (outcome.status != RX_OK) {
        rx_error_where(&named, outcome.status, rx_tiles_image(s->tiles, i), named.hdu, named.line);
        rx_error_format(&named, verdict, line, sizeof line);
        rx_log_warning(s->log, "%s", line);
        outcome.what = rx_strdup(line);
    }
    s->outcome[i] = outcome;
    return outcome.status == RX_OK || outcome.what != NULL ? RX_OK : rx_error_memory(err, sizeof line);
}

/* To the log. Returns what the whole ends with, with its error. */
static rx_status summarise(const rx_survey_list *s, rx_error *err)
{
    const char *path = s->tiles->path;
    const int n = s->tiles->n;
    int fine = 0, gates = 0, undecided = 0, left = 0, others = 0;
    char by_others[64] = "";
    for (const rx_outcome *o = s->outcome; o < s->outcome + n; o++) {
        left += !o->done;
        others += o->others > 0;
        fine += o->done && o->status == RX_OK;
        gates += o->status == RX_GATE_FAIL;
        undecided += o->status == RX_GATE_INSUFFICIENT;
    }
    const int failed = n - fine - gates - undecided - left;
    if (others > 0)
        snprintf(by_others, sizeof by_others, ", %d by another restorer", others);
    rx_log_info(s->log,
                "%d tiles in %.1f s: %d fine, %d failed, %d with a quality gate that failed, %d with one "
                "that is undecided, %d not begun%s",
                n, rx_seconds() - s->begun, fine, failed, gates, undecided, left, by_others);
    for (int i = 0; i < n; i++)
        if (s->outcome[i].status != RX_OK)
            rx_log_info(s->log, "line %ld, exit status %d after %.1f s: %s", s->tiles->tile[i].line,
                        (int)s->outcome[i].status, s->outcome[i].seconds, s->outcome[i].what);
    if (failed > 0)
        return rx_error_at(err, RX_SOME_FAILED, path, -1, 0, "%d of %d tiles failed; the others are done",
                           failed, n);
    if (gates > 0)
        return rx_error_at(err, RX_GATE_FAIL, path, -1, 0, "a quality gate FAILED for %d of %d tiles", gates,
                           n);
    if (undecided > 0)
        return rx_error_at(err, RX_GATE_INSUFFICIENT, path, -1, 0,
                           "too few sources to decide every quality gate of %d of %d tiles", undecided, n);
    return RX_OK;
}

void rx_survey_free(rx_survey_list *s)
{
    for (int i = 0; s->outcome != NULL && i < s->tiles->n; i++)
        free(s->outcome[i].what);
    free(s->outcome);
    rx_tiles_free(s->tiles);
}

rx_status rx_survey_close(rx_survey_list *s, rx_status status, rx_error *err)
{
    int ended = 0;
    if (s->outcome != NULL) {
        for (int i = 0; i < s->tiles->n; i++)
            ended += s->outcome[i].done;
        if (status == RX_INTERRUPTED)
            rx_error_at(err, RX_INTERRUPTED, s->tiles->path, -1, 0,
                        "interrupted by a signal; %d of %d tiles had ended before", ended, s->tiles->n);
        const rx_status all = summarise(s, status == RX_OK ? err : NULL);
        status = status == RX_OK ? all : status;
    }
    rx_survey_free(s);
    return status;
}

rx_status rx_survey_run(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                        rx_error *err)
{
    rx_survey_list s = {.common = settings, .standard_out = standard_out, .log = log};
    int others = 0;
    if (image[0] != '@') {
        RX_TRY(check(settings, NULL, log, err));
        return run_tile(settings, image, standard_out, log, &others, err);
    }
    rx_status status = rx_survey_open(&s, image + 1, err);
    for (int i = 0; status == RX_OK && i < s.tiles->n; i++) {
        rx_error why = rx_error_part(err);
        rx_log_info(log, "tile %d of %d: %s", i + 1, s.tiles->n, rx_tiles_image(s.tiles, i));
        const rx_outcome ended = rx_survey_tile(&s, i, &why);
        if (ended.status != RX_INTERRUPTED)
            status = rx_survey_add(&s, i, ended, &why, err);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
    }
    return rx_survey_close(&s, status, err);
}
