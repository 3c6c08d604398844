/* A validation campaign: many small independent units of work, kept in a journal as they finish, and one
 * report made from the complete journal. Kill it at any moment and start it again: nothing is lost, nothing
 * done twice, and the report is the same to the byte for any interruption, number of threads and number of
 * shards. */
#ifndef RX_LAB_CAMPAIGN_H
#define RX_LAB_CAMPAIGN_H

#include "base/error.h"
#include "base/log.h"
#include "config/config_fields.h"

/* Everything the configuration asks for: the units of this shard that are not yet in the journal, then, when
 * the journal (or with MERGE all journals) is complete, the report. A shard that is complete while others are
 * not ends well and says how to merge. */
rx_status rx_campaign_run(const rx_campaign_config *config, rx_log *log, rx_error *err);

#endif
