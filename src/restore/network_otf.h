/* What is made of a tile's PSF for the optics around the network (network_optics.h): the relative PSF, and
 * Tikhonov filters and FWHM at the nodes of a grid on the tile (nn/deblur.h). */
#ifndef RX_RESTORE_NETWORK_OTF_H
#define RX_RESTORE_NETWORK_OTF_H

#include "data/psf.h"
#include "nn/deblur.h"

typedef struct rx_otf_grid {
    int width, height; /* of the tile */
    int nx, ny;        /* nodes; 1 x 1 for a constant PSF */
    double step_x, step_y;
    float *filters; /* [ny][nx] Tikhonov filters of 2 RX_TIKHONOV_REACH + 1 pixels a side; NULL: not made */
    float *fwhm;    /* [ny][nx] pixels */
} rx_otf_grid;

/* epsilon <= 0: no filters. What is made belongs to *dst even after an error. Errors: RX_INPUT (no usable
 * PSF), RX_SYSTEM. */
rx_status rx_otf_grid_make(const rx_psf *psf, int width, int height, const rx_tikhonov *filter,
                           rx_otf_grid *dst, rx_error *err);
void rx_otf_grid_clear(rx_otf_grid *grid); /* of zeros is fine */

/* dst[n]: FWHM at tile pixels x .. x + n - 1 of row y, beyond the border that on it. */
void rx_otf_fwhm_row(const rx_otf_grid *grid, int y, int x, int n, float *dst);

/* *stamps [psf->nbasis][*size][*size], the caller's to free: the relative PSF of nn/deblur.h, basis image by
 * basis image, scaled so that the first sums to 1 and the others to 0. */
rx_status rx_otf_relative(const rx_psf *psf, double target_fwhm, int width, int height, float **stamps,
                          int *size, rx_error *err);

#endif
