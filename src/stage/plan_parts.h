/* Parts of the plan of a run. For plan*.c alone. */
#ifndef RX_STAGE_PLAN_PARTS_H
#define RX_STAGE_PLAN_PARTS_H

#include "data/table.h"
#include "io/tile.h"
#include "stage/options.h"
#include "stage/plan.h"
#include "stage/record.h"

typedef struct rx_plan_job {
    const rx_options *options;
    int n;                        /* images of the tile */
    const rx_tile_shape *detect;  /* [n] */
    const rx_tile_shape *measure; /* [n], NULL without dual-image mode */
    const rx_table *row;          /* the catalogue's columns, without rows */
    size_t record_cards;          /* of the run's record */
    double reference_bytes;       /* of the reference catalogue's file, 0 = none */
    const int *terms; /* [n] of the PSF; 1: it is the same everywhere, or not known before the run */
} rx_plan_job;

double rx_plan_pixels(const rx_tile_shape *shape);
double rx_plan_sources(const rx_plan_job *job, const rx_tile_shape *shape); /* assumed of an image */
double rx_plan_row_bytes(const rx_table *row);                              /* in memory and in FITS tables */

/* Peak of the whole run, bytes; CPU seconds of all threads. */
double rx_plan_memory(const rx_plan_job *job);
double rx_plan_seconds(const rx_plan_job *job);

/* Every output that the run will write. Errors: RX_SYSTEM without memory. */
rx_status rx_plan_outputs(const rx_plan_job *job, rx_plan *plan, rx_error *err);

/* One more; RX_SYSTEM without memory. */
rx_status rx_plan_add(rx_plan *plan, const char *name, double bytes, rx_error *err);

#endif
