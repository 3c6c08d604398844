/* The record of a tile: what became of it, in a small text file that adds up.
 *
 * One is written for every tile, fine or failed (RECORD_NAME). A file may hold the records of many tiles, one
 * after the other, so that shards are put together with cat. Everything in it is the same from run to run, so
 * that a survey's roll-up does not depend on how often or where a tile was run: no times, no machine.
 *
 *   TILE "night/m31.fits" "m31"       image as given, and its {tile}
 *   VERSION "0.1.0"
 *   STATUS 0 ""                       exit status, and the error in a line
 *   EXTENSION hdu width height alpha delta fwhm sky noise verdict      alpha, delta: deg J2000; nan = unknown
 *   RUN "RL" sources reference        reference: 1 when BIN lines count against a reference catalogue
 *   BIN k references found detections right step:count ...             validate/tally.h; bins that count
 * nothing END                                                                are left out
 */
#ifndef RX_SURVEY_TILE_RECORD_H
#define RX_SURVEY_TILE_RECORD_H

#include "base/error.h"
#include "base/text.h"
#include "stage/tile_facts.h"

typedef struct rx_tile_record {
    char *image, *name, *version;
    int status; /* exit status */
    char *what; /* the error, "" when it is fine */
    rx_tile_facts facts;
} rx_tile_record;

typedef struct rx_tile_records {
    int n;
    rx_tile_record *record;
} rx_tile_records;

/* As text, TILE to END. Memory trouble shows in dst->failed. */
void rx_tile_record_print(rx_text *dst, const rx_tile_record *record);

/* Append the records of a file. Errors: RX_INPUT with file and line (a record that is cut short, a line that
 * is none of ours), RX_SYSTEM. */
rx_status rx_tile_records_read(rx_tile_records *dst, const char *path, rx_error *err);

/* Sort by name and image, drop what stands there twice. Errors: RX_INPUT for two records of one tile that
 * differ. */
rx_status rx_tile_records_settle(rx_tile_records *records, rx_error *err);

void rx_tile_records_free(rx_tile_records *records); /* content only */

#endif
