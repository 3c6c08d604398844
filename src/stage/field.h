/* One tile with what is known of it before restoration: sky, noise and PSF. */
#ifndef RX_STAGE_FIELD_H
#define RX_STAGE_FIELD_H

#include "base/error.h"
#include "base/log.h"
#include "data/psf.h"
#include "data/sources.h"
#include "data/tile.h"
#include "stage/options.h"

/* Pixels that hide in a plain extraction (as in SExtractor, saturated ones are used and flagged) and in
 * a restored image (a saturated value is a lower limit and would ring). */
enum {
    RX_HIDE_PLAIN = RX_MASK_BAD | RX_MASK_WEIGHT,
    RX_HIDE_RESTORED = RX_MASK_BAD | RX_MASK_WEIGHT | RX_MASK_SATURATED | RX_MASK_UNTOUCHED
};

typedef struct rx_field {
    rx_tile *tile;
    rx_background *plain;    /* with RX_HIDE_PLAIN */
    rx_background *restored; /* with RX_HIDE_RESTORED; the same object when nothing is saturated */
    rx_psf *psf;             /* NULL when no restorer needs it, or none could be found */
    double model_noise;      /* noise as rx_model_noise() has it, of the tile that this one is a copy of; 0 =
                                none, measure it */
    int unrestorable;        /* neither stars nor what was stated give a PSF */
    double background_seconds, psf_seconds; /* wall clock of preparing it */
} rx_field;

/* A tile in memory, which belongs to the field from then on, and is freed when this fails. Measures its
 * backgrounds (tile parameters number `role`: 0 detection, 1 measurement image) and takes a copy of the PSF
 * `known`; when that is NULL and `need_psf`, the options say where the PSF comes from. */
rx_status rx_field_prepare(const rx_options *options, int role, rx_tile *tile, const rx_psf *known,
                           int need_psf, rx_log *log, rx_field **dst, rx_error *err);

/* Read HDU `hdu` of `name` and prepare it. */
rx_status rx_field_open(const rx_options *options, int role, const char *name, int hdu, int extension,
                        int need_psf, rx_log *log, rx_field **dst, rx_error *err);
void rx_field_free(rx_field *field);

/* dst[height][width]: the pixels above that sky's level; 0 where mask & hide is not. */
void rx_field_above_sky(const rx_tile *tile, const rx_background *sky, int hide, int nthreads, float *dst);

#endif
