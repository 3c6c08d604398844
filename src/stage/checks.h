/* SELF_CHECK and BLANK_CHECK in a run: prepared once per extension, run for every restorer, told in the log,
 * in headers and in the report. */
#ifndef RX_STAGE_CHECKS_H
#define RX_STAGE_CHECKS_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "stage/blankcheck.h"
#include "stage/probe.h"
#include "stage/record.h"
#include "stage/selfcheck.h"

typedef struct rx_checks rx_checks;

/* What the checks found for one restorer. */
typedef struct rx_check_results {
    rx_selfcheck self;   /* injected 0: was not run */
    rx_blankcheck blank; /* realisations 0: was not run */
} rx_check_results;

/* *dst NULL when no check is asked for. A check that this tile does not allow (no PSF, no free sky) is left
 * out with a warning that says why. Options and field must outlive it. */
rx_status rx_checks_new(const rx_options *options, const rx_field *field, rx_log *log, rx_checks **dst,
                        rx_error *err);
void rx_checks_free(rx_checks *checks);

/* `before`: the restorer on the untouched tile. The content of *dst is freed by
 * rx_check_results_free(), also after an error. checks NULL: nothing is done. */
rx_status rx_checks_run(const rx_checks *checks, const rx_restorer *kind, const rx_probe *before, rx_log *log,
                        rx_check_results *dst, rx_error *err);
void rx_check_results_free(rx_check_results *results);

/* Header facts RXSC* and RXBLK*; an end of an interval that is not finite is left out. */
void rx_checks_facts(const rx_checks *checks, const rx_check_results *results, rx_record *facts);

/* The report of the self checks of n restorers into `folder`; `about`: who they are, lists and PSF are filled
 * in here. Nothing when none was run. */
rx_status rx_checks_report(const rx_checks *checks, int n, const rx_qa_run *about,
                           const rx_check_results *const *results, const rx_record *record,
                           const char *folder, const char *shown, rx_log *log, rx_error *err);
int rx_checks_injected(const rx_checks *checks); /* is there a self check to report? */

/* One line per check of what was found: "" when none was run. */
void rx_checks_text(const rx_checks *checks, const rx_check_results *results, rx_text *dst);

#endif
