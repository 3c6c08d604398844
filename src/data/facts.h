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

typedef enum rx_fact_kind {
    RX_FACT_KIND_TEXT,
    RX_FACT_KIND_FLAG,
    RX_FACT_KIND_COUNT,
    RX_FACT_KIND_FIXED,
    RX_FACT_KIND_DIGITS
} rx_fact_kind;

typedef struct rx_fact_row {
    const char *card; /* "RXFWHM" */
    rx_fact_kind kind;
    int digits;
    const char *unit, *help;
    bool in_header; /* by default */
} rx_fact_row;

const rx_fact_row *rx_fact_row_of(rx_fact fact);

/* A number that is not known (NAN) is left out. */
void rx_fact_number(rx_record *facts, rx_fact fact, double value);
void rx_fact_text(rx_record *facts, rx_fact fact, const char *value);
void rx_fact_flag(rx_record *facts, rx_fact fact, bool value);

/* Those that a header holds: all, or what in_header says of them. *dst is the caller's, as after rx_record_add(). */
void rx_facts_of_header(const rx_record *facts, bool all, rx_record *dst);

/* The list of the manual page. */
void rx_facts_man(rx_text *dst);

RX_END_DECLS

#endif
