/* Reading tiles: any 2-D image HDU that cfitsio reads. */
#ifndef RX_IO_TILE_H
#define RX_IO_TILE_H

#include "base/error.h"
#include "base/log.h"
#include "data/tile.h"

typedef struct rx_tile_params {
    const char *weight_name;    /* WEIGHT_IMAGE or NULL */
    rx_weight_type weight_type;
    double weight_threshold;    /* NAN = SExtractor's default for the type */
    int nflags;                 /* FLAG_IMAGE list */
    const char *flag_names[8];
    double gain;                /* GAIN and GAIN_KEY; the header key wins, as in SExtractor */
    const char *gain_key;
    double saturation;
    const char *saturation_key;
    double zeropoint;           /* MAG_ZEROPOINT; no header key in SExtractor, MAG_ZEROPOINT_KEY is ours, "" = none */
    const char *zeropoint_key;
    double pixel_scale;         /* PIXEL_SCALE, 0 = from the WCS */
} rx_tile_params;

/* The image HDUs a name selects: `tile.fits` all 2-D images (primary and extensions, compressed
 * ones too), `tile.fits[2]`, `tile.fits[SCI,1]`, `tile.fits[1][1:512,1:512]` that one.
 * *hdus (numbers from 0) to be freed. No 2-D image: RX_INPUT. HDUs that are skipped
 * (3-D, 1-D, tables) are told through log. */
rx_status rx_tile_list(const char *name, rx_log *log, int **hdus, int *n, rx_error *err);

/* Read one of them. `extension` counts from 1 among those processed. */
rx_status rx_tile_read(const rx_tile_params *par, const char *name, int hdu, int extension, rx_log *log,
                       rx_tile **dst, rx_error *err);
void rx_tile_free(rx_tile *tile);

#endif
