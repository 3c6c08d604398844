/* Detection filters: SExtractor's .conv files. */
#ifndef RX_CONFIG_KERNEL_H
#define RX_CONFIG_KERNEL_H

#include <stdbool.h>

#include "base/error.h"

typedef struct rx_kernel {
    int width, height;
    bool normalise; /* CONV NORM: to be divided by the sum of its absolute values */
    float *values;  /* [height][width] as in the file */
} rx_kernel;

/* `CONV NORM|NONORM`, then rows of numbers, `#` comments. Errors: RX_INPUT (cannot be read), RX_USAGE with
 * the line (no CONV line, ragged row, not a number, no row, more than RX_KERNEL_SIDE rows or columns,
 * all zero, or NORM with the sum zero). */
enum { RX_KERNEL_SIDE = 1023 };
rx_status rx_kernel_read(const char *path, rx_kernel **dst, rx_error *err);

/* The 3 x 3 pyramid 1 2 1 / 2 4 2 / 1 2 1, normalised: what config/default.conv holds. */
extern const float rx_kernel_built_in[9];

void rx_kernel_free(rx_kernel *kernel); /* NULL is fine */

#endif
