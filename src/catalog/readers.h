/* The text formats that rx_catalog_read() understands. The caller has set the locale (cell.h). */
#ifndef RX_CATALOG_READERS_H
#define RX_CATALOG_READERS_H

#include "base/error.h"
#include "data/table.h"

/* No file may make a table larger than this, whatever it claims. */
enum { RX_READ_COLUMNS = 4096, RX_READ_TEXT = 256 };
#define RX_READ_BYTES ((size_t)1 << 30)

/* Columns of blank- or comma-separated values; names from SExtractor's `#   1 NAME ...` lines, from
 * the last `# name name` comment, or from a first line that holds no number; else col1, col2 ...
 * `nan`, `null`, `--` and nothing between two commas are NAN. Lines must have equal length. */
rx_status rx_ascii_read(const char *path, rx_table **dst, rx_error *err);

/* The index-th TABLE (from 0) of a VOTable in TABLEDATA serialisation. Integer columns with null
 * cells become DOUBLE with NAN; arrays of variable length become text. */
rx_status rx_votable_read(const char *path, int index, rx_table **dst, rx_error *err);

#endif
