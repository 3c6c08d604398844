/* Rows of columns.def in memory, for the parts of this folder. */
#ifndef RX_CATALOG_COLUMNS_H
#define RX_CATALOG_COLUMNS_H

#include "data/image.h"
#include "data/sources.h"
#include "data/table.h"

/* Where a cell's value comes from besides its source. */
typedef struct rx_cell_place {
    const rx_image *image; /* as it was read, that of the fluxes: its sky, noise and PSF are not known here */
    const rx_sources *sources;
    long row;   /* index of the source in sources->list */
    int dim[2]; /* dimensions asked of the column */
} rx_cell_place;

typedef struct rx_column_def {
    const char *name;
    rx_cell_type type;
    const char *unit, *ucd, *format;
    int naxis; /* 0 scalar, 1 vector, 2 image */
    const char *description;
    double (*value)(const rx_source *s, const rx_cell_place *c, long i);
} rx_column_def;

/* The n rows of columns.def, in its order. */
const rx_column_def *rx_column_defs(int *n);

/* Row of a column by name, case ignored; -1 when there is none. */
int rx_column_index(const char *name);

#endif
