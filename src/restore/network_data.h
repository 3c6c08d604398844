/* A tile in noise units, its masked pixels filled: what the network is given.
 *
 * scale: Gaussian mean (sigma 32 pixels, far wider than a PSF, so that what is blurred stays blurred by the
 * same PSF) of the logarithm of the tile's noise over good pixels, in cells of 16 pixels, bilinear between
 * their centres. Where a weight map has a step, x is wrong by its size within some 40 pixels.
 *
 * Filled: (near + 0.01 far) / (weight of near + 0.01); near: Gaussian of twice the PSF's FWHM, cut at 3
 * sigma, over good pixels; far: mean in cells of 16 pixels, smoothed by a Gaussian of 32 pixels, 0 where no
 * good pixel is within 96. */
#ifndef RX_RESTORE_NETWORK_DATA_H
#define RX_RESTORE_NETWORK_DATA_H

#include "restore/network_blocks.h"
#include "restore/restore.h"

typedef struct rx_coarse {
    int nx, ny;
    float *value; /* [ny][nx], at the centres of cells, owned */
} rx_coarse;

/* Bilinear, held beyond the outer centres: dst[n], tile pixels x .. x + n - 1 of row y. */
void rx_coarse_row(const rx_coarse *coarse, int y, int x, int n, float *dst);
void rx_coarse_free(rx_coarse *coarse);

/* ADU per noise unit, positive everywhere. mask[height][width]: 0 = good. Errors: RX_SYSTEM. */
rx_status rx_network_scale(const rx_tile *tile, const rx_background *background, const uint8_t *mask,
                           int nthreads, rx_coarse *dst, rx_error *err);

/* x [height][width], within +-1e7. Errors: RX_SYSTEM. */
rx_status rx_network_data(const rx_tile *tile, const rx_background *background, const uint8_t *mask,
                          const rx_coarse *scale, double psf_fwhm, const rx_blocks *blocks, int nthreads,
                          float *x, rx_error *err);

#endif
