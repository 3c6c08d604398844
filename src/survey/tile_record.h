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
 *   STATE ellipticity depth factor masked saturated wrong look    stage/tile_facts.h; remarks of QA_TYPE TILE
 *   CARD "AIRMASS" 1.23               of RECORD_CARDS; those that the header has
 *   PAGE "night/m31_qa/tile.html"     of the tile; only where there is one
 *   PSF "PIXELS" stars reserved error growth residual dT de1 de2 errors    RXPSFHOW ...; only where known
 *   STARS n t e1 e2 reach             sums of residuals of reserved stars, and of their pairs by angle:
 *   RHO k pairs tt ee                 quality/rho.h
 *   RUN "RL" sources reference        reference: 1 when BIN lines count against a reference catalogue
 *   TOOK "NET" "finds ..."            restorer that AUTO took, and why; only then
 *   DONE "RL" "FWHM ..."              restorer that did it instead of the one of RUN, and why; only then
 *   OUTSIDE "FWHM ..."                what of the tile the restorer was not made for; only then
 *   FLUX n diameter wide error auto error    restored over untouched fluxes (pipeline/fluxcheck.h); only where measured
 *   GUARD false raised unexplained    per Mpixel of the tile's noise, factor of DETECT_THRESH, share of cells; only where known
 *   SHARES sharp                      of the sources with FLAGS_RESTORE 256; only where known
 *   FACT RXTPGRP "12"                 of data/facts.def, as a header has it (HEADER_FACTS ALL)
 *   BIN k references found detections right step:count ...             quality/tally.h; bins that count
 *   END                                                                nothing are left out
 */
#ifndef RX_SURVEY_TILE_RECORD_H
#define RX_SURVEY_TILE_RECORD_H

#include <stdint.h>

#include "base/error.h"
#include "base/text.h"
#include "stage/tile_facts.h"

typedef struct rx_tile_record {
    char *image, *name, *version;
    int status; /* exit status */
    char *what; /* the error, "" when it is fine */
    rx_tile_facts facts;
} rx_tile_record;

/* As text, TILE to END. Memory trouble shows in dst->failed. */
void rx_tile_record_print(rx_text *dst, const rx_tile_record *record);

/* A record, there until the next one is read, which begins at byte `at` of its file. */
typedef rx_status (*rx_tile_record_visitor)(void *user, const rx_tile_record *record, int64_t at,
                                            rx_error *err);

/* Each record of a file in turn, as there can be more than fit into memory: from byte `from` on, where one begins, `most`
 * of them (0: all). Errors: RX_INPUT with file and line (a record that is cut short, a line that is none of ours),
 * RX_SYSTEM, those of `visit`. */
rx_status rx_tile_record_read(const char *path, int64_t from, long most, rx_tile_record_visitor visit,
                              void *user, rx_error *err);

#endif
