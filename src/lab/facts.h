/* What makes a campaign what it is: for the journal's header, and for the report. */
#ifndef RX_LAB_FACTS_H
#define RX_LAB_FACTS_H

#include <stdint.h>

#include "base/error.h"
#include "config/config_fields.h"
#include "data/record.h"
#include "lab/journal.h"
#include "simulate/templates.h"

/* Program version, every keyword that decides a result, and a digest of each file that a keyword names.
 * NTHREADS, VERBOSE_TYPE, SHARD, MERGE, names of outputs and what only the report uses stay out; names of
 * files do, too: their content counts. */
rx_status rx_facts_collect(const rx_campaign_config *config, rx_journal_facts *dst, rx_error *err);

/* A digest of the templates of a simulation (NULL: none). */
rx_status rx_facts_templates(const rx_templates *templates, rx_journal_facts *dst, rx_error *err);

/* What a report says of the campaign that made it. */
typedef struct rx_campaign_record {
    const char *title;  /* not owned */
    char name[64];      /* of its file of settings, without folder and end; "" none */
    rx_text command;    /* as a reader can repeat it */
    rx_record keywords; /* every one, with names of files and what only the report uses; program version */
    uint64_t seed;
    int figures; /* 0: no gnuplot */
} rx_campaign_record;
rx_status rx_campaign_record_make(const rx_campaign_config *config, const char *title,
                                  rx_campaign_record *dst, rx_error *err);
void rx_campaign_record_free(rx_campaign_record *record); /* content only */

#endif
