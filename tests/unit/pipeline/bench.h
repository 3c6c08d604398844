/* Options and tiles in memory for tests that run parts of the stage. */
#ifndef RX_TESTS_BENCH_H
#define RX_TESTS_BENCH_H

#include "config/config_fields.h"
#include "pipeline/field.h"
#include "stage/options.h"

typedef struct setting {
    const char *name, *value;
} setting;

typedef struct bench {
    rx_config *config; /* options point into it */
    rx_options *options;
} bench;

/* Moffat PSF of FWHM 3.5 px, zero point 25, no figures, and then `settings` up to a NULL name. */
void bench_open(bench *dst, const setting *settings);
void bench_close(bench *bench);

/* A tile of these pixels (copied), nothing masked, no saturation; gain in e-/ADU. */
rx_tile *bench_tile(const float *pixels, int width, int height, double gain);

/* The prepared field of such a tile. */
rx_field *bench_field(const bench *bench, const float *pixels, int width, int height, double gain);

#endif
