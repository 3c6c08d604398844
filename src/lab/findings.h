/* The report of a campaign: tables of cells, contests and claims, as the store has them. */
#ifndef RX_LAB_FINDINGS_H
#define RX_LAB_FINDINGS_H

#include "lab/facts.h"
#include "lab/store.h"
#include "report/report.h"

/* report.html (self-contained), summary.json, tables (ECSV) and figures go into the existing folder; `shown` is its name
 * in errors. brief (may be NULL) gets a short table for the terminal. No dates and no timings in the files. */
typedef struct rx_lab_output {
    const rx_campaign_record *record;
    const char *folder, *shown;
    rx_log *log;
    rx_text *brief;
} rx_lab_output;

typedef struct rx_findings {
    const rx_lab_output *output;
    rx_report *report;                          /* owned */
    rx_report_table *cells, *contests, *claims; /* cells, contests NULL: FLUXES */
    rx_text brief;                              /* lines of the claims, the last ones of the terminal */
} rx_findings;

/* The report of a campaign whose sets are there: what its kind measures, the verdicts on it, and its pages and tables.
 * Errors: as rx_report_write(). */
rx_status rx_lab_report(const rx_lab *lab, const rx_lab_output *output, rx_error *err);

/* For page() of a kind. A section, and the figures whose ids begin with "PREFIX-" (NULL: none). */
void rx_findings_section(rx_findings *findings, const char *id, const char *title, const char *prefix);
/* The quantities of a group as tables of conditions against columns: the first `open` ones lie open (and are lines of the
 * terminal), the rest is folded away; all of them are rows of "cells". */
void rx_findings_quantities(rx_findings *findings, const rx_store *store, int group, int open);
/* The contests of a group, pair by pair, their outcome in words; things: "stars", of which the page says that they are
 * the same. */
void rx_findings_contests(rx_findings *findings, const rx_store *store, int group, const char *things);

#endif
