/* Reading tiles: any 2-D image HDU that cfitsio reads. */
#ifndef RX_IO_TILE_H
#define RX_IO_TILE_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/tile.h"

RX_BEGIN_DECLS

typedef struct rx_tile_params {
    const char *weight_name; /* WEIGHT_IMAGE or NULL */
    rx_weight_type weight_type;
    int own_maps; /* variance and mask that stand beside the image in a file of Rubin's kind, as WEIGHT_TYPE is not set */
    double weight_threshold;                         /* NAN = SExtractor's default for the type */
    const char *restored_name, *restored_noise_name; /* RESTORED_NAME, RESTORED_NOISE; NULL or "": none */
    int nflags;                                      /* FLAG_IMAGE list */
    const char *flag_names[8];
    double gain; /* GAIN and GAIN_KEY; the header key wins, as in SExtractor */
    const char *gain_key;
    double saturation;
    const char *saturation_key;
    double zeropoint; /* MAG_ZEROPOINT; no header key in SExtractor, MAG_ZEROPOINT_KEY is ours, "" = none */
    const char *zeropoint_key;
    double pixel_scale; /* PIXEL_SCALE, 0 = from the WCS */
    int nthreads;       /* for memory and mask */
} rx_tile_params;

/* The image HDUs a name selects: `tile.fits` all 2-D images (primary and extensions, compressed
 * ones too), `tile.fits[2]`, `tile.fits[SCI,1]`, `tile.fits[1][1:512,1:512]` that one.
 * *hdus (numbers from 0) to be freed. No 2-D image: RX_INPUT. HDUs that are skipped
 * (3-D, 1-D, tables, and beside an image the maps that EXTNAME says they are) are named in the log. */
rx_status rx_tile_list(const char *name, rx_log *log, int **hdus, int *n, rx_error *err);

/* What the header says of an image that rx_tile_read() would read. */
typedef struct rx_tile_shape {
    int hdu;
    int width, height; /* of the section, where the name has one */
    int compressed;    /* a tile-compressed image */
    int own_maps;      /* a variance and a mask stand beside it, which rx_tile_params.own_maps takes */
    size_t ncards;     /* of its header */
    size_t held;       /* bytes of the file that are in memory while it is read: gzip and the like */
} rx_tile_shape;

/* Shapes of the images that `name` selects, from headers alone; *dst to be freed. Errors as rx_tile_list()
 * and rx_tile_read() have them as far as headers say. */
rx_status rx_tile_shapes(const char *name, rx_log *log, rx_tile_shape **dst, int *n, rx_error *err);

/* Read one of them. `extension` counts from 1 among those processed. Values of header keys come from
 * the HDU, else from the primary header; with INHERIT = T the primary's other cards join tile->cards.
 * A section `[x1:x2,y1:y2]` has its own CRPIX in cards and wcs.
 * Weights and flags: the image of the tile's EXTNAME and EXTVER, else the map's only image for the only tile, else the HDU of the
 * tile's number when the tile was named by HDU, else the extension-th image; a map of the whole tile serves for a section too. In
 * tile->weight no NaN is left (0 for MAP_WEIGHT, 1e30 else; MAP_IVAR is read as MAP_RMS); masked are weights <= weight_threshold
 * (default 0), rms and variances >= it (default 1e30, or 1e6 times that of the tile's pixels where that is more) or <= 0.
 * Errors: RX_INPUT for anything wrong with a file (missing, cut off, damaged, wrong shape, all NaN). */
rx_status rx_tile_read(const rx_tile_params *par, const char *name, int hdu, int extension, rx_log *log,
                       rx_tile **dst, rx_error *err);

/* An image as its caller has it in memory: what a file would hold. What is NULL is not there. */
typedef struct rx_tile_arrays {
    const char *name; /* of messages; NULL: "image" */
    int width, height;
    const float *pixels; /* [height][width] ADU, with their sky; NaN: bad */
    const uint8_t *mask; /* [height][width] not 0: bad */
    const float *weight; /* [height][width] as par->weight_type says, which must ask for a map */
    const char *cards;   /* header: world coordinates, gain ... */
    size_t ncards;       /* of 80 characters each */
} rx_tile_arrays;

/* The same tile from arrays: numbers from header or keywords, masks by values and weights as those of a file. Pixels
 * stay the caller's and must live as long (tile->lent), unless some are bad: of these the tile makes a copy in which
 * they are 0. Errors: RX_USAGE (no pixels, a weight map without a type or the other way round), RX_INPUT (all bad), RX_SYSTEM. */
rx_status rx_tile_lend(const rx_tile_params *par, const rx_tile_arrays *arrays, rx_log *log, rx_tile **dst,
                       rx_error *err);

/* The digest of pixels and mask (the first 64 bits of XXH3's 128), made when it is first asked for; not by several threads at a time. */
const char *rx_tile_checksum(rx_tile *tile);

RX_END_DECLS

#endif
