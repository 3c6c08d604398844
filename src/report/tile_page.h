/* The page of a tile, which needs no reference: verdict, figures, numbers, flags, cut-outs. tile.html and tile.json. */
#ifndef RX_REPORT_TILE_PAGE_H
#define RX_REPORT_TILE_PAGE_H

#include "quality/tile_quality.h"
#include "report/report.h"

typedef struct rx_tile_page {
    const rx_tile_about *about;
    int nrecord; /* configuration and provenance: name, value */
    const char *const (*record)[2];
} rx_tile_page;

/* What it says, for the record of the tile. */
typedef struct rx_tile_page_facts {
    int wrong, look; /* remarks */
} rx_tile_page_facts;

/* files->page and ->summary are set here. Errors: as of rx_report_write(). */
rx_status rx_tile_page_write(const rx_tile_page *page, const rx_report_files *files,
                             rx_tile_page_facts *found, rx_error *err);

#endif
