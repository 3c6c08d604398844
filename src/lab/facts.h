/* What makes a campaign what it is: for the journal's header, and for the report. */
#ifndef RX_LAB_FACTS_H
#define RX_LAB_FACTS_H

#include "base/error.h"
#include "config/campaign_config.h"
#include "lab/journal.h"
#include "nn/model.h"
#include "simulate/templates.h"

/* Program version, every keyword that decides a result, and a digest of each file that a keyword names.
 * NTHREADS, VERBOSE_TYPE, SHARD, MERGE, names of outputs and what only the report uses stay out; names of
 * files do, too: their content counts. */
rx_status rx_facts_collect(const rx_campaign_config *config, rx_journal_facts *dst, rx_error *err);

/* A digest of the templates of a simulation (NULL: none). */
rx_status rx_facts_templates(const rx_templates *templates, rx_journal_facts *dst, rx_error *err);

/* The digest of the network's model (NULL: none), wherever its file lies. */
rx_status rx_facts_model(const rx_model *model, rx_journal_facts *dst, rx_error *err);

/* What a report says of the campaign that made it. */
typedef struct rx_campaign_record {
    const char *title;
    const char *command; /* as a reader can repeat it */
    uint64_t seed;
    int n;
    const char *const (*pairs)[2]; /* every keyword and its value, program version, model checksums */
    int figures;                   /* 0: no gnuplot */
} rx_campaign_record;

/* The same for the report, with names of files and what only the report uses, and the command that repeats
 * the campaign. */
typedef struct rx_facts_record {
    rx_campaign_record record; /* points into the rest */
    rx_text command;
    int n, capacity;
    char *(*pairs)[2]; /* owned */
    int failed;
} rx_facts_record;
rx_status rx_facts_record_make(const rx_campaign_config *config, const char *title, rx_facts_record *dst,
                               rx_error *err);
void rx_facts_record_free(rx_facts_record *record); /* content only */

#endif
