/* Listed positions beside what was found on the tile: which are one, and which stand for a source that was found. */
#ifndef RX_PIPELINE_POSITIONS_H
#define RX_PIPELINE_POSITIONS_H

#include "base/error.h"
#include "pipeline/params.h"
#include "template/template.h"

/* Within half a FWHM of a listed position a source competes for its light: two points so near share exp(-q), q = r^2 / 4 s^2,
 * s = FWHM / 2.355, at half a FWHM 1/sqrt(2): beside the other one either has more than twice the variance it has alone, and most of
 * what it would explain the other explains, too. A position that was fitted is off by less than that at S/N 5 (0.12 FWHM along
 * each axis, s sqrt(2) / (S/N)). The flux is then that of the listed position, in place of the source. */
typedef struct rx_position_match {
    int n; /* distinct positions on the image; those less than 0.01 FWHM from an earlier row are one with it: apart
                            they would have 60 times the error, and so far off its place a point loses 1e-4 of its flux */
    int *row;            /* [n] of the list */
    int *of;             /* [positions->n] 0 .. n - 1; -1: not on the image */
    int *nearest;        /* [n] source that it stands for, the nearest of them; -1: none */
    int *replaced;       /* [n] how many there are */
    unsigned char *keep; /* [tphot->n] 0: a listed position stands for it */
} rx_position_match;

/* Free the contents with rx_position_match_clear(), also after an error. Errors: RX_SYSTEM. */
rx_status rx_positions_match(const rx_positions *positions, const rx_tphot *tphot, double fwhm,
                             rx_position_match *dst, rx_error *err);
void rx_position_match_clear(rx_position_match *match);

#endif
