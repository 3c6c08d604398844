/* What a campaign has found, of whatever kind: cells (a scene under a condition, through a run: a quantity and
 * its interval), contests of two runs, and a verdict for each claim; and the report that is made of them. */
#ifndef RX_LAB_FINDINGS_H
#define RX_LAB_FINDINGS_H

#include "lab/claims.h"
#include "lab/lab.h"
#include "report/report.h"

/* A quantity, as tables and figures name it. */
enum { RX_QUANTITIES_MAX = 24 };
typedef struct rx_quantity {
    char name[32];
    const char *unit;
    char help[160];
    int digits;
    int best; /* where the best of several settings is shown: highest value of each */
} rx_quantity;

typedef struct rx_findings {
    const rx_lab_output *output;
    rx_report *report; /* owned */
    rx_report_table *cells, *contests, *claims;
    rx_text brief; /* lines of the claims, the last ones of the terminal */
} rx_findings;

/* One number. setting: what was chosen for it, "" where nothing was. */
typedef struct rx_finding {
    const char *scene, *condition, *run, *setting;
} rx_finding;

/* Two runs on the same things. NAN where a test has no such number. */
typedef struct rx_contest {
    const char *scene, *condition, *quantity, *first, *second;
    const char *test; /* "McNemar", "paired t" ... */
    double statistic, dof, p, ln_p, effect;
    double holm;                    /* p adjusted for the conditions of one scene and quantity */
    const char *winner;             /* where that is below 0.05; NULL: undecided */
    rx_estimate difference;         /* first - second */
    double only_first, only_second; /* things found by one of both alone */
    int ntests; /* that holm adjusts for: where it is below the smallest double, its logarithm is from ln_p */
} rx_contest;

/* Head of the report: type ("detection"), title, command, seed; tables of claims and, unless a campaign has its own,
 * of cells and contests. Errors: RX_SYSTEM (memory). */
rx_status rx_findings_begin(rx_findings *dst, const char *type, const char *about, int own_cells,
                            const rx_lab_output *output, rx_error *err);

/* The claims: a section, and the count of them as the page's verdict; runs: those that verdicts speak of (NULL
 * where they speak of none). The words of the verdicts are freed. */
void rx_findings_claims(rx_findings *findings, rx_claim_verdicts *verdicts, const rx_lab_run *runs);

/* Adds cells; those from row `from` on, all of one scene and quantity, become a table of conditions against
 * runs, and lines of the terminal where `brief`. */
void rx_findings_cell(rx_findings *findings, const rx_finding *where, const rx_quantity *quantity,
                      const rx_estimate *value);
void rx_findings_show(rx_findings *findings, long from, const rx_quantity *quantity, int brief);

void rx_findings_contest(rx_findings *findings, const rx_contest *contest);
/* Those from row `from` on, with the columns named. */
void rx_findings_show_contests(rx_findings *findings, long from, const char *title, int ncolumns,
                               const char *const *columns);

/* Record and files; frees what findings hold, whatever comes out. As rx_report_write(). */
rx_status rx_findings_end(rx_findings *findings, rx_error *err);

#endif
