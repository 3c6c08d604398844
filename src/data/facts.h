/* What a run finds out about one image by one restorer, as facts.def declares it: headers, records and the manual follow from the row. */
#ifndef RX_DATA_FACTS_H
#define RX_DATA_FACTS_H

#include <stdbool.h>

#include "data/record.h"

RX_BEGIN_DECLS

typedef enum rx_fact {
#define FACT(name, kind, digits, unit, where, help) RX_FACT_##name,
#include "data/facts.def"
#undef FACT
    RX_FACTS
} rx_fact;

/* A number that is not known (NAN) is left out. */
void rx_fact_number(rx_record *facts, rx_fact fact, double value);
void rx_fact_text(rx_record *facts, rx_fact fact, const char *value);
void rx_fact_flag(rx_record *facts, rx_fact fact, bool value);

/* Where `warned`, the log has a warning about this fact: every header holds it then. */
void rx_fact_warned(rx_record *facts, rx_fact fact, bool warned);

/* Those that a header holds: all, or those of the rows marked HEADER and those that a warning is about. *dst is the caller's, as
 * after rx_record_add(). */
void rx_facts_of_header(const rx_record *facts, bool all, rx_record *dst);

/* The list of the manual page. */
void rx_facts_man(rx_text *dst);

RX_END_DECLS

#endif
