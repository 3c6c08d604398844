/* The report of a survey: a page, tables, and files for other programs. */
#ifndef RX_SURVEY_ROLLUP_REPORT_H
#define RX_SURVEY_ROLLUP_REPORT_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "report/figure.h"
#include "survey/rollup.h"

/* Into the existing folder (`shown` in errors): report.html, summary.json, tiles.ecsv, bins.ecsv,
 * psfs.ecsv, psf_rho.ecsv and junit.xml. No dates, no paths but those of the records. figures 0: no gnuplot. */
rx_status rx_rollup_report(const rx_rollup *rollup, int figures, const char *folder, const char *shown,
                           rx_log *log, rx_error *err);

/* JUnit's XML: a test case per tile; failure: a gate that fails, error: a tile that failed or has no record,
 * skipped: a gate that cannot be decided. */
void rx_rollup_junit(rx_text *dst, const rx_rollup *rollup);

/* Completeness, purity and bias by magnitude, what rx_rollup_sky() adds, and residuals of PSFs by angle. */
void rx_rollup_figures(rx_figures *dst, const rx_rollup *rollup);

/* Completeness and bias over the sky, by images or, where they are many, by cells. */
void rx_rollup_sky(rx_figures *dst, const rx_rollup *rollup);

#endif
