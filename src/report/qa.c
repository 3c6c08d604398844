/* The report: measure every run, judge the gates, write the files. */
#include "report/qa_writers.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "data/psf.h"
#include "quality/tally.h"
#include "report/escape.h"
#include "report/report_file.h"

static const double LEVEL = 0.95;

rx_status rx_qa_list_new(rx_qa_list *list, long n, int with_flags, rx_error *err)
{
    size_t rows = (size_t)n;
    *list = (rx_qa_list){.n = n};
    list->x = RX_NEW(double, rows);
    list->y = RX_NEW(double, rows);
    list->alpha = RX_NEW(double, rows);
    list->delta = RX_NEW(double, rows);
    list->mag = RX_NEW(double, rows);
    list->mag_error = RX_NEW(double, rows);
    list->flux = RX_NEW(double, rows);
    list->flux_error = RX_NEW(double, rows);
    if (with_flags) {
        list->score = RX_NEW(double, rows);
        list->flags = RX_NEW(int, rows);
        list->made_up = RX_NEW(unsigned char, rows);
    }
    int complete = list->x != NULL && list->y != NULL && list->alpha != NULL && list->delta != NULL &&
                   list->mag != NULL && list->mag_error != NULL && list->flux != NULL &&
                   list->flux_error != NULL &&
                   (!with_flags || (list->score != NULL && list->flags != NULL && list->made_up != NULL));
    if (complete)
        return RX_OK;
    rx_qa_list_free(list);
    return rx_error_memory(err, 9 * rows * sizeof(double));
}

void rx_qa_list_free(rx_qa_list *list)
{
    free(list->x);
    free(list->y);
    free(list->alpha);
    free(list->delta);
    free(list->mag);
    free(list->mag_error);
    free(list->flux);
    free(list->flux_error);
    free(list->score);
    free(list->flags);
    free(list->made_up);
    *list = (rx_qa_list){0};
}

static rx_estimate *bin_estimates(const rx_report *report, int run, int bin)
{
    return &report->binned[((size_t)run * (size_t)report->bins.n + (size_t)bin) * RX_METRIC_COUNT];
}

const rx_estimate *rx_report_whole(const rx_report *report, int run, rx_metric metric)
{
    return &report->whole[(size_t)run * RX_METRIC_COUNT + metric];
}

const rx_estimate *rx_report_bin(const rx_report *report, int run, int bin, rx_metric metric)
{
    return &bin_estimates(report, run, bin)[metric];
}

static bool stem_taken(const rx_report *r, int run)
{
    for (int i = 0; i < run; i++)
        if (strcasecmp(r->stem[i], r->stem[run]) == 0)
            return true;
    return false;
}

/* File-name stems that differ also where the file system ignores case. */
static void name_stems(rx_report *r)
{
    for (int run = 0; run < r->input->nruns; run++) {
        rx_escape_stem(r->stem[run], RX_STEM - 16, r->input->runs[run].name);
        size_t length = strlen(r->stem[run]);
        for (int k = 2; stem_taken(r, run); k++)
            snprintf(r->stem[run] + length, RX_STEM - length, "-%d", k);
    }
}

static rx_status measure_run(rx_report *r, int run, rx_error *err)
{
    const rx_resampling by = r->par->by;
    rx_evaluation *e = &r->evaluation[run];
    rx_status status = rx_evaluate(r->par, r->input, run, &r->bins, r->level, e, err);
    if (status == RX_OK && r->input->runs[run].tally != NULL)
        status = rx_tally_evaluation(r->input->runs[run].tally, e, err);
    if (status == RX_OK)
        status = rx_metrics_measure(e, 1, 0, 0, r->level, by, RX_METRIC_COUNT,
                                    &r->whole[(size_t)run * RX_METRIC_COUNT], err);
    for (int b = 0; b < r->bins.n && status == RX_OK; b++)
        status = rx_metrics_measure(e, 0, r->bins.edge[b], r->bins.edge[b + 1], r->level, by, RX_METRIC_COUNT,
                                    bin_estimates(r, run, b), err);
    return status;
}

static void compare_runs(rx_report *r)
{
    for (int i = 0; i < r->input->nruns; i++)
        for (int j = i + 1; j < r->input->nruns; j++) {
            rx_comparison *c = &r->comparison[r->ncomparisons++];
            *c = (rx_comparison){.first = i, .second = j};
            for (long k = 0; k < r->input->truth.n; k++) {
                int first = r->evaluation[i].truth_role[k] == RX_ROLE_MATCHED;
                int second = r->evaluation[j].truth_role[k] == RX_ROLE_MATCHED;
                c->only_first += first && !second;
                c->only_second += second && !first;
            }
            c->p = rx_mcnemar(c->only_first, c->only_second);
        }
}

static rx_status judge_gate(rx_report *r, const rx_gate *gate, rx_error *err)
{
    rx_estimate estimates[RX_METRIC_COUNT];
    rx_status status = RX_OK;
    long before = r->nresults;
    for (int run = 0; run < r->input->nruns && status == RX_OK; run++) {
        if (strcmp(gate->run, "*") != 0 && strcasecmp(gate->run, r->input->runs[run].name) != 0)
            continue;
        status = rx_metrics_measure(&r->evaluation[run], gate->whole, gate->low, gate->high, gate->level,
                                    r->par->by, gate->metric, estimates, err);
        if (status != RX_OK)
            return status;
        rx_gate_result *result = &r->result[r->nresults++];
        *result = (rx_gate_result){.gate = gate, .run = run, .estimate = estimates[gate->metric]};
        result->verdict = rx_gate_judge(gate, &result->estimate);
    }
    if (r->nresults == before)
        r->result[r->nresults++] = (rx_gate_result){
            .gate = gate, .run = -1, .estimate = {NAN, NAN, NAN, 0}, .verdict = RX_VERDICT_INSUFFICIENT};
    return status;
}

static rx_status judge_gates(rx_report *r, rx_error *err)
{
    rx_status status = RX_OK;
    long n = r->par->gates != NULL ? r->par->gates->n : 0;
    for (long i = 0; i < n && status == RX_OK; i++)
        status = judge_gate(r, &r->par->gates->gate[i], err);
    for (long i = 0; i < r->nresults; i++)
        r->verdict = rx_verdict_worse(r->verdict, r->result[i].verdict);
    return status;
}

static void report_free(rx_report *r)
{
    for (int i = 0; i < r->input->nruns && r->evaluation != NULL; i++)
        rx_evaluation_free(&r->evaluation[i]);
    free(r->evaluation);
    free(r->whole);
    free(r->binned);
    free(r->stem);
    free(r->result);
    free(r->comparison);
}

static rx_status report_make(rx_report *r, rx_error *err)
{
    size_t runs = (size_t)r->input->nruns;
    size_t gates = r->par->gates != NULL ? (size_t)r->par->gates->n : 0;
    rx_status status = rx_evaluate_bins(r->par, r->input, &r->bins, err);
    if (status != RX_OK)
        return status;
    r->evaluation = RX_NEW(rx_evaluation, runs);
    r->whole = RX_NEW(rx_estimate, runs * RX_METRIC_COUNT);
    r->binned = RX_NEW(rx_estimate, runs * (size_t)r->bins.n * RX_METRIC_COUNT);
    r->stem = rx_alloc(runs, sizeof *r->stem);
    r->result = RX_NEW(rx_gate_result, gates * (runs + 1));
    r->comparison = RX_NEW(rx_comparison, runs * runs);
    if (!r->evaluation || !r->whole || !r->binned || !r->stem || !r->result || !r->comparison)
        return rx_error_memory(err, 0);
    name_stems(r);
    for (int run = 0; run < r->input->nruns && status == RX_OK; run++) {
        status = rx_interrupt_check(err);
        if (status == RX_OK)
            status = measure_run(r, run, err);
    }
    if (status == RX_OK)
        compare_runs(r);
    if (status == RX_OK)
        status = judge_gates(r, err);
    return status;
}

/* Where the report goes. */
typedef struct target {
    const char *folder, *shown; /* as it is, and as errors name it */
} target;

static rx_status write_file(const target *to, const char *name, rx_text *text, rx_error *err)
{
    return rx_report_file(to->folder, to->shown, name, text, err);
}

static rx_status write_runs(const rx_report *r, const target *to, rx_error *err)
{
    char name[RX_STEM + 16];
    rx_status status = RX_OK;
    for (int run = 0; run < r->input->nruns && status == RX_OK; run++) {
        rx_text text = {0};
        rx_report_matches(&text, r, run);
        snprintf(name, sizeof name, "matches_%s.ecsv", r->stem[run]);
        status = write_file(to, name, &text, err);
        if (status != RX_OK)
            break;
        rx_report_curve(&text, r, run);
        snprintf(name, sizeof name, "pr_%s.ecsv", r->stem[run]);
        status = write_file(to, name, &text, err);
    }
    return status;
}

/* All but the page. */
static rx_status write_tables(const rx_report *r, const target *to, rx_error *err)
{
    rx_text text = {0};
    rx_report_json(&text, r);
    rx_status status = write_file(to, "summary.json", &text, err);
    if (status != RX_OK)
        return status;
    rx_report_bins(&text, r);
    status = write_file(to, "bins.ecsv", &text, err);
    const rx_psf *psf = r->input->psf.psf;
    if (status == RX_OK && psf != NULL && psf->judged != NULL) {
        rx_report_psf_stars(&text, r);
        status = write_file(to, "psf_stars.ecsv", &text, err);
        rx_report_psf_growth(&text, r);
        if (status == RX_OK)
            status = write_file(to, "psf_growth.ecsv", &text, err);
        rx_text_free(&text);
    }
    return status == RX_OK ? write_runs(r, to, err) : status;
}

static rx_status write_page(const rx_report *r, const rx_figures *figures, const target *to, rx_error *err)
{
    rx_text text = {0};
    rx_report_html(&text, r, figures);
    return write_file(to, "report.html", &text, err);
}

/* Magnitudes on another scale make every flux error senseless; the report says so in numbers, the user
 * had better hear it. */
static void warn_of_scale(const rx_report *r, rx_log *log)
{
    const double suspicious = 0.5; /* mag */
    for (int run = 0; run < r->input->nruns; run++) {
        double offset = r->evaluation[run].offset.value;
        if (isfinite(offset) && fabs(offset) > suspicious)
            rx_log_warning(
                log, "%s: bright matches differ by %+.2f mag from the reference; is MAG_ZEROPOINT right?",
                r->input->runs[run].name, offset);
    }
}

rx_status rx_qa_report(const rx_qa_params *par, const rx_qa_input *input, const char *folder,
                       const char *shown, rx_log *log, rx_verdict *verdict, rx_text *brief, rx_error *err)
{
    rx_report report = {.par = par, .input = input, .level = LEVEL};
    const target to = {folder, shown};
    rx_figures *figures = RX_NEW(rx_figures, 1);
    rx_status status = figures != NULL ? report_make(&report, err) : rx_error_memory(err, 0);
    if (status != RX_OK)
        goto exit;
    if (par->figures)
        status = rx_report_figures(&report, folder, shown, figures, err);
    else
        snprintf(figures->note, sizeof figures->note, "figures were not asked for");
    if (status != RX_OK)
        goto exit;
    warn_of_scale(&report, log);
    status = write_tables(&report, &to, err); /* while gnuplot draws */
    if (status == RX_OK && par->figures)
        status = rx_figures_finish(figures, par->gnuplot, err);
    if (status == RX_OK)
        status = rx_interrupt_check(err);
    if (status != RX_OK)
        goto exit;
    if (par->figures && figures->note[0] != '\0')
        rx_log_warning(log, "report without figures: %s", figures->note);
    status = write_page(&report, figures, &to, err);
    if (status != RX_OK)
        goto exit;
    if (brief != NULL)
        rx_report_brief(brief, &report, !rx_log_is_short(log));
    if (verdict != NULL)
        *verdict = report.verdict;
exit:
    if (figures != NULL)
        rx_figures_free(figures);
    free(figures);
    report_free(&report);
    return status;
}
