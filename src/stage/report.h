/* The QA report of one extension, all restorers side by side. */
#ifndef RX_STAGE_REPORT_H
#define RX_STAGE_REPORT_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "data/table.h"
#include "io/output.h"
#include "stage/extract.h"
#include "stage/field.h"
#include "stage/options.h"
#include "stage/record.h"

/* Match the current sources of every run with the reference and write the report folder (QA_NAME, with _n for
 * extension n > 0). *verdict keeps the worst over calls; brief grows by one short table. */
rx_status rx_report_write(const rx_options *options, const rx_field *detect, const rx_field *measure,
                          const rx_table *reference, const rx_run *runs, int extension,
                          const rx_record *record, rx_outputs *outputs, rx_log *log, rx_verdict *verdict,
                          rx_text *brief, rx_error *err);

/* Whether the folders of the reports can be made, before the work; nothing stays. */
rx_status rx_report_try(const rx_options *options, int extension, rx_error *err);

/* The report of the self checks of every run into the folder SELF_CHECK_NAME (with _n for extension n > 0);
 * nothing without that name or without a self check. */
rx_status rx_report_checks(const rx_options *options, const rx_checks *checks, const rx_run *runs,
                           int extension, const rx_record *record, rx_outputs *outputs, rx_log *log,
                           rx_error *err);

#endif
