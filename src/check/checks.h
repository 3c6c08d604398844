/* SELF_CHECK and BLANK_CHECK in a run: prepared once per extension, run for every restorer, reported in the log,
 * in headers and in the report. */
#ifndef RX_CHECK_CHECKS_H
#define RX_CHECK_CHECKS_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "check/blankcheck.h"
#include "check/params.h"
#include "check/selfcheck.h"
#include "data/record.h"
#include "pipeline/pipeline.h"

typedef struct rx_checks rx_checks;

/* What the checks found for one restorer. */
typedef struct rx_check_results {
    rx_selfcheck self;   /* injected 0: was not run */
    rx_blankcheck blank; /* realisations 0: was not run */
} rx_check_results;

/* *dst NULL when no check is asked for. A check that this tile does not allow (no PSF, no free sky) is left
 * out with a warning that says why. What it is given must outlive it. */
rx_status rx_checks_new(const rx_pipeline_params *params, const rx_check_params *par, const rx_field *field,
                        rx_log *log, rx_checks **dst, rx_error *err);
void rx_checks_free(rx_checks *checks);

/* Before the tile of `field` is worked on: rx_blankcheck_guard(), for the network and unless BLANK_CHECK is 0, with a
 * warning where it raised the threshold of *params. */
rx_status rx_checks_guard(const rx_check_params *par, const rx_restorer *kind, const rx_field *field,
                          rx_pipeline_params *params, rx_log *log, rx_blankcheck *dst, rx_error *err);

/* `tile`: the restorer on the untouched tile, with `params`.
 * dst->blank: as the guard left it. The content of *dst is
 * freed by rx_check_results_free(), also after an error. checks NULL: no check but the guard. */
rx_status rx_checks_run(const rx_checks *checks, const rx_pipeline_params *params, const rx_restorer *kind,
                        rx_result *tile, rx_log *log, rx_check_results *dst, rx_error *err);

/* MAGERR_INJECTED of the sources by what was injected. */
void rx_checks_apply(const rx_check_results *results, rx_result *tile);
void rx_check_results_free(rx_check_results *results);

/* Header facts RXSC* and RXBLK*; an end of an interval that is not finite is left out. checks: may be NULL. */
void rx_checks_facts(const rx_checks *checks, const rx_pipeline_params *params,
                     const rx_check_results *results, rx_record *facts);

/* The report of the self checks of n restorers. */
typedef struct rx_checks_page {
    int n;
    const rx_qa_run *about; /* their names and settings; lists and PSF are filled in here */
    const rx_check_results *const *results;
    const rx_record *record;
    const char *folder, *shown; /* where it goes, and the name that messages show */
} rx_checks_page;

/* Nothing when no check was run. */
rx_status rx_checks_report(const rx_checks *checks, const rx_checks_page *page, rx_log *log, rx_error *err);
int rx_checks_injected(const rx_checks *checks); /* is there a self check to report? */

/* One line per check of what was found: "" when none was run. */
void rx_checks_text(const rx_checks *checks, const rx_check_results *results, rx_text *dst);

#endif
