/* A report: facts, and sections of sentences, figures and tables. What is said once comes out as one HTML page
 * (report.html), one JSON file (summary.json), one ECSV file a table, and a few lines for a terminal.
 *
 * A table is long: one row for each thing measured, words that name it first, then its numbers. A page shows a
 * stretch of its rows as they are, or as a pivot of one column against another; JSON and ECSV have all of them.
 *
 *   rx_report *r = rx_report_new("Validation: ", title);
 *   rx_report_fact(r, "type", "detection");
 *   rx_report_section(r, "lists", "Lists");
 *   rx_report_table *t = RX_REPORT_TABLE(r, "cells", COLUMNS, RX_REPORT_IN_JSON);
 *   rx_report_put(t, "NET", recall);
 *   rx_report_show(r, t, RX_VIEW(.title = "Recall"));
 *   status = rx_report_write(r, &(rx_report_files){folder, shown, ...}, brief, err);
 *   rx_report_free(r);
 *
 * Words from outside are escaped here; `html` is a constant of ours. Memory that runs out on the way is an
 * error of rx_report_write() alone. Same calls, same bytes. */
#ifndef RX_REPORT_REPORT_H
#define RX_REPORT_REPORT_H

#include "base/log.h"
#include "report/figure.h"
#include "report/table.h"

typedef struct rx_report rx_report;

/* kind and title together are the heading of the page. NULL without memory. */
rx_report *rx_report_new(const char *kind, const char *title);
void rx_report_free(rx_report *report);

/* First entries of summary.json, and the head of every ECSV file. A NULL text is null. */
void rx_report_fact(rx_report *report, const char *name, const char *text);
void rx_report_fact_number(rx_report *report, const char *name, double value);
void rx_report_fact_numbers(rx_report *report, const char *name, long n,
                            const double *values); /* JSON alone */

/* --- the page, in the order of the calls --- */

/* What is to be known first; mark: colour, RX_MARK_.... */
void rx_report_verdict(rx_report *report, const char *mark, const char *word, const char *sentence);
void rx_report_section(rx_report *report, const char *id, const char *title); /* linked from the top */
void rx_report_heading(rx_report *report, const char *title, const char *unit);
void rx_report_paragraph(rx_report *report, const char *html);
void rx_report_sentence(rx_report *report, const char *words); /* a paragraph of words from outside */
void rx_report_note(rx_report *report, const char *html);      /* small: how to read it */
void rx_report_lines(rx_report *report, const char *words); /* words from outside, their lines as they are */
/* What is folded away until rx_report_unfold(). */
void rx_report_fold(rx_report *report, const char *title);
void rx_report_unfold(rx_report *report);
/* Figures are added to this, and stand where rx_report_place() names the beginning of their ids. */
rx_figures *rx_report_figures_of(rx_report *report);
void rx_report_place(rx_report *report, const char *prefix);
rx_text *rx_report_brief_of(rx_report *report); /* lines for the terminal, to be added to */
/* Configuration and provenance, folded away; "record" of JSON. */
void rx_report_record(rx_report *report, int n, const char *const (*pairs)[2]);

/* --- tables --- */

/* Columns and their words must live as long as the report. `where`: summary.json, <name>.ecsv, or both. */
#define RX_REPORT_TABLE(report, name, columns, where)                                                        \
    rx_report_table_add(report, name, RX_LENGTH(columns), columns, where)
rx_report_table *rx_report_table_add(rx_report *report, const char *name, int ncolumns,
                                     const rx_report_column *columns, int where);

void rx_report_show(rx_report *report, const rx_report_table *table, const rx_report_view *view);

/* --- files --- */

typedef struct rx_report_files {
    const char *folder, *shown; /* as it is, and as errors name it */
    int figures;                /* 0: none are drawn */
    const char *page;           /* file; NULL: report.html */
    const char *summary;        /* file; NULL: summary.json */
    const char *gnuplot;        /* program; NULL: "gnuplot" */
    rx_log *log;                /* warned where gnuplot is missing */
} rx_report_files;

/* All files; `brief` (NULL: not wanted) gets the lines for the terminal. Errors: RX_SYSTEM (memory, disk),
 * RX_INTERRUPTED. */
rx_status rx_report_write(rx_report *report, const rx_report_files *files, rx_text *brief, rx_error *err);

/* text into folder/name (errors say shown/name); the text is freed in any case, ready for the next file.
 * Errors: RX_SYSTEM (memory, disk). */
rx_status rx_report_file(const char *folder, const char *shown, const char *name, rx_text *text,
                         rx_error *err);

#endif
