/* Values of all pixels of a tile that are read a row at a time, whether they lie in memory or are made then.
 *
 * A map is a plane, the sky level or noise of a background (data/tile.h), or what a maker makes. Copy it; it
 * owns nothing and lives as long as what it was made from. Any number of threads may read it at once.
 */
#ifndef RX_DATA_MAP_H
#define RX_DATA_MAP_H

#include "base/extern.h"
#include "data/tile.h"

RX_BEGIN_DECLS

/* First member of what makes values that no plane holds: dst[rows][n] from pixel (x, y) on, the same to the
 * bit whatever piece is asked for; many rows at once may be cheaper than each by itself. */
typedef struct rx_map_maker {
    void (*make)(const struct rx_map_maker *maker, int x, int y, int n, int rows, float *dst);
} rx_map_maker;

/* All 0: no map; its values are 0. */
typedef struct rx_map {
    int width;
    const float *plane; /* [height][width]; NULL: of the maker, or of the sky */
    const rx_map_maker *maker;
    const rx_background *sky;
    int noise; /* 1: the sky's noise, 0: its level */
} rx_map;

enum { RX_MAP_PIECE = 256 }; /* pixels of a row at a time, where there is no room for more */

/* plane: [height][width]. */
rx_map rx_map_plane(const float *plane, int width);

/* NULL: no map. */
rx_map rx_map_made(const rx_map_maker *maker, int width);

/* `factor` times `of`, whose owner must live as long; `room` keeps it. With a factor of 1 it is `of`. */
typedef struct rx_scaled_map {
    rx_map_maker maker;
    rx_map of;
    float factor;
} rx_scaled_map;
rx_map rx_map_scaled(rx_scaled_map *room, rx_map of, float factor);

/* Level above 0, and noise of a pixel, both in ADU. */
rx_map rx_background_level(const rx_background *sky);
rx_map rx_background_noise(const rx_background *sky);

/* The n values from pixel (x, y) on, which must lie in one row of the tile: in the plane where there is one,
 * else written to `room`, which is the caller's and holds n floats. A value is the same to the bit whatever
 * the x and n that it is asked with. Cheap for short pieces too. */
const float *rx_map_row(const rx_map *map, int y, int x, int n, float *room);

/* One value. */
float rx_map_at(const rx_map *map, int x, int y);

/* The values of whole rows from y on, dst[rows][width], in the plane where there is one. */
const float *rx_map_rows(const rx_map *map, int y, int rows, float *dst);

/* All values: dst[height][width]. */
void rx_map_fill(const rx_map *map, int height, int nthreads, float *dst);

static inline int rx_map_given(const rx_map *map)
{
    return map->plane != NULL || map->maker != NULL || map->sky != NULL;
}

/* Length of the piece of a row of `width` pixels that begins at x. */
static inline int rx_map_piece(int x, int width)
{
    return width - x < RX_MAP_PIECE ? width - x : RX_MAP_PIECE;
}

RX_END_DECLS

#endif
