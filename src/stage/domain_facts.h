/* What the network's model says of a tile (pipeline/domain.h), for headers, log and report. */
#ifndef RX_STAGE_DOMAIN_FACTS_H
#define RX_STAGE_DOMAIN_FACTS_H

#include "base/text.h"
#include "data/record.h"
#include "pipeline/domain.h"
#include "quality/qa.h"

/* Header facts RXNET*; nothing for RX_DOMAIN_NONE, and what is not known is left out. */
void rx_domain_facts(const rx_domain *domain, rx_record *facts);

/* One line for log and report; "" for RX_DOMAIN_NONE. */
void rx_domain_text(const rx_domain *domain, rx_text *dst);

/* The same for the table of the report, pointing into domain; NULL for RX_DOMAIN_NONE. */
const rx_qa_promise *rx_domain_promise(const rx_domain *domain, rx_qa_promise *dst);

#endif
