/* The QA report of one extension, all restorers side by side. */
#ifndef RX_STAGE_REPORT_H
#define RX_STAGE_REPORT_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "data/table.h"
#include "io/output.h"
#include "pipeline/field.h"
#include "stage/extract.h"
#include "stage/options.h"
#include "stage/provenance.h"
#include "stage/tile_facts.h"

/* What a report is made of. */
typedef struct rx_report_input {
    const rx_options *options;
    rx_fields fields;
    const rx_table *reference;
    const rx_run *runs; /* one per restorer */
    int extension;      /* from 1; 0: the only one */
    const rx_record *record;
    rx_outputs *outputs;
    rx_log *log;
} rx_report_input;

/* The folder of the report (QA_NAME, with _n for extension n > 0): where there is a reference the current sources of
 * every run matched with it, and with QA_TYPE TILE the tile's own page. `facts` (NULL: none) is given what the page says. *verdict keeps the worst over calls; brief grows by one short table. */
rx_status rx_stage_report(const rx_report_input *in, rx_extension_facts *facts, rx_verdict *verdict,
                          rx_text *brief, rx_error *err);

/* Whether the folders of the reports of `image` can be made, before the work; nothing stays. RX_USAGE as well where that
 * of an extension holds a file of the run. */
rx_status rx_report_try(const rx_config *config, const rx_options *options, const char *image, int extension,
                        rx_error *err);

/* The report of the self checks of every run into the folder SELF_CHECK_NAME (with _n for extension n > 0);
 * nothing without that name or without a self check. */
rx_status rx_report_checks(const rx_report_input *in, const rx_checks *checks, rx_error *err);

#endif
