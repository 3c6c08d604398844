/* The main job for one tile, the paper's Figure 1 read from top to bottom:
 *
 *   open tile -> background -> psf            field.c
 *   restore -> detect -> templates ->
 *   measure -> table                          probe.c and extract.c, once per restorer
 *   catalogues, check-images, report          here
 *
 * Outputs are written under temporary names and renamed together at the end.
 */
#include "stage/stage.h"

#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/names.h"
#include "io/output.h"
#include "io/tile.h"
#include "stage/checks.h"
#include "stage/extract.h"
#include "stage/field.h"
#include "stage/record.h"
#include "stage/report.h"
#include "stage/tile_facts.h"

typedef struct job {
    const rx_config *config;
    const rx_options *options;
    rx_log *log;
    FILE *standard_out; /* of a catalogue named STDOUT */
    rx_outputs *outputs;
    char *detect, *measure; /* image names; measure NULL without dual-image mode */
    rx_record record;       /* of the whole run */
    int inputs_recorded;
    rx_record products; /* and what it made */
    rx_run runs[RX_MAX_RUNS];
    rx_table *reference;
    rx_verdict verdict;
    rx_text brief;        /* of the report */
    rx_text fallbacks;    /* a line for each run that another restorer did */
    rx_tile_facts *facts; /* or NULL */
} job;

static int any_needs_psf(const rx_options *options)
{
    for (int i = 0; i < options->nrestorers; i++)
        if (options->restorers[i]->needs_psf)
            return 1;
    return 0;
}

/* Open the outputs first: an unwritable folder is told before the work, not after it. */
static rx_status open_runs(job *job, int nextensions, rx_error *err)
{
    const rx_options *options = job->options;
    rx_status status = RX_OK;
    for (int i = 1; i <= nextensions && status == RX_OK; i++)
        status = rx_report_try(options, nextensions > 1 ? i : 0, err);
    for (int i = 0; i < options->nrestorers && status == RX_OK; i++)
        status = rx_run_open(&job->runs[i], options, options->restorers[i], options->nrestorers > 1,
                             job->outputs, err);
    return status;
}

static rx_status same_shape(const rx_field *detect, const rx_field *measure, rx_error *err)
{
    const rx_tile *a = detect->tile, *b = measure->tile;
    if (a->width == b->width && a->height == b->height)
        return RX_OK;
    return rx_error_at(err, RX_INPUT, b->name, b->hdu, 0,
                       "has %d x %d pixels, the detection image %d x %d; dual-image mode needs the same grid",
                       b->width, b->height, a->width, a->height);
}

/* The report, whose counts go to the facts. */
static rx_status report(job *job, const rx_field *detect, const rx_field *measure, int extension,
                        rx_error *err)
{
    const rx_options *options = job->options;
    rx_extension_facts *facts = NULL;
    rx_verdict verdict = RX_VERDICT_NONE;
    rx_status status = RX_OK;
    if (job->facts != NULL)
        status = rx_tile_facts_add(job->facts, detect, job->runs, options->nrestorers, job->reference != NULL,
                                   &facts, err);
    if (status != RX_OK || job->reference == NULL)
        return status;
    for (int i = 0; i < options->nrestorers && facts != NULL; i++)
        job->runs[i].tally = facts->run[i].tally;
    status = rx_report_write(options, detect, measure != NULL ? measure : detect, job->reference, job->runs,
                             extension, &job->record, job->outputs, job->log, &verdict, &job->brief, err);
    job->verdict = rx_verdict_worse(job->verdict, verdict);
    if (facts != NULL)
        facts->verdict = verdict;
    return status;
}

/* Is there an output that tells what was read? */
static int is_recorded(const rx_options *options)
{
    return rx_catalog_has_record(options->catalog_type) || options->nchecks > 0 ||
           options->templates.covariances[0] != '\0' || options->reference.name != NULL ||
           options->self_check;
}

/* After the first image was read, which finds what is wrong with a file sooner than its digest. */
static rx_status record_inputs(job *job, rx_error *err)
{
    if (job->inputs_recorded || !is_recorded(job->options))
        return RX_OK;
    job->inputs_recorded = 1;
    return rx_record_inputs(&job->record, job->config, job->options, job->detect, job->measure, err);
}

static rx_status run_extension(job *job, int hdu, int measure_hdu, int extension, int nextensions,
                               rx_error *err)
{
    const rx_options *options = job->options;
    rx_field *detect = NULL, *measure = NULL;
    rx_checks *checks = NULL;
    const int templates = options->templates.wanted;
    const int need_psf = any_needs_psf(options) || options->self_check || templates;
    rx_status status =
        rx_field_open(options, 0, job->detect, hdu, extension, need_psf, job->log, &detect, err);
    if (status == RX_OK && job->measure != NULL) {
        status =
            rx_field_open(options, 1, job->measure, measure_hdu, extension,
                          templates || (need_psf && !options->measure_original), job->log, &measure, err);
        if (status == RX_OK)
            status = same_shape(detect, measure, err);
    }
    if (status == RX_OK && job->reference != NULL)
        status = rx_reference_check(&options->reference, job->reference,
                                    measure != NULL ? measure->tile : detect->tile, err);
    if (status == RX_OK)
        status = rx_checks_new(options, detect, job->log, &checks, err);
    if (status == RX_OK)
        status = record_inputs(job, err);
    for (int i = 0; i < options->nrestorers && status == RX_OK; i++) {
        status = rx_run_extract(&job->runs[i], options, detect, measure, checks, &job->record, &job->products,
                                job->log, err);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
    }
    for (int i = 0; i < options->nrestorers && status == RX_OK; i++)
        if (job->runs[i].by != NULL)
            rx_text_printf(&job->fallbacks, "%s[%d]: %s: done by %s, %s\n", detect->tile->name,
                           detect->tile->hdu, job->runs[i].kind->name, job->runs[i].by, job->runs[i].why);
    if (status == RX_OK && job->fallbacks.failed)
        status = rx_error_memory(err, 0);
    if (status == RX_OK)
        status = report(job, detect, measure, nextensions > 1 ? extension : 0, err);
    if (status == RX_OK)
        status = rx_report_checks(options, checks, job->runs, nextensions > 1 ? extension : 0, &job->record,
                                  job->outputs, job->log, err);
    for (int i = 0; i < options->nrestorers; i++)
        rx_run_forget(&job->runs[i]);
    rx_checks_free(checks);
    rx_field_free(measure);
    rx_field_free(detect);
    return status;
}

static rx_status run_all(job *job, rx_error *err)
{
    const rx_options *options = job->options;
    int *hdus = NULL, *measure_hdus = NULL, n = 0, nmeasure = 0;
    rx_status status = rx_tile_list(job->detect, job->log, &hdus, &n, err);
    if (status == RX_OK && job->measure != NULL)
        status = rx_tile_list(job->measure, job->log, &measure_hdus, &nmeasure, err);
    if (status == RX_OK && job->measure != NULL && n != nmeasure)
        status = rx_error_at(err, RX_INPUT, job->measure, -1, 0,
                             "has %d images, the detection file %d; name the HDUs", nmeasure, n);
    if (status == RX_OK && options->reference.name != NULL)
        status = rx_catalog_read(options->reference.name, 0, &job->reference, err);
    if (status == RX_OK)
        status = open_runs(job, n, err);
    for (int i = 0; i < n && status == RX_OK; i++)
        status = run_extension(job, hdus[i], measure_hdus != NULL ? measure_hdus[i] : 0, i + 1, n, err);
    for (int i = 0; i < options->nrestorers && status == RX_OK; i++)
        status = rx_run_digest(&job->runs[i], options, &job->products, err);
    for (int i = 0; i < options->nrestorers && status == RX_OK; i++)
        status = rx_run_close(&job->runs[i], options, &job->record, &job->products, job->standard_out, err);
    if (status == RX_OK)
        status = rx_interrupt_check(err);
    if (status == RX_OK)
        status = rx_outputs_commit(job->outputs, err);
    free(hdus);
    free(measure_hdus);
    return status;
}

/* The text goes to the log, a line at a time. */
static void tell(rx_log *log, void (*say)(rx_log *, const char *, ...), const rx_text *text)
{
    for (const char *line = text->data; line != NULL && *line != '\0';) {
        size_t length = strcspn(line, "\n");
        say(log, "%.*s", (int)length, line);
        line += length + (line[length] == '\n');
    }
}

static rx_status verdict_status(rx_verdict verdict, const char *folder, rx_error *err)
{
    if (verdict == RX_VERDICT_FAIL)
        return rx_error_set(err, RX_GATE_FAIL, "a quality gate FAILED; see %s/report.html", folder);
    if (verdict == RX_VERDICT_INSUFFICIENT)
        return rx_error_set(err, RX_GATE_INSUFFICIENT,
                            "too few sources to decide every quality gate; see %s/report.html", folder);
    return RX_OK;
}

rx_status rx_stage_run(const rx_config *config, const char *image, FILE *standard_out, rx_log *log,
                       rx_tile_facts *facts, rx_error *err)
{
    rx_options *options = NULL;
    job *j = RX_NEW(job, 1);
    if (j == NULL)
        return rx_error_memory(err, sizeof *j);
    j->config = config;
    j->log = log;
    j->standard_out = standard_out;
    j->facts = facts;
    rx_status status = rx_options_from_config(config, log, &options, err);
    if (status != RX_OK) {
        free(j);
        return status;
    }
    j->options = options;
    rx_record_run(&j->record, config, image);
    if (j->record.failed || !rx_name_split_images(image, &j->detect, &j->measure)) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    if (j->measure != NULL && (options->self_check || options->blank_check > 0)) {
        status = rx_error_set(err, RX_USAGE,
                              "SELF_CHECK and BLANK_CHECK speak of one image; leave out the second one, or "
                              "the checks");
        goto exit;
    }
    status = rx_outputs_new(&j->outputs, err);
    if (status == RX_OK)
        status = run_all(j, err);
    if (status == RX_OK) {
        tell(log, rx_log_info, &j->brief);
        tell(log, rx_log_warning, &j->fallbacks);
        if (facts != NULL) /* -REPLAY wants none, and keeps no output */
            rx_outputs_tell(j->outputs,
                            strcmp(options->catalog_name, "STDOUT") == 0 ? "standard output" : NULL, log);
        status = verdict_status(j->verdict, options->qa_name, err);
    }
exit:
    for (int i = 0; i < options->nrestorers; i++)
        rx_run_free(&j->runs[i]);
    rx_outputs_free(j->outputs);
    rx_table_free(j->reference);
    rx_record_free(&j->record);
    rx_record_free(&j->products);
    rx_text_free(&j->brief);
    rx_text_free(&j->fallbacks);
    free(j->detect);
    free(j->measure);
    rx_options_free(options);
    free(j);
    return status;
}
