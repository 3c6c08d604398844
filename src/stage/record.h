/* What made an output: program, version, inputs, every keyword, and the facts of one extension
 * (PSF, restorer, noise law). Goes into catalogue headers, image headers and the report.
 *
 * NTHREADS and VERBOSE_TYPE stay out: outputs do not depend on them, to the byte. */
#ifndef RX_STAGE_RECORD_H
#define RX_STAGE_RECORD_H

#include "base/error.h"
#include "base/text.h"
#include "config/config.h"

typedef struct rx_record {
    int n, capacity;
    char *(*pairs)[3]; /* [n] name, value, comment; owned */
    bool failed;       /* memory ran out while adding */
} rx_record;

void rx_record_add(rx_record *record, const char *name, const char *comment, const char *format, ...)
    RX_PRINTF(4, 5);

/* Program, version, image names, then every keyword. */
void rx_record_run(rx_record *record, const rx_config *config, const char *images);

/* As FITS cards: names of up to 8 characters become keywords, longer ones HISTORY lines. */
void rx_record_cards(const rx_record *record, rx_text *cards);

/* Name and value of each entry, as validate/ shows them: *dst[record->n] points into the record, the array is
 * the caller's to free. */
rx_status rx_record_list(const rx_record *record, const char *(**dst)[2], rx_error *err);

void rx_record_free(rx_record *record);

#endif
