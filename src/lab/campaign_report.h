/* The page of a campaign: report.html (self-contained), summary.json, tables (ECSV) and figures, the paper's
 * numbers beside ours, and a verdict for each claim of the paper. */
#ifndef RX_LAB_CAMPAIGN_REPORT_H
#define RX_LAB_CAMPAIGN_REPORT_H

#include <stdint.h>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "lab/results.h"

typedef struct rx_campaign_record {
    const char *title;
    const char *command; /* as a reader can repeat it */
    uint64_t seed;
    int n;
    const char *const (*pairs)[2]; /* every keyword and its value, program version, model checksums */
    int figures;                   /* 0: no gnuplot */
} rx_campaign_record;

/* Into the existing folder; `shown` is its name in errors. brief (may be NULL) gets a short table for the
 * terminal. No dates and no timings in the files. */
rx_status rx_restoration_report(const rx_restoration_results *results, const rx_campaign_record *record,
                                const char *folder, const char *shown, rx_log *log, rx_text *brief,
                                rx_error *err);
rx_status rx_photometry_report(const rx_photometry_results *results, const rx_campaign_record *record,
                               const char *folder, const char *shown, rx_log *log, rx_text *brief,
                               rx_error *err);

#endif
