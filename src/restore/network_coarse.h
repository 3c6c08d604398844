/* Coarse maps of a tile: sums in square cells that begin at its first pixel, smoothed, and bilinear between
 * the centres of the cells. */
#ifndef RX_RESTORE_NETWORK_COARSE_H
#define RX_RESTORE_NETWORK_COARSE_H

#include "base/error.h"

typedef struct rx_coarse {
    int cell; /* pixels a side, even */
    int nx, ny;
    float *value; /* [ny][nx], at the centres of cells, owned */
} rx_coarse;

/* Bilinear, held beyond the outer centres: dst[n], tile pixels x .. x + n - 1 of row y. */
void rx_coarse_row(const rx_coarse *coarse, int y, int x, int n, float *dst);
void rx_coarse_free(rx_coarse *coarse);

/* What its maker adds up in the cells: weighted values, and weights. */
typedef struct rx_cells {
    int side, nx, ny;
    double *sum, *weight; /* [ny][nx], 0 at first */
} rx_cells;

/* Cells of `side` pixels. Errors: RX_SYSTEM. */
rx_status rx_cells_new(int width, int height, int side, rx_cells *dst, rx_error *err);
void rx_cells_free(rx_cells *c);

/* Weighted means under a Gaussian of that sigma (pixels), cut at 3 sigma and at 48 cells; `empty` where no weight is as
 * near. weight (NULL: not requested): its mean a cell, under the same Gaussian, 0 beyond the tile. Errors: RX_SYSTEM. */
rx_status rx_cells_smooth(const rx_cells *c, double sigma, double empty, int nthreads, rx_coarse *dst,
                          rx_coarse *weight, rx_error *err);

#endif
