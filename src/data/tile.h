/* A tile as it was read: pixels, what is known of them, and where they come from.
 *
 * Images are row-major float, x fastest; pixel (0,0) is the first one. FITS (1,1)
 * counting exists only at the border: catalogue columns and world coordinates.
 */
#ifndef RX_DATA_TILE_H
#define RX_DATA_TILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/extern.h"
#include "data/splines.h"

RX_BEGIN_DECLS

/* Why a pixel must not be used. 0 = good. */
enum {
    RX_MASK_BAD = 1,       /* NaN, infinite, BLANK, or beyond rx_pixel_limit() (data/unit.h) */
    RX_MASK_WEIGHT = 2,    /* weight says: no data (WEIGHT_THRESH) */
    RX_MASK_SATURATED = 4, /* at or above the saturation level */
    RX_MASK_UNTOUCHED = 8, /* of a restored image while it is detected on: belongs to a saturated star that is
                              left as it was observed */
    RX_MASK_DEEP = 16,     /* so far below its sky as no dark cloud is */
    RX_MASK_GAP = 32,      /* while a network restores: masked, but its light is estimated (data/gaps.h) */
    RX_MASK_CORE = 64,     /* beside another bit: light falls from it to all sides (data/gaps.h) */
    /* Holds light for sure, but not known how much. */
    RX_MASK_CUT = RX_MASK_SATURATED | RX_MASK_CORE
};

/* What the WEIGHT_IMAGE holds (SExtractor WEIGHT_TYPE). */
typedef enum rx_weight_type {
    RX_WEIGHT_NONE = 0,
    RX_WEIGHT_BACKGROUND, /* variance from the image's own background rms map */
    RX_WEIGHT_MAP_RMS,
    RX_WEIGHT_MAP_VAR,
    RX_WEIGHT_MAP_WEIGHT,
    RX_WEIGHT_MAP_IVAR /* is read as the rms that it states: a tile has RX_WEIGHT_MAP_RMS then */
} rx_weight_type;

struct rx_wcs; /* io/wcs.h */

/* Owner of all it points to. */
typedef struct rx_tile {
    char *name;    /* as given by the user, without [hdu] */
    char *extname; /* EXTNAME or "" */
    int hdu;       /* as cfitsio counts in name[n]: 0 = primary */
    int extension; /* 1, 2, ... among the image HDUs that are processed (EXT_NUMBER) */
    int width, height;
    float *pixels; /* [height][width]; bad pixels hold 0, never NaN */
    bool lent;     /* pixels are the caller's, only read and not freed */
    uint8_t *mask; /* [height][width], RX_MASK_ bits; always there */
    float *weight; /* [height][width] as in the file, or NULL */
    rx_weight_type weight_type;
    float *restored;       /* [height][width] as RESTORED_NAME has it, 0 where the mask hides; or NULL */
    float *restored_noise; /* [height][width] sigma of its pixels, or NULL */
    int nflagmaps;
    uint32_t **flagmaps; /* nflagmaps planes [height][width] (FLAG_IMAGE) */
    double gain;         /* e-/ADU; 0 = infinite (no photon noise of sources) */
    char gain_card[80];  /* GAIN_KEY where a card has it; "": it is the keyword's */
    double saturation;   /* ADU; HUGE_VAL when unknown */
    double zeropoint;    /* mag of 1 ADU */
    double pixel_scale;  /* arcsec per pixel at the centre; 0 when unknown */
    double exptime;      /* s, 0 when unknown */
    char *cards;         /* the HDU's header, 80 characters a card, END excluded */
    size_t ncards;
    struct rx_wcs *wcs; /* NULL without usable celestial coordinates, else */
    void (*wcs_free)(struct rx_wcs *wcs);
    int linear_wcs;    /* 1: header has only linear coordinates, then */
    double linear[6];  /* x_world = [0] + [1] x + [2] y, y_world = [3] + [4] x + [5] y, x and y from 0 */
    char checksum[32]; /* hex digest of the pixels that are not masked (64 bits); empty until
                           rx_tile_checksum() of io/tile.h is asked for it */
} rx_tile;

void rx_tile_free(rx_tile *tile);

/* Sky level and noise of a tile (SExtractor's background and rms maps), read through data/map.h: planes where
 * they are, else what meshes say. */
typedef struct rx_background {
    int width, height;
    float *level; /* [height][width] ADU; NULL: levels */
    float *sigma; /* [height][width] noise of a pixel, ADU; NULL: sigmas */
    double global_level, global_sigma;
    rx_splines levels, sigmas;
    const uint8_t *mask;  /* [height][width] of the tile, which must live as long; NULL: nothing is hidden */
    int mask_bits;        /* sigmas are 0 where mask & mask_bits != 0 */
    float fallback_sigma; /* where sigmas are not above 0 */
    int passes;           /* it was measured in: 2, the second one without sources */
    int constant;         /* no pixel, or no mesh with noise nor a map of it: global_sigma is 1 instead */
    /* So that a wrong sky can be given: level_error times the noise is taken off the level, and what sigmas
     * say is larger by sigma_error times itself, which that noise is not. */
    double level_error, sigma_error;
} rx_background;

/* The same level and noise everywhere, whatever was there before. */
void rx_background_flatten(rx_background *background, double level, double sigma);

/* factor times the noise that it has, everywhere. */
void rx_background_widen(rx_background *background, double factor);

void rx_background_free(rx_background *background);

RX_END_DECLS

#endif
