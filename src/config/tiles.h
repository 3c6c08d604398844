/* A list of tiles, and the settings of each.
 *
 * A line is what would stand on the command line for that tile: `IMAGE [-KEYWORD VALUE]...`, IMAGE as
 * "tile.fits" or "detect.fits,measure.fits". Words stand apart by blanks, "quotes" keep them, '#' at the
 * start of a word ends the line. "{tile}" in a name stands for the tile's own (rx_name_stem()). PLAN is the
 * one keyword that no line can have: a list is planned or run as a whole.
 */
#ifndef RX_CONFIG_TILES_H
#define RX_CONFIG_TILES_H

#include "config/idle.h"
#include "config/settings.h"
#include "config/tokens.h"

typedef struct rx_listed_tile {
    long line;       /* of the list */
    char *name;      /* what {tile} stands for */
    rx_tokens words; /* IMAGE, then -KEYWORD VALUE ... */
} rx_listed_tile;

typedef struct rx_tiles {
    char *path; /* of the list */
    int n;
    rx_listed_tile *tile;
} rx_tiles;

/* Errors: RX_USAGE with file and line, or because the file cannot be read or lists no tile. */
rx_status rx_tiles_read(const char *path, rx_tiles **dst, rx_error *err);
void rx_tiles_free(rx_tiles *tiles);

/* "tile.fits" or "detect.fits,measure.fits", as written; belongs to the list. */
const char *rx_tiles_image(const rx_tiles *tiles, int i);

/* Settings of tile i: those common to all, its own keywords, its name put in, all checked. The caller frees
 * them. Errors: RX_USAGE with the list's line. */
rx_status rx_tiles_settings(const rx_tiles *tiles, int i, const rx_settings *common, rx_log *log,
                            rx_settings **dst, rx_error *err);

/* No two tiles may write to the same file or folder, none what another one reads, nor the list. Files need
 * not exist: names are compared, without links and dots (rx_name_real()). Checks the settings of every tile
 * on the way, so that nothing begins before the whole list is sound, and adds what is idle to *idle, unless NULL. */
rx_status rx_tiles_check(const rx_tiles *tiles, const rx_settings *common, rx_idle *idle, rx_log *log,
                         rx_error *err);

#endif
