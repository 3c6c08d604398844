/* A campaign from its settings to its report: one unit per thread at a time, a journal line for each. */
#include "lab/campaign.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/threads.h"
#include "io/output.h"
#include "lab/report.h"

static const rx_lab_kind *const KINDS[] = {&rx_kind_restoration, &rx_kind_photometry, &rx_kind_detection};

enum { LOG_EVERY = 10 }; /* per cent, where no progress line can be shown */

typedef struct job {
    const rx_campaign_config *config;
    const rx_lab_kind *kind;
    rx_log *log;
    int k, n; /* SHARD */
    int nthreads;
    rx_lab *lab;
    rx_text facts; /* of the journal */
    rx_unit_values *values;
    rx_journal *journal;
    /* of the threads, changed in the critical section only */
    long todo, done; /* units of this run */
    long logged;     /* per cent */
    double begun;
    rx_status status;
    rx_error *err;
} job;

/* Units of campaigns whose units take turns go to one shard by condition, and those of the first scene come first; else
 * any number of shards has work. */
static int shard_of(const job *j, long unit)
{
    return (int)((j->kind->in_turns ? j->lab->unit[unit].condition : unit) % j->n) + 1;
}

/* Units of shard k that have no values, and all of them. */
static long count_missing(const job *j, int k, long *all)
{
    long missing = 0;
    *all = 0;
    for (long u = 0; u < j->lab->nunits; u++) {
        *all += shard_of(j, u) == k;
        missing += shard_of(j, u) == k && j->values[u].v == NULL;
    }
    return missing;
}

/* The journal of shard k; dst NULL: only read. *found (may be NULL): it is there. */
static rx_status open_journal(job *j, int k, rx_journal **dst, int *found, rx_error *err)
{
    rx_text path = {0};
    rx_text_add(&path, j->config->journal_name);
    if (j->n > 1)
        rx_text_printf(&path, ".%d", k);
    if (path.failed)
        return rx_error_memory(err, 0);
    if (found != NULL)
        *found = access(path.data, F_OK) == 0;
    const rx_status status = rx_journal_open(path.data, &j->facts, j->lab->nunits, j->values, dst, err);
    rx_text_free(&path);
    return status;
}

/* Keep what a unit has given, or why it failed. What is done when a signal stops the others is done. */
static void finish_unit(job *j, long unit, rx_status status, rx_unit_values *values, rx_error *why)
{
    if (status == RX_OK && (j->status == RX_OK || j->status == RX_INTERRUPTED))
        status = rx_journal_append(j->journal, unit, values, why);
    else if (status == RX_OK)
        status = j->status;
    if (status != RX_OK) {
        if (j->status == RX_OK) {
#pragma omp atomic write
            j->status = status; /* read by others outside the critical section */
            if (j->err != NULL)
                *j->err = *why;
        }
        free(values->v);
        return;
    }
    j->values[unit] = *values;
    j->done++;
    if (j->log == NULL)
        return;
    rx_log_progress(j->log, j->kind->title, (double)j->done / (double)j->todo);
    const long percent = 100 * j->done / j->todo;
    if (j->log->terminal || percent < j->logged + LOG_EVERY)
        return;
    char left[RX_TIME_LEFT];
    j->logged = percent - percent % LOG_EVERY;
    rx_log_info(
        j->log, "%ld of %ld units, about %s left", j->done, j->todo,
        rx_time_left((rx_seconds() - j->begun) * (double)(j->todo - j->done) / (double)j->done, left));
}

static void run_units(job *j, long n, const long *units)
{
#pragma omp parallel for schedule(dynamic, 1) num_threads(j->nthreads)
    for (long i = 0; i < n; i++) {
        rx_status status;
#pragma omp atomic read
        status = j->status;
        if (status != RX_OK)
            continue;
        rx_error why = RX_ERROR_NONE;
        rx_unit_values values = {0};
        status = rx_interrupt_check(&why);
        if (status == RX_OK)
            status = rx_lab_do_unit(j->lab, units[i], j->values, &values, &why);
#pragma omp critical(rx_campaign_unit)
        finish_unit(j, units[i], status, &values, &why);
    }
}

/* The units of this shard that no earlier run has done. */
static rx_status work(job *j, rx_error *err)
{
    long all, *units = NULL;
    RX_TRY(open_journal(j, j->k, &j->journal, NULL, err));
    j->todo = count_missing(j, j->k, &all);
    rx_log_info(j->log, "%s: %ld units, %ld of them are in the journal", j->kind->title, all, all - j->todo);
    if (j->todo == 0)
        return RX_OK;
    if (j->kind->prepare != NULL)
        RX_TRY(j->kind->prepare(j->lab, j->log, err));
    RX_TRY(RX_MAKE(units, (size_t)j->todo, err));
    j->begun = rx_seconds();
    j->err = err;
    rx_log_progress_begin(j->log);
    for (int phase = 0; phase < 2 && j->status == RX_OK; phase++) {
        long n = 0;
        for (long u = 0; u < j->lab->nunits; u++)
            if (shard_of(j, u) == j->k && (j->kind->in_turns && j->lab->unit[u].scene > 0) == phase &&
                j->values[u].v == NULL)
                units[n++] = u;
        run_units(j, n, units);
    }
    rx_log_progress_end(j->log);
    free(units);
    if (j->status == RX_INTERRUPTED)
        return rx_error_set(err, RX_INTERRUPTED,
                            "interrupted by a signal; what is done is in the journal, %ld of %ld units, and "
                            "the same command goes on from there",
                            all - j->todo + j->done, all);
    const double used = rx_seconds() - j->begun;
    if (j->status == RX_OK)
        rx_log_info(j->log, "%ld units in %.1f s on %d threads, %.3g s each", j->done, used, j->nthreads,
                    used * j->nthreads / (double)j->done);
    return j->status;
}

/* The journals of all shards; what is missing is said shard by shard. */
static rx_status merge(job *j, rx_error *err)
{
    rx_text missing = {0};
    rx_status status = RX_OK;
    for (int k = 1; status == RX_OK && k <= j->n; k++) {
        long all;
        int found;
        status = open_journal(j, k, NULL, &found, err);
        const long lacking = count_missing(j, k, &all);
        if (lacking > 0)
            rx_text_printf(&missing, "%sshard %d/%d lacks %ld of %ld units%s", missing.length > 0 ? ", " : "",
                           k, j->n, lacking, all, found ? "" : " (no journal)");
    }
    if (status == RX_OK && missing.failed)
        status = rx_error_memory(err, 0);
    else if (status == RX_OK && missing.length > 0)
        status = rx_error_at(err, RX_INPUT, j->config->journal_name, -1, 0,
                             "%.600s; finish that first, then merge again", missing.data);
    rx_text_free(&missing);
    return status;
}

/* The folder of the report; rx_outputs_free() in any case. */
static rx_status open_output(const job *j, rx_outputs **outputs, const char **folder, rx_error *err)
{
    RX_TRY(rx_outputs_new(outputs, err));
    return rx_outputs_folder(*outputs, j->config->output_name, folder, err);
}

static rx_status report(const job *j, rx_error *err)
{
    rx_outputs *outputs = NULL;
    const char *folder = NULL;
    rx_text brief = {0};
    rx_status status;
    RX_TRY_EXIT(open_output(j, &outputs, &folder, err));
    RX_TRY_EXIT(rx_lab_collect(j->lab, j->values, err));
    RX_TRY_EXIT(rx_lab_report(j->lab, folder, &brief, j->log, err));
    RX_TRY_EXIT(rx_outputs_commit(outputs, err));
    for (const char *line = brief.data; line != NULL && *line != '\0';) {
        const int n = (int)strcspn(line, "\n");
        rx_log_info(j->log, "%.*s", n, line);
        line += n + (line[n] == '\n');
    }
    rx_log_info(j->log, "the report is %s/report.html", j->config->output_name);
exit:
    rx_text_free(&brief);
    rx_outputs_free(outputs);
    return status;
}

static rx_status run(job *j, rx_error *err)
{
    rx_outputs *outputs = NULL;
    const char *folder;
    const int with_report = j->n == 1 || j->config->merge;
    rx_status status = with_report ? open_output(j, &outputs, &folder, err) : RX_OK;
    rx_outputs_free(outputs); /* whether it can be written at all is asked before the work */
    RX_TRY(status);
    RX_TRY(rx_lab_open(j->kind, j->config, j->nthreads, j->log, &j->lab, err));
    RX_TRY(rx_lab_facts(j->lab, &j->facts, err));
    RX_TRY(RX_MAKE(j->values, (size_t)j->lab->nunits + 1, err));
    RX_TRY(j->config->merge ? merge(j, err) : work(j, err));
    if (with_report)
        return report(j, err);
    rx_log_info(j->log,
                "shard %d/%d is complete; once all %d are, the same command with -SHARD 1/%d -MERGE Y writes "
                "the report",
                j->k, j->n, j->n, j->n);
    return RX_OK;
}

rx_status rx_campaign_run(const rx_campaign_config *config, rx_log *log, rx_error *err)
{
    job j = {.config = config, .log = log, .nthreads = rx_threads_had(config->nthreads, log)};
    for (size_t i = 0; i < sizeof KINDS / sizeof KINDS[0]; i++) /* one of them */
        if (strcmp(KINDS[i]->name, config->campaign_type) == 0)
            j.kind = KINDS[i];
    rx_status status = rx_campaign_config_shard(config, &j.k, &j.n, err);
    if (status == RX_OK)
        status = run(&j, err);
    rx_journal_close(j.journal);
    if (j.lab != NULL)
        rx_unit_values_free(j.lab->nunits, j.values);
    rx_text_free(&j.facts);
    rx_lab_close(j.lab);
    return status;
}
