/* A tile again, with pixels of its own: what checks inject into, or draw noise on. */
#ifndef RX_CHECK_REPLICA_H
#define RX_CHECK_REPLICA_H

#include "base/error.h"
#include "data/tile.h"

/* Of these columns and rows. */
typedef struct rx_replica_part {
    int x, y, width, height;
} rx_replica_part;

/* Pixels, mask, weights, flag maps and numbers of `src`, or of a part of it where that is not NULL; header cards and
 * world coordinates stay behind, for nothing that works in memory asks for them. Free with rx_tile_free(). Errors:
 * RX_SYSTEM. */
rx_status rx_replica_new(const rx_tile *src, const rx_replica_part *part, rx_tile **dst, rx_error *err);

/* After the pixels were changed: 0 where the mask says bad, and marked where they reach saturation. */
void rx_replica_settle(rx_tile *tile);

#endif
