/* The QA report of a tile: the page, its tables and figures, of the numbers of quality/qa_numbers.h.
 *
 * Same input, same bytes: no dates, no timings, no dependence on threads. */
#ifndef RX_REPORT_QA_PAGE_H
#define RX_REPORT_QA_PAGE_H

#include "base/log.h"
#include "base/text.h"
#include "quality/qa_numbers.h"
#include "report/figure.h"

/* Write the report into the existing folder (`shown` is its name in errors: the one it will have):
 * report.html, summary.json, bins.ecsv and, per run, matches_<run>.ecsv and pr_<run>.ecsv (names reduced to
 * letters, digits, - and _); of a PSF that stars test, psf_stars.ecsv and psf_growth.ecsv. *verdict over all gates
 * (FAIL before INSUFFICIENT before PASS); `brief` (may be NULL) gets a short text table for the terminal. Missing
 * gnuplot: a warning, tables and page still come. Errors: RX_USAGE (radius, magnitude bins), RX_SYSTEM (memory,
 * disk), RX_INTERRUPTED. */
rx_status rx_qa_report(const rx_qa_params *par, const rx_qa_input *input, const char *folder,
                       const char *shown, rx_verdict *verdict, rx_text *brief, rx_error *err);

/* Its figures, "plot-...", "picture..." and, where stars test the PSF, "psf-...". Those without any data are left out. */
void rx_qa_figures(rx_figures *dst, const rx_qa_numbers *numbers);

#endif
