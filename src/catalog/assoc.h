/* Cross-identification while extracting, as SExtractor's ASSOC: a list of positions gives its
 * values to the sources found near them. */
#ifndef RX_CATALOG_ASSOC_H
#define RX_CATALOG_ASSOC_H

#include <stdbool.h>

#include "base/error.h"
#include "base/log.h"
#include "data/sources.h"
#include "data/table.h"

struct rx_wcs; /* io/wcs.h */

typedef enum rx_assoc_type {
    RX_ASSOC_FIRST, /* lowest y of those within the radius, as SExtractor's sorted list has it */
    RX_ASSOC_NEAREST,
    RX_ASSOC_MEAN,     /* weighted by the third of ASSOC_PARAMS */
    RX_ASSOC_MAG_MEAN, /* weighted by 10^(-0.4 of it) */
    RX_ASSOC_SUM,
    RX_ASSOC_MAG_SUM, /* every value taken as a magnitude; 99 when there is no flux */
    RX_ASSOC_MIN,     /* the entry whose third parameter is least */
    RX_ASSOC_MAX
} rx_assoc_type;

typedef enum rx_assoc_select { RX_ASSOC_ALL, RX_ASSOC_MATCHED, RX_ASSOC_UNMATCHED } rx_assoc_select;

enum { RX_ASSOC_COLUMNS = 256 };

typedef struct rx_assoc_params {
    int x, y, weight;           /* ASSOC_PARAMS: column numbers from 1; weight 0 when not given */
    int ndata;                  /* ASSOC_DATA: columns to copy, from 1; zeros are passed over, */
    int data[RX_ASSOC_COLUMNS]; /* so are (with a warning) those the list lacks; none left: all */
    bool world;                 /* ASSOCCOORD_TYPE WORLD: x, y are J2000 degrees, else pixels from 1 */
    double radius;              /* ASSOC_RADIUS, pixels */
    rx_assoc_type type;
    rx_assoc_select select; /* ASSOCSELEC_TYPE */
} rx_assoc_params;

/* A table as columns of numbers; cells of text are NAN. */
typedef struct rx_assoc {
    char *path;
    rx_table *table;
    int columns;
    int of[RX_ASSOC_COLUMNS];       /* the table's column that each comes from, */
    long element[RX_ASSOC_COLUMNS]; /* and the element of its cells */
} rx_assoc;

/* Any file that rx_catalog_read() reads; vector columns count once an element. No rows is fine.
 * RX_INPUT: unreadable, more than RX_ASSOC_COLUMNS columns. */
rx_status rx_assoc_read(const char *path, rx_assoc **dst, rx_error *err);
void rx_assoc_free(rx_assoc *list);

/* Can those columns of the list be used? RX_USAGE: ASSOC_PARAMS asks for one that it does not have; RX_INPUT:
 * for one with words, the first of which is named. */
rx_status rx_assoc_check(const rx_assoc_params *par, const rx_assoc *list, rx_error *err);

/* Fill number_assoc and vector_assoc of every source and sources->assoc, nassoc. Sources that
 * `select` drops leave the list, the vignets and the segmentation map; those that stay are numbered
 * anew from 1 without gaps (segment = number), as SExtractor does. wcs is needed for `world` only.
 * Errors: those of rx_assoc_check(); RX_INPUT: WORLD without a wcs. Entries without a position are counted in
 * the log. */
rx_status rx_assoc_match(const rx_assoc_params *par, const rx_assoc *list, struct rx_wcs *wcs, rx_log *log,
                         rx_sources *sources, rx_error *err);

#endif
