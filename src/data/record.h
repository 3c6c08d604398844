/* Facts by name, in their order: of what made an output (stage/provenance.h), or of one extension. */
#ifndef RX_DATA_RECORD_H
#define RX_DATA_RECORD_H

#include <stdbool.h>
#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"
#include "base/hash.h"
#include "base/text.h"

#define RX_RECORD_VERSION "1, digests XXH3-128"

RX_BEGIN_DECLS

typedef struct rx_record { /* all 0: empty */
    int n, capacity;
    char *(*pairs)[3];  /* [n] name, value, comment; owned */
    bool failed;        /* memory ran out while adding */
    uint64_t warned[4]; /* bits of rx_fact: those that a warning is about (data/facts.h) */
} rx_record;

void rx_record_add(rx_record *record, const char *name, const char *comment, const char *format, ...)
    RX_PRINTF(4, 5);

/* The value of the first pair of that name, NULL without one; and is there a pair from number `from` on, of that name, whose
 * value begins with these `length` characters? */
const char *rx_record_find(const rx_record *record, const char *name);
bool rx_record_has(const rx_record *record, int from, const char *name, const char *value, size_t length);

/* Name and value of each entry, as report/ shows them: *dst[record->n] points into the record, the array is
 * the caller's to free. */
rx_status rx_record_list(const rx_record *record, const char *(**dst)[2], rx_error *err);

void rx_record_product(rx_record *products, const char *digest, int part, const char *name);

/* dst (empty) = the whole record of the output of that name: that of the run, the products, the end. Free it
 * after success and failure. */
rx_status rx_record_of(const rx_record *run, const rx_record *products, const char *output, rx_record *dst,
                       rx_error *err);

/* Part of a digest of END: one line. */
void rx_record_digest_line(rx_hash *sum, const char *name, const char *printable);

void rx_record_free(rx_record *record); /* content only */

RX_END_DECLS

#endif
