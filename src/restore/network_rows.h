/* A block of the tile and a constant PSF: rows go from the tile into the Fourier transform and back as they
 * are needed, so that few planes have the domain's size. Formulas: nn/rl_step.h, nn/deblur.h. Beyond the tile
 * all values and weights are 0. */
#ifndef RX_RESTORE_NETWORK_ROWS_H
#define RX_RESTORE_NETWORK_ROWS_H

#include <stdint.h>

#include "num/fft.h"

typedef struct rx_rows {
    const rx_fft *fft;            /* of one thread */
    int width, height;            /* of the tile */
    int x0, y0;                   /* where the domain begins, tile pixels */
    int left, right, top, bottom; /* the block's part of the tile, without right and bottom */
    float *half;                  /* complex plane, scratch */
    float *a, *b;                 /* real planes, scratch */
} rx_rows;

/* dst (a plane of the tile, its part) = kernel * src */
void rx_rows_filter(const rx_rows *rows, const float *kernel, const float *src, float *dst);

/* A stamp of (2 radius + 1)^2 pixels: spectrum, and inside[j][i], (2 radius + 2)^2, the sum of its first j
 * rows and i columns, which tells how much of it lies on the tile near a border. */
typedef struct rx_rows_kernel {
    const float *spectrum;
    const double *inside;
    int radius;
} rx_rows_kernel;

/* inside of stamp[2 radius + 1][2 radius + 1] */
void rx_rows_inside(const float *stamp, int radius, double *inside);

/* next (a plane of the tile, its part) = a Richardson-Lucy step from f */
void rx_rows_step(const rx_rows *rows, const rx_rows_kernel *kernel, const float *f, const float *x,
                  const uint8_t *mask, float pedestal, float *next);

#endif
