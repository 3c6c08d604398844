/* A campaign from its settings to its report. */
#include "lab/campaign.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/threads.h"
#include "io/output.h"
#include "lab/facts.h"
#include "lab/journal.h"
#include "lab/report.h"
#include "lab/sources.h"
#include "lab/units.h"

static const rx_lab_kind *const KINDS[] = {&rx_kind_restoration, &rx_kind_photometry, &rx_kind_detection};

typedef struct job {
    const rx_campaign_config *config;
    const rx_lab_kind *kind;
    rx_log *log;
    int k, n; /* SHARD */
    int nthreads;
    rx_lab *lab;
    rx_journal_facts facts;
    rx_unit_place *places;
    rx_unit_work work;
    rx_unit_values *values;
    rx_journal *journal;
} job;

/* Name of the journal of shard k of n, to be freed. */
static char *journal_name(const job *j, int k)
{
    const char *name = j->config->journal_name;
    const size_t size = strlen(name) + 16;
    char *path = RX_NEW(char, size);
    if (path != NULL)
        snprintf(path, size, j->n > 1 ? "%s.%d" : "%s", name, k);
    return path;
}

/* Can the report be written at all: asked before the work. */
static rx_status check_output(const job *j, rx_error *err)
{
    rx_outputs *outputs = NULL;
    const char *temporary;
    rx_status status = rx_outputs_new(&outputs, err);
    if (status == RX_OK)
        status = rx_outputs_folder(outputs, j->config->output_name, &temporary, err);
    rx_outputs_free(outputs);
    return status;
}

static rx_status open_lab(job *j, rx_error *err)
{
    RX_TRY(rx_lab_open(j->kind, j->config, j->nthreads, j->log, &j->lab, err));
    RX_TRY(rx_facts_collect(j->config, &j->facts, err));
    RX_TRY(rx_lab_facts(j->lab, &j->facts, err));
    const long n = j->lab->nunits;
    j->places = RX_NEW(rx_unit_place, (size_t)n + 1);
    j->values = RX_NEW(rx_unit_values, (size_t)n + 1);
    if (j->places == NULL || j->values == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *j->values);
    for (long u = 0; u < n; u++)
        j->places[u] = rx_lab_place(j->lab, u);
    j->work = (rx_unit_work){j->kind->title, n, j->places, j->k, j->n, j->lab, rx_lab_do_unit};
    return RX_OK;
}

/* The units of this shard that no earlier run has done. */
static rx_status work(job *j, rx_error *err)
{
    char *path = journal_name(j, j->k);
    if (path == NULL)
        return rx_error_memory(err, 0);
    long missing = 0, all = 0;
    const rx_status status = rx_journal_open(path, &j->facts, j->work.n, j->values, &j->journal, err);
    free(path);
    RX_TRY(status);
    rx_units_count(&j->work, j->values, &missing, &all);
    rx_log_info(j->log, "%s: %ld units, %ld of them are in the journal", j->kind->title, all, all - missing);
    if (missing == 0)
        return RX_OK;
    RX_TRY(rx_sources_prepare(j->lab, j->log, err));
    return rx_units_run(&j->work, j->nthreads, j->journal, j->values, j->log, err);
}

/* The journals of all shards; what is missing is said shard by shard. */
static rx_status merge(job *j, rx_error *err)
{
    rx_text missing = {0};
    rx_status status = RX_OK;
    int *found = NULL;
    RX_TRY(RX_MAKE(found, (size_t)j->n + 1, err));
    for (int k = 1; status == RX_OK && k <= j->n; k++) {
        char *path = journal_name(j, k);
        status = path == NULL ? rx_error_memory(err, 0)
                              : rx_journal_read(path, &j->facts, j->work.n, j->values, &found[k], err);
        free(path);
    }
    for (int k = 1; status == RX_OK && k <= j->n; k++) {
        rx_unit_work shard = j->work;
        long lacking, all;
        shard.k = k;
        rx_units_count(&shard, j->values, &lacking, &all);
        if (lacking > 0)
            rx_text_printf(&missing, "%sshard %d/%d lacks %ld of %ld units%s", missing.length > 0 ? ", " : "",
                           k, j->n, lacking, all, found[k] ? "" : " (no journal)");
    }
    if (missing.failed)
        status = rx_error_memory(err, 0);
    else if (status == RX_OK && missing.length > 0)
        status = rx_error_at(err, RX_INPUT, j->config->journal_name, -1, 0,
                             "%.600s; finish that first, then merge again", missing.data);
    rx_text_free(&missing);
    free(found);
    return status;
}

static rx_status report(const job *j, rx_error *err)
{
    rx_outputs *outputs = NULL;
    rx_campaign_record record = {0};
    rx_text brief = {0};
    const char *folder = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_campaign_record_make(j->config, j->kind->title, &record, err));
    RX_TRY_EXIT(rx_outputs_new(&outputs, err));
    RX_TRY_EXIT(rx_outputs_folder(outputs, j->config->output_name, &folder, err));
    RX_TRY_EXIT(rx_lab_collect(j->lab, j->values, err));
    RX_TRY_EXIT(rx_lab_report(
        j->lab, &(rx_lab_output){&record, folder, j->config->output_name, j->log, &brief}, err));
    RX_TRY_EXIT(rx_outputs_commit(outputs, err));
    for (const char *line = brief.data; line != NULL && *line != '\0';) {
        const int n = (int)strcspn(line, "\n");
        rx_log_info(j->log, "%.*s", n, line);
        line += n + (line[n] == '\n');
    }
    rx_log_info(j->log, "the report is %s/report.html", j->config->output_name);
exit:
    rx_text_free(&brief);
    rx_campaign_record_free(&record);
    rx_outputs_free(outputs);
    return status;
}

static rx_status run(job *j, rx_error *err)
{
    const int with_report = j->n == 1 || j->config->merge;
    if (with_report)
        RX_TRY(check_output(j, err));
    RX_TRY(open_lab(j, err));
    RX_TRY(j->config->merge ? merge(j, err) : work(j, err));
    if (with_report)
        return report(j, err);
    rx_log_info(j->log,
                "shard %d/%d is complete; once all %d are, the same command with -SHARD 1/%d -MERGE Y "
                "writes the report",
                j->k, j->n, j->n, j->n);
    return RX_OK;
}

rx_status rx_campaign_run(const rx_campaign_config *config, rx_log *log, rx_error *err)
{
    job j = {.config = config, .log = log, .nthreads = rx_threads_had(config->nthreads, log)};
    for (size_t i = 0; i < sizeof KINDS / sizeof KINDS[0]; i++)
        if (strcmp(KINDS[i]->name, config->campaign_type) == 0)
            j.kind = KINDS[i];
    if (j.kind == NULL)
        return rx_error_set(err, RX_USAGE, "CAMPAIGN_TYPE %s is not known here", config->campaign_type);
    rx_status status = rx_campaign_config_shard(config, &j.k, &j.n, err);
    if (status == RX_OK)
        status = run(&j, err);
    rx_journal_close(j.journal);
    rx_unit_values_free(j.work.n, j.values);
    free(j.places);
    rx_journal_facts_free(&j.facts);
    rx_lab_close(j.lab);
    return status;
}
