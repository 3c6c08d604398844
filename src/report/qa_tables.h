/* The tables of the QA report, its facts and figures: what its files hold. How they are shown is the page's. Internal to
 * report/. */
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

/* The figures of the report, "plot-...", "picture..." and, where stars judge the PSF, "psf-...". Those without any data
 * are left out. */
void rx_qa_figures(rx_figures *dst, const rx_qa_numbers *numbers);

#endif
