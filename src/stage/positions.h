/* Forced photometry: the list of POSITIONS_NAME, and the table of what was found there. */
#ifndef RX_STAGE_POSITIONS_H
#define RX_STAGE_POSITIONS_H

#include "base/error.h"
#include "base/log.h"
#include "data/image.h"
#include "data/sources.h"
#include "data/table.h"
#include "io/tile.h"
#include "pipeline/params.h"

/* A list as rx_catalog_read() reads it. Errors: RX_INPUT, no positions or such that are no numbers. */
rx_status rx_position_list_read(const char *path, rx_table **dst, rx_error *err);

/* Where it lies on a tile: sky positions where the list has them and the tile has celestial coordinates, else pixels; with a warning
 * where none lies on it. The caller frees dst->at. Errors: RX_INPUT, neither. */
rx_status rx_position_list_pixels(const rx_table *list, const char *path, const rx_tile *tile, rx_log *log,
                                  rx_positions *dst, rx_error *err);

/* The table POSITIONS, a row for each of the list: its own identifiers, or NUMBER, the row from 1, and what was fitted in
 * `forced`, on `image`. *dst is the caller's (rx_table_free). Errors: RX_SYSTEM. */
rx_status rx_position_list_table(const rx_table *list, const rx_image *image, rx_sources *forced,
                                 rx_table **dst, rx_error *err);

#endif
