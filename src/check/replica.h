/* A tile again, with pixels of its own: what checks inject into, or draw noise on. */
#ifndef RX_CHECK_REPLICA_H
#define RX_CHECK_REPLICA_H

#include "base/error.h"
#include "data/psf.h"
#include "data/tile.h"
#include "pipeline/params.h"

/* Of these columns and rows. */
typedef struct rx_replica_part {
    int x, y, width, height;
} rx_replica_part;

/* Pixels, mask, weights, flag maps and numbers of `src`, or of a part of it where that is not NULL; header cards and
 * world coordinates stay behind, for nothing that works in memory asks for them. Free with rx_tile_free(). Errors:
 * RX_SYSTEM. */
rx_status rx_replica_new(const rx_tile *src, const rx_replica_part *part, rx_tile **dst, rx_error *err);

/* Of nine windows of that side within `part`, the one that hides least; the middle one where they are equal. */
rx_replica_part rx_replica_window(const rx_tile *tile, const rx_replica_part *part, int side);

/* The PSF of a part of the tile, NULL for all; NULL when memory is out. Free with rx_psf_free(). */
rx_psf *rx_replica_psf(const rx_psf *psf, const rx_replica_part *part);

/* What a replica is extracted with: detected, and nothing else. */
rx_pipeline_params rx_replica_params(const rx_pipeline_params *params);

/* After the pixels were changed: 0 where the mask says bad, and marked where they reach saturation. */
void rx_replica_settle(rx_tile *tile);

#endif
