/* What a run will take, predicted before it: memory, CPU time, sizes of outputs.
 *
 * Memory is a bound: the sum of the rows of plan_costs.def that count for a run (its restorer, templates, checks,
 * ...), each so many bytes always, per pixel, per source and per thread, fitted to measured runs; the largest over
 * restorers and images, and what pixels that are held, tables and meshes take, which is known to the byte. What no
 * header says is how many sources there are: PLAN_DENSITY says how many per Mpixel (1e6 pixels) to reckon with. CPU
 * seconds are an estimate, on a machine like the one the coefficients were measured on. Sizes of outputs are bounds:
 * those of images are right but for the length of the header (some blocks of 2880 bytes). */
#ifndef RX_STAGE_PLAN_H
#define RX_STAGE_PLAN_H

#include <stdint.h>

#include "base/error.h"
#include "base/log.h"
#include "config/config.h"

typedef struct rx_plan_output {
    char *name; /* file, or folder */
    uint64_t bytes;
} rx_plan_output;

typedef struct rx_plan {
    int images;     /* of the file that are processed */
    double pixels;  /* of them all */
    double sources; /* assumed, of them all */
    int threads;
    double memory;      /* bytes, at most, at any one time */
    double cpu_seconds; /* estimate, of all threads */
    int noutputs;
    rx_plan_output *outputs;
} rx_plan;

/* Reads the headers of `image` ("tile.fits" or "detect.fits,measure.fits") and the files that keywords name;
 * writes nothing. Errors: as rx_stage_run() has them as far as that shows. */
rx_status rx_plan_make(const rx_config *config, const char *image, rx_log *log, rx_plan **dst, rx_error *err);
void rx_plan_free(rx_plan *plan);

#endif
