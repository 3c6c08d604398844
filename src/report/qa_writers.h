/* What the writers of the report share: everything measured, nothing formatted. */
#ifndef RX_REPORT_QA_WRITERS_H
#define RX_REPORT_QA_WRITERS_H

#include "base/text.h"
#include "quality/gates.h"
#include "quality/metrics.h"
#include "quality/qa.h"
#include "report/figure.h"
#include "report/json.h"

enum { RX_STEM = 48 };

/* A gate on one run; gates on all runs have several. */
typedef struct rx_gate_result {
    const rx_gate *gate;
    int run; /* -1: the gate names a run that is not there */
    rx_estimate estimate;
    rx_verdict verdict;
} rx_gate_result;

/* Two runs on the same references. */
typedef struct rx_comparison {
    int first, second;
    long only_first, only_second; /* references that only this one found */
    double p;                     /* McNemar's exact test */
} rx_comparison;

typedef struct rx_report {
    const rx_qa_params *par;
    const rx_qa_input *input;
    double level; /* of all intervals but those of gates */
    rx_bins bins;
    rx_evaluation *evaluation; /* [nruns] */
    rx_estimate *whole;        /* [nruns][RX_METRIC_COUNT] */
    rx_estimate *binned;       /* [nruns][bins.n][RX_METRIC_COUNT] */
    char (*stem)[RX_STEM];     /* [nruns] run names fit for file names, each once */
    long nresults;
    rx_gate_result *result;
    int ncomparisons;
    rx_comparison *comparison;
    rx_verdict verdict;
} rx_report;

const rx_estimate *rx_report_whole(const rx_report *report, int run, rx_metric metric);
const rx_estimate *rx_report_bin(const rx_report *report, int run, int bin, rx_metric metric);

/* Start drawing all figures of the report, see rx_figures_start(). Free with rx_figures_free(). */
rx_status rx_report_figures(const rx_report *report, const char *folder, const char *shown, rx_figures *dst,
                            rx_error *err);

/* The files of the report as text; memory trouble shows in dst->failed. */
void rx_report_json(rx_text *dst, const rx_report *report);
void rx_report_html(rx_text *dst, const rx_report *report, const rx_figures *figures);
void rx_report_bins(rx_text *dst, const rx_report *report);
void rx_report_matches(rx_text *dst, const rx_report *report, int run);
void rx_report_curve(rx_text *dst, const rx_report *report, int run);
void rx_report_brief(rx_text *dst, const rx_report *report, bool legend /* what the columns are */);

/* The PSF's part of each; nothing without a PSF that came about in some known way. */
void rx_report_psf_figures(rx_figures *dst, const rx_report *report);
void rx_report_psf_page(rx_text *dst, const rx_report *report, const rx_figures *figures);
void rx_report_psf_json(rx_json *json, const rx_report *report);
void rx_report_psf_stars(rx_text *dst, const rx_report *report);
void rx_report_psf_growth(rx_text *dst, const rx_report *report);

#endif
