/* The record in an output of rextract (stage/provenance.h), read back: FITS catalogues and images, ASCII_HEAD
 * catalogues, VOTables. */
#ifndef RX_SURVEY_REPLAY_RECORD_H
#define RX_SURVEY_REPLAY_RECORD_H

#include <stdbool.h>

#include "base/error.h"
#include "base/hash.h"
#include "config/config.h"

/* One line, the value as it was before it went into a header. */
typedef struct rx_replay_line {
    char *name, *value; /* owned */
} rx_replay_line;

typedef struct rx_replay_record {
    bool fits; /* not a text */
    int n;
    rx_replay_line *lines; /* from RECORD to END; of further HDUs what they have read and made besides */
    int intact;            /* END fits to what stands above it, in every HDU */
    int nparts;            /* parts of the file that hold rows or pixels */
    char (*digests)[RX_HASH_TEXT]; /* [nparts] of the rows or pixels as they are in the file now */
} rx_replay_record;

/* Errors: RX_INPUT (not there, no output of rextract, no record, a record that cannot be read), RX_SYSTEM. */
rx_status rx_replay_record_read(const char *path, rx_replay_record **dst, rx_error *err);
void rx_replay_record_free(rx_replay_record *record); /* NULL is fine */

/* Value of the only line of that name, NULL when there is none. */
const char *rx_replay_record_value(const rx_replay_record *record, const char *name);

/* The configuration of the run. Errors: RX_INPUT (keywords or values that this version does not know),
 * RX_SYSTEM. */
rx_status rx_replay_record_config(const rx_replay_record *record, const char *path, rx_config **dst,
                                  rx_error *err);

/* The digest that the record has for a part (from 1) of the output `name`, NULL when there is none. It is
 * followed by a blank, not by a 0. */
const char *rx_replay_record_made(const rx_replay_record *record, const char *name, int part);

/* The parts of a value of READ, "digest KEY name", or MADE, "digest part name". 0: it has other parts. */
typedef struct rx_replay_item {
    char digest[RX_HASH_TEXT], key[64];
    const char *name; /* into the value */
} rx_replay_item;
int rx_replay_item_read(const char *value, rx_replay_item *dst);

#endif
