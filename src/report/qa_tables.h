/* The tables of the QA report, and its facts: what its files hold. How they are shown is the page's. */
#ifndef RX_REPORT_QA_TABLES_H
#define RX_REPORT_QA_TABLES_H

#include "quality/qa_numbers.h"
#include "report/report.h"

enum { RX_QA_RUN_COLUMNS = 34, RX_QA_BIN_COLUMNS = 3, RX_QA_STEM = 48 }; /* beside those of the metrics */

typedef struct rx_qa_tables {
    rx_report_table *runs, *models, *bins, *flags, *gates, *comparisons;
    rx_report_table *psf, *psf_bins; /* NULL: there is no PSF, no star that judges it */
    char (*stem)[RX_QA_STEM]; /* [nruns] of the names of each run's files; to be freed; NULL without memory */
    rx_report_column run_column[RX_QA_RUN_COLUMNS + RX_METRIC_COUNT];
    rx_report_column bin_column[RX_QA_BIN_COLUMNS + RX_METRIC_COUNT];
} rx_qa_tables;

/* dst and numbers must live as long as the report. */
void rx_qa_tables_add(rx_report *report, const rx_qa_numbers *numbers, rx_qa_tables *dst);

/* How a metric is shown; precision may be something else (rx_qa_input.precision_is). */
rx_report_column rx_qa_metric_column(const rx_qa_input *input, rx_metric metric);

#endif
