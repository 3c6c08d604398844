/* The report of a campaign: its rows as they were measured, numbers made of them, tables and figures of these.
 *
 * rows.ecsv has every row of every table (lab.h), one for each thing and run: what a question that was not asked here is
 * answered from. A group (a scene, a field, bins of FWHM or of noise) has quantities, each of them a number for every
 * condition (a seeing, a magnitude, a bin) and column (a run; DETECTION: and RL at its best): rows of "cells", a table and
 * a figure of the page. */
#ifndef RX_LAB_REPORT_H
#define RX_LAB_REPORT_H

#include "data/record.h"
#include "lab/lab.h"
#include "report/report.h"

enum { RX_QUANTITIES_MAX = 24 };

/* How it is named, and of what it is made: a statistic of the campaign's kind, and what that needs. */
typedef struct rx_quantity {
    char name[32];
    const char *unit;
    int digits, statistic, part, cut;
    double low, high;
    int best; /* where the best of several settings is shown: highest value of each */
    char help[160];
} rx_quantity;

/* setting: what was chosen for the number, NULL where nothing was; not owned. */
typedef struct rx_finding {
    rx_estimate value;
    const char *setting;
} rx_finding;

typedef struct rx_lab_group {
    const rx_lab *lab;
    const char *name, *axis; /* as "scene" of all tables; below figures; not owned */
    int nquantities, open;   /* open: the first ones, drawn, not folded away, and lines of the terminal */
    rx_quantity quantity[RX_QUANTITIES_MAX];
    int nconditions;
    const char **condition; /* names, not owned; the array is, as what follows */
    double *place;          /* of a condition in figures, NAN: it is not drawn */
    rx_finding *finding;    /* [nquantities][nconditions][ncolumns] */
    int ncolumns;           /* the runs, and as many as were set before, which are behind them */
    const char *column[RX_LAB_RUNS + 1];
    int hidden[RX_LAB_RUNS + 1]; /* 1: of a setting that is not the best: its rows are in rows.ecsv */
} rx_lab_group;

/* The page under work. */
typedef struct rx_lab_page {
    const rx_lab *lab;
    rx_report *report;
    rx_report_table *cells;
} rx_lab_page;

/* --- settings: facts.c --- */

/* For the journal's header: program version, every keyword that decides a result, a digest of each file that a keyword
 * names, of the model and of the templates, and names of columns. NTHREADS, VERBOSE_TYPE, SHARD, MERGE, names of outputs and
 * what only the report uses stay out; names of files do, too: their content counts. */
rx_status rx_lab_facts(const rx_lab *lab, rx_text *dst, rx_error *err);

/* For the report: every keyword, with names of files and what only the report uses, and program version; the command as a
 * reader can repeat it. */
rx_status rx_lab_settings(const rx_lab *lab, rx_record *keywords, rx_text *command, rx_error *err);

/* --- files --- */

/* report.html (self-contained), summary.json, tables (ECSV) and figures, of a campaign whose sets are there, go into the
 * existing folder. brief gets a short table for the terminal. No dates and no timings in the files. Errors: as
 * rx_report_write(). */
rx_status rx_lab_report(const rx_lab *lab, const char *folder, rx_text *brief, rx_log *log, rx_error *err);

/* --- for report() of a kind --- */

/* name, axis, quantities and columns beside the runs are set; then the rest. rx_lab_group_free(). */
rx_status rx_lab_group_open(rx_lab_group *group, const rx_lab *lab, int nconditions, rx_error *err);
void rx_lab_group_free(rx_lab_group *group); /* content only */

rx_finding *rx_lab_group_at(const rx_lab_group *group, int quantity, int condition, int column);

/* A section: figures (those whose ids begin with "ID-", too; drawn 0: none), words (NULL: none), and the quantities, all of
 * them rows of "cells". */
void rx_lab_group_show(rx_lab_page *page, const rx_lab_group *group, const char *id, const char *title,
                       int drawn, const char *words);

#endif
