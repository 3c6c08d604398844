/* The main job for one tile, the paper's Figure 1 read from top to bottom:
 *
 *   open tile                                 open.c
 *   background -> psf                         pipeline/field.c
 *   restore -> detect -> templates -> measure pipeline/pipeline.c, once per restorer
 *   table                                     extract.c
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
#include "check/checks.h"
#include "config/config_fields.h"
#include "io/output.h"
#include "io/tile.h"
#include "pipeline/field.h"
#include "stage/extract.h"
#include "stage/open.h"
#include "stage/provenance.h"
#include "stage/report.h"
#include "stage/run_xml.h"
#include "stage/tile_facts.h"

typedef struct job {
    const rx_config *config;
    const rx_options *options;
    rx_log *log;
    FILE *standard_out; /* of a catalogue named STDOUT */
    rx_outputs *outputs;
    const char *image;      /* as it was named */
    char *detect, *measure; /* image names; measure NULL without dual-image mode */
    rx_record record;       /* of the whole run */
    int inputs_recorded;
    rx_record products; /* and what it made */
    rx_run runs[RX_MAX_RUNS];
    rx_table *reference;
    rx_verdict verdict;
    rx_tile_facts *facts; /* or NULL */
    const char *xml;      /* where it is written; NULL: it is not */
    rx_text warnings;     /* of the run, for it */
} job;

/* Open the outputs first: an unwritable folder is reported before the work, not after it. */
static rx_status open_runs(job *job, int nextensions, rx_error *err)
{
    const rx_options *options = job->options;
    for (int i = 1; i <= nextensions; i++)
        RX_TRY(rx_report_try(job->config, options, job->image, nextensions > 1 ? i : 0, err));
    if (job->config->write_xml && job->facts != NULL)
        RX_TRY(rx_outputs_file(job->outputs, job->config->xml_name, &job->xml, err));
    for (int i = 0; i < options->nrestorers; i++)
        RX_TRY(rx_run_open(&job->runs[i], options, options->restorers[i], options->nrestorers > 1,
                           job->outputs, err));
    return RX_OK;
}

/* The short table of the report, a line at a time; a gate that passed may stay away. */
static void tell(rx_log *log, const rx_text *text)
{
    static const char passed[] = ": PASS";
    for (const char *line = text->data; line != NULL && *line != '\0';) {
        const size_t length = strcspn(line, "\n"), tail = sizeof passed - 1;
        if (length > tail && strncmp(line + length - tail, passed, tail) == 0)
            rx_log_hint(log, "%.*s", (int)length, line);
        else
            rx_log_info(log, "%.*s", (int)length, line);
        line += length + (line[length] == '\n');
    }
}

/* The report, whose counts go to the facts. */
static rx_status report(job *job, const rx_report_input *in, rx_error *err)
{
    rx_extension_facts *facts = NULL;
    rx_verdict verdict = RX_VERDICT_NONE;
    rx_text brief = {0};
    const int n = job->options->nrestorers;
    if (job->facts != NULL)
        RX_TRY(rx_tile_facts_add(job->facts, in->fields.detect, job->runs, n, job->reference != NULL, &facts,
                                 err));
    if (facts != NULL)
        rx_tile_facts_cards(facts, in->fields.measure->tile, job->config->record_cards.n,
                            (const char *const *)job->config->record_cards.v);
    if (job->reference == NULL && !job->options->tile_page)
        return RX_OK;
    for (int i = 0; i < n && facts != NULL; i++)
        job->runs[i].tally = facts->run[i].tally;
    const rx_status status = rx_stage_report(in, facts, &verdict, &brief, err);
    if (status == RX_OK)
        tell(job->log, &brief);
    rx_text_free(&brief);
    job->verdict = rx_verdict_worse(job->verdict, verdict);
    if (facts != NULL)
        facts->verdict = verdict;
    return status;
}

/* After the first image was read, which finds what is wrong with a file sooner than its digest; and the files that only
 * the stars of this image, or their lack, made inputs. */
static rx_status record_inputs(job *job, const rx_field *detect, const rx_field *measure, rx_error *err)
{
    const rx_field *fields[] = {detect, measure};
    const rx_config *config = job->config;
    const rx_options *options = job->options;
    /* is there an output that says what was read, or must it be compared? */
    const bool recorded = rx_catalog_has_record(options->catalog_type) || options->nchecks > 0 ||
                          options->covariance_name[0] != '\0' || options->positions != NULL ||
                          options->reference.name != NULL || options->tile_page ||
                          options->check.self_check || options->write_psf || config->write_xml ||
                          config->settings.repeated.n > 0,
               first = !job->inputs_recorded;
    if (recorded && first)
        RX_TRY(rx_record_inputs(&job->record, config, options, job->detect, job->measure, err));
    job->inputs_recorded = 1;
    for (int role = 0; role < 2; role++) {
        const rx_record *read = fields[role] != NULL ? &fields[role]->inputs : NULL;
        if (read != NULL && read->failed)
            return rx_error_memory(err, 0);
        for (int i = 0; read != NULL && i < read->n; i++) {
            RX_TRY(rx_settings_check_read(&config->settings, read->pairs[i][1], err));
            if (recorded)
                RX_TRY(rx_record_file(&job->record, read->pairs[i][0], read->pairs[i][1], err));
        }
    }
    return first ? rx_repeat_check(&config->settings, &job->record, job->log, err) : RX_OK;
}

static rx_status run_extension(job *job, int hdu, int measure_hdu, int extension, int nextensions,
                               rx_error *err)
{
    const rx_options *options = job->options;
    rx_field *detect = NULL, *measure = NULL;
    rx_checks *checks = NULL;
    const int templates = options->pipeline.templates.wanted;
    int asked = options->check.self_check || options->write_psf || options->tile_page ? RX_FIELD_PSF : 0;
    for (int i = 0; i < options->nrestorers; i++)
        asked |= rx_pipeline_psf(&options->pipeline, options->restorers[i]);
    const int need_psf = (asked & RX_FIELD_PSF) != 0;
    int done = 0;
    rx_status status;
    rx_log_step(job->log, need_psf ? "reading, sky, noise, PSF" : "reading, sky, noise");
    RX_TRY_EXIT(rx_field_open(options, asked, &(rx_image_place){job->detect, hdu, extension}, job->log,
                              &detect, err));
    if (job->measure != NULL) {
        const int what = templates || (need_psf && !options->pipeline.measure_original) ? RX_FIELD_PSF : 0;
        RX_TRY_EXIT(rx_field_open(options, RX_FIELD_MEASURED | what,
                                  &(rx_image_place){job->measure, measure_hdu, extension}, job->log, &measure,
                                  err));
        rx_log_info(job->log, "two images: sources are detected on %s[%d] and measured on %s[%d]",
                    detect->tile->name, detect->tile->hdu, measure->tile->name, measure->tile->hdu);
    }
    const rx_fields fields = {detect, measure != NULL ? measure : detect};
    if (job->reference != NULL)
        RX_TRY_EXIT(rx_reference_check(&options->reference, job->reference, fields.measure->tile, err));
    RX_TRY_EXIT(rx_checks_new(&options->pipeline, &options->check, detect, job->log, &checks, err));
    RX_TRY_EXIT(record_inputs(job, detect, measure, err));
    const rx_extraction_input work = {.options = options,
                                      .detect = detect,
                                      .measure = measure,
                                      .checks = checks,
                                      .record = &job->record,
                                      .products = &job->products};
    while (done < options->nrestorers && status == RX_OK) {
        status = rx_run_extract(&job->runs[done], &work, job->log, err);
        done += status == RX_OK;
        if (status == RX_OK)
            status = rx_interrupt_check(err);
    }
    rx_runs_warn(job->runs, done, detect->tile, job->log);
    if (status != RX_OK)
        goto exit;
    const rx_report_input about = {.options = options,
                                   .fields = fields,
                                   .reference = job->reference,
                                   .runs = job->runs,
                                   .extension = nextensions > 1 ? extension : 0,
                                   .record = &job->record,
                                   .outputs = job->outputs,
                                   .log = job->log};
    if (job->reference != NULL || options->tile_page)
        rx_log_step(job->log, "report");
    RX_TRY_EXIT(report(job, &about, err));
    status = rx_report_checks(&about, checks, err);
exit:
    for (int i = 0; i < options->nrestorers; i++)
        rx_run_forget(&job->runs[i]);
    if (extension < nextensions)
        rx_log_tile_next(job->log);
    rx_checks_free(checks);
    rx_field_free(measure);
    rx_field_free(detect);
    return status;
}

static rx_status run_all(job *job, rx_error *err)
{
    const rx_options *options = job->options;
    int *hdus = NULL, *measure_hdus = NULL, n = 0, nmeasure = 0;
    rx_status status;
    RX_TRY_EXIT(rx_tile_list(job->detect, job->log, &hdus, &n, err));
    if (job->measure != NULL)
        RX_TRY_EXIT(rx_tile_list(job->measure, job->log, &measure_hdus, &nmeasure, err));
    if (job->measure != NULL && n != nmeasure)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, job->measure, -1, 0,
                                "has %d images, the detection file %d; name the HDUs", nmeasure, n));
    if (n > 1 && options->columns_built_in)
        RX_TRY_EXIT(rx_columns_add(options->columns, (const char *const[]){"EXT_NUMBER"}, 1, err));
    if (options->reference.name != NULL)
        RX_TRY_EXIT(rx_catalog_read(options->reference.name, 0, &job->reference, err));
    RX_TRY_EXIT(open_runs(job, n, err));
    for (int i = 0; i < n; i++)
        RX_TRY_EXIT(run_extension(job, hdus[i], measure_hdus != NULL ? measure_hdus[i] : 0, i + 1, n, err));
    for (int i = 0; i < options->nrestorers; i++)
        RX_TRY_EXIT(rx_run_digest(&job->runs[i], &job->products, err));
    for (int i = 0; i < options->nrestorers; i++)
        RX_TRY_EXIT(rx_run_close(&job->runs[i], &job->record, &job->products, job->standard_out, err));
    if (job->xml != NULL)
        RX_TRY_EXIT(
            rx_run_xml(&(rx_run_xml_input){options, &job->record, job->facts, job->detect, &job->warnings},
                       job->xml, job->config->xml_name, err));
    RX_TRY_EXIT(rx_interrupt_check(err));
    status = rx_outputs_commit(job->outputs, err);
exit:
    free(hdus);
    free(measure_hdus);
    return status;
}

rx_status rx_stage_run(const rx_config *config, const char *image, FILE *standard_out, rx_log *log,
                       rx_tile_facts *facts, rx_error *err)
{
    rx_options *options = NULL;
    job *j;
    RX_TRY(RX_MAKE(j, 1, err));
    j->config = config;
    j->image = image;
    j->log = log;
    j->standard_out = standard_out;
    j->facts = facts;
    rx_text *const others = log != NULL ? log->warnings : NULL;
    if (log != NULL && config->write_xml)
        log->warnings = &j->warnings;
    rx_status status;
    RX_TRY_EXIT(rx_options_from_config(config, log, &options, err));
    j->options = options;
    rx_record_run(&j->record, config, image);
    if (j->record.failed || !rx_name_split_images(image, &j->detect, &j->measure))
        RX_TRY_EXIT(rx_error_memory(err, 0));
    if (j->measure != NULL && (options->check.self_check || options->check.blank_check > 0))
        RX_TRY_EXIT(rx_error_set(
            err, RX_USAGE,
            "SELF_CHECK and BLANK_CHECK speak of one image; leave out the second one, or the checks"));
    RX_TRY_EXIT(rx_outputs_new(&j->outputs, err));
    RX_TRY_EXIT(run_all(j, err));
    rx_outputs_log(j->outputs, strcmp(options->catalog_name, "STDOUT") == 0 ? "standard output" : NULL, log);
    RX_TRY_EXIT(rx_repeat_compare(&config->settings, &j->record, &j->products, log, err));
    if (j->verdict == RX_VERDICT_FAIL)
        status =
            rx_error_set(err, RX_GATE_FAIL, "a quality gate FAILED; see %s/report.html", options->qa_name);
    else if (j->verdict == RX_VERDICT_INSUFFICIENT)
        status = rx_error_set(err, RX_GATE_INSUFFICIENT,
                              "too few sources to decide every quality gate; see %s/report.html",
                              options->qa_name);
exit:
    if (log != NULL)
        log->warnings = others;
    rx_text_free(&j->warnings);
    for (int i = 0; options != NULL && i < options->nrestorers; i++)
        rx_run_free(&j->runs[i]);
    rx_outputs_free(j->outputs);
    rx_table_free(j->reference);
    rx_record_free(&j->record);
    rx_record_free(&j->products);
    free(j->detect);
    free(j->measure);
    rx_options_free(options);
    free(j);
    return status;
}
