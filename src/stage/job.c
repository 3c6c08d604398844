/* The job of rextract on arrays and on files, for other programs. */
#include "stage/job.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "check/checks.h"
#include "config/arguments.h"
#include "config/config_fields.h"
#include "stage/extract.h"
#include "stage/options.h"
#include "stage/stage.h"
#include "stage/tile_facts.h"

/* Keywords that ask for what is done with files only. */
static rx_status refuse_files(const rx_config *config, rx_error *err)
{
    const struct {
        const char *key;
        bool set;
        const char *instead;
    } files[] = {
        {"WEIGHT_IMAGE", rx_settings_states(&config->settings, "WEIGHT_IMAGE"), "give the map as an array"},
        {"FLAG_IMAGE", rx_settings_states(&config->settings, "FLAG_IMAGE"), "run rextract on files"},
        {"POSITIONS_NAME", config->positions_name[0] != '\0', "run rextract on files"},
        {"REFERENCE_NAME", config->reference_name[0] != '\0', "run rextract on files"},
        {"RECORD_NAME", config->record_name[0] != '\0', "run rextract on files"},
        {"the record of a run", config->settings.repeated.n > 0, "run rextract on files"}};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++)
        if (files[i].set)
            return rx_error_set(err, RX_USAGE, "%s is not for an image in memory; %s", files[i].key,
                                files[i].instead);
    if (config->restore_type.n != 1)
        return rx_error_set(err, RX_USAGE, "RESTORE_TYPE: %d are named; give one, and run once for each",
                            config->restore_type.n);
    return RX_OK;
}

static rx_status configure(const rx_job *job, rx_log *log, rx_config **dst, rx_error *err)
{
    RX_TRY(rx_config_new(dst, err));
    rx_settings *settings = &(*dst)->settings;
    if (job->config != NULL)
        RX_TRY(rx_settings_read(settings, job->config, log, err));
    for (int i = 0; i < job->nsettings; i++)
        RX_TRY(rx_settings_set(settings, job->settings[i].name, job->settings[i].value, log, err));
    RX_TRY(rx_settings_complete(settings, log, err));
    return refuse_files(*dst, err);
}

static rx_status make_options(const rx_job *job, rx_log *log, rx_job_result *dst, rx_error *err)
{
    rx_column_list *columns = NULL;
    RX_TRY(configure(job, log, &dst->config, err));
    if (job->ncolumns > 0)
        RX_TRY(rx_columns_of(job->columns, job->ncolumns, &columns, err));
    RX_TRY(rx_options_with_columns(dst->config, columns, log, &dst->options, err));
    return rx_settings_warn_idle(&dst->config->settings, rx_options_idle(dst->options->columns), log, err);
}

/* Pixels from arrays to sky, noise and, where `what` says so, PSF. */
static rx_status open_field(const rx_options *options, int what, const rx_job_images *images, rx_log *log,
                            rx_field **dst, rx_error *err)
{
    const int role = (what & RX_FIELD_MEASURED) != 0;
    const rx_psf_pixels *image = images->image_of_psf[role];
    rx_tile *tile = NULL;
    rx_psf *psf = NULL;
    RX_TRY(rx_tile_lend(&options->tile[role], role ? images->measure : images->detect, log, &tile, err));
    rx_status status = RX_OK;
    if (images->psf[role] == NULL && image != NULL)
        status = rx_psf_of_pixels(&options->pipeline.psf, image, tile->width, tile->height, log, &psf, err);
    if (status == RX_OK)
        status = rx_field_prepare(&options->pipeline, what, tile, psf != NULL ? psf : images->psf[role], log,
                                  dst, err);
    else
        rx_tile_free(tile);
    rx_psf_free(psf);
    return status;
}

enum { X, Y, MAG, GALAXY, ROUND, FOUND, MAG_FOUND, NCOLUMNS };

static const rx_column injected_columns[NCOLUMNS] = {
    [X] = {"X_IMAGE", "pixel", "", "Where it was injected, x from 1", .type = RX_CELL_DOUBLE},
    [Y] = {"Y_IMAGE", "pixel", "", "The same in y", .type = RX_CELL_DOUBLE},
    [MAG] = {"MAG", "mag", "", "Its magnitude", .type = RX_CELL_DOUBLE},
    [GALAXY] = {"GALAXY", "", "", "1: a galaxy, 0: a star", .type = RX_CELL_INT16},
    [ROUND] = {"ROUND", "", "", "Copy of the tile it was injected into, from 1", .type = RX_CELL_INT32},
    [FOUND] = {"FOUND", "", "", "1: it was found", .type = RX_CELL_INT16},
    [MAG_FOUND] = {"MAG_FOUND", "mag", "", "As measured (QA_MAG), NaN: not found", .type = RX_CELL_DOUBLE}};

static rx_status list_injected(const rx_selfcheck *check, rx_table **dst, rx_error *err)
{
    const rx_qa_list *truth = &check->truth, *found = &check->found_list;
    RX_TRY(rx_table_make("INJECTED", injected_columns, NCOLUMNS, truth->n, dst, err));
    for (long i = 0; i < truth->n; i++) {
        const long j = check->partner[i];
        const double round = floor((truth->x[i] + 1.0) / check->pitch);
        const double values[NCOLUMNS] = {[X] = truth->x[i] - round * check->pitch + 1.0,
                                         [Y] = truth->y[i] + 1.0,
                                         [MAG] = truth->mag[i],
                                         [GALAXY] = check->is_galaxy[i],
                                         [ROUND] = round + 1,
                                         [FOUND] = j >= 0,
                                         [MAG_FOUND] = j >= 0 ? found->mag[j] : NAN};
        for (int c = 0; c < NCOLUMNS; c++)
            rx_column_set(&(*dst)->columns[c], i, values[c], NULL);
    }
    return RX_OK;
}

/* Restoration to measurement, with the checks that were asked for. */
static rx_status extract(const rx_options *options, rx_log *log, rx_job_result *dst, rx_error *err)
{
    rx_run run = {.kind = options->restorers[0]};
    rx_checks *checks = NULL;
    rx_status status = RX_OK;
    RX_TRY_EXIT(rx_checks_new(&options->pipeline, &options->check, dst->detect, log, &checks, err));
    RX_TRY_EXIT(rx_run_extract(&run,
                               &(rx_extraction_input){.options = options,
                                                      .detect = dst->detect,
                                                      .measure = dst->measure,
                                                      .checks = checks,
                                                      .kept = &dst->result,
                                                      .facts = &dst->facts},
                               log, err));
    rx_runs_warn(&run, 1, dst->detect->tile, log);
    dst->table = run.file[RX_RUN_CATALOG].tables[0];
    run.ntables = 0;
    if (run.checks.self.injected > 0)
        status = list_injected(&run.checks.self, &dst->injected, err);
exit:
    rx_checks_free(checks);
    rx_run_free(&run);
    return status;
}

static rx_status run_arrays(const rx_job *job, const rx_job_images *images, rx_log *log, rx_job_result *dst,
                            rx_error *err)
{
    RX_TRY(make_options(job, log, dst, err));
    const rx_options *options = dst->options;
    const rx_pipeline_params *params = &options->pipeline;
    const bool checked = options->check.self_check || options->check.blank_check > 0;
    const int asked = rx_pipeline_psf(params, options->restorers[0]);
    const bool psf = job->psf_only || options->check.self_check || asked == RX_FIELD_PSF;
    if (images->measure != NULL && checked)
        return rx_error_set(err, RX_USAGE,
                            "SELF_CHECK and BLANK_CHECK speak of one image; leave out the second one, or "
                            "the checks");
    rx_log_part(log, "sky and PSF", 0.0, 0.1);
    RX_TRY(open_field(options, psf ? RX_FIELD_PSF : asked, images, log, &dst->detect, err));
    if (images->measure != NULL) {
        const bool other = params->templates.wanted || (psf && !params->measure_original);
        RX_TRY(open_field(options, RX_FIELD_MEASURED | (other ? RX_FIELD_PSF : 0), images, log, &dst->measure,
                          err));
    }
    if (job->psf_only && dst->detect->psf != NULL)
        rx_psf_facts(dst->detect->psf, &dst->facts);
    if (!job->psf_only)
        RX_TRY(extract(options, log, dst, err));
    rx_log_part(log, "done", 1.0, 1.0);
    return dst->facts.failed ? rx_error_memory(err, 0) : RX_OK;
}

rx_status rx_job_arrays(const rx_job *job, const rx_job_images *images, rx_log *log, rx_job_result *dst,
                        rx_error *err)
{
    *dst = (rx_job_result){0};
    const rx_status status = run_arrays(job, images, log, dst, err);
    if (status != RX_OK)
        rx_job_result_free(dst);
    return status;
}

void rx_job_result_free(rx_job_result *result)
{
    rx_table_free(result->table);
    rx_table_free(result->injected);
    rx_record_free(&result->facts);
    rx_result_free(&result->result);
    rx_field_free(result->measure);
    rx_field_free(result->detect);
    rx_options_free(result->options);
    rx_config_free(result->config);
    *result = (rx_job_result){0};
}

/* -KEYWORD of each setting; argv [4 + 2 * nsettings], keywords in `dashed`. */
static int command_line(const rx_job *job, const char *image, rx_text *dashed, char **argv)
{
    int argc = 0;
    argv[argc++] = "rextract";
    argv[argc++] = (char *)image;
    if (job->config != NULL) {
        argv[argc++] = "-c";
        argv[argc++] = (char *)job->config;
    }
    for (int i = 0; i < job->nsettings; i++) {
        rx_text_printf(&dashed[i], "-%s", job->settings[i].name);
        argv[argc++] = dashed[i].data;
        argv[argc++] = (char *)job->settings[i].value;
    }
    return argc;
}

rx_status rx_job_files(const rx_job *job, const char *image, rx_log *log, rx_error *err)
{
    const size_t n = (size_t)job->nsettings;
    rx_arguments arguments = {.action = RX_ACTION_NONE};
    rx_tile_facts facts = {0};
    rx_log silent;
    rx_log_calls(&silent, RX_QUIET, NULL, NULL, NULL);
    log = log != NULL ? log : &silent;
    rx_text *dashed = RX_NEW(rx_text, n);
    char **argv = RX_NEW(char *, 4 + 2 * n);
    rx_status status = RX_OK;
    if (dashed == NULL || argv == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    if (job->ncolumns > 0)
        RX_TRY_EXIT(rx_error_set(err, RX_USAGE, "columns of a catalogue file are those of PARAMETERS_NAME"));
    if (image[0] == '@' || image[0] == '-')
        RX_TRY_EXIT(rx_error_set(err, RX_USAGE,
                                 "'%.200s' is no image; lists of tiles are for the program: rextract @FILE",
                                 image));
    const int argc = command_line(job, image, dashed, argv);
    for (size_t i = 0; i < n; i++)
        if (dashed[i].failed)
            RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(rx_arguments_read(rx_keytable_rextract(), argc, argv, log, &arguments, err));
    const rx_config *config = (const rx_config *)arguments.settings;
    const char *alone = arguments.action == RX_ACTION_FLAGS  ? "-FLAGS"
                        : arguments.action == RX_ACTION_INFO ? "-INFO"
                        : arguments.action != RX_ACTION_RUN  ? "an option that prints"
                        : config->plan                       ? "-PLAN"
                        : config->record_name[0] != '\0'     ? "RECORD_NAME"
                                                             : NULL;
    if (alone == NULL && strcmp(config->catalog_name, "STDOUT") == 0)
        alone = "CATALOG_NAME STDOUT"; /* the caller's stdout is not ours */
    if (alone != NULL)
        RX_TRY_EXIT(rx_error_set(err, RX_USAGE, "%s is for the program rextract; leave it out here", alone));
    rx_log_part(log, "files", 0.0, 0.1);
    RX_TRY_EXIT(rx_stage_run(config, arguments.image, stdout, log, &facts, err));
    rx_log_part(log, "done", 1.0, 1.0);
exit:
    for (size_t i = 0; dashed != NULL && i < n; i++)
        rx_text_free(&dashed[i]);
    free(dashed);
    free(argv);
    rx_arguments_free(&arguments);
    rx_tile_facts_free(&facts);
    return status;
}

const char *rx_job_version(void)
{
    return RX_VERSION;
}
