/* A tile in noise units, its masked pixels filled: what the network is given.
 *
 * scale: Gaussian mean (sigma 32 pixels, far wider than a PSF, so that what is blurred stays blurred by the
 * same PSF) of the logarithm of the tile's noise over good pixels, in cells of 16 pixels, bilinear between
 * their centres. Where a weight map has a step, x is wrong by its size within some 40 pixels.
 *
 * Filled: (near + 0.01 far) / (weight of near + 0.01); near: Gaussian of twice the PSF's FWHM, cut at 3
 * sigma, over good pixels; far: mean in cells of 16 pixels, smoothed by a Gaussian of 32 pixels, 0 where no
 * good pixel is within 96. Narrow gaps, which may cut a star: straight between both sides (data/gaps.h). */
#ifndef RX_RESTORE_NETWORK_DATA_H
#define RX_RESTORE_NETWORK_DATA_H

#include "restore/network_blocks.h"
#include "restore/network_coarse.h"
#include "restore/restore.h"

/* ADU per noise unit, positive everywhere. mask[height][width]: 0 = good. Errors: RX_SYSTEM. */
rx_status rx_network_scale(const rx_image *image, const uint8_t *mask, int nthreads, rx_coarse *dst,
                           rx_error *err);

/* An image in noise units. */
typedef struct rx_network_input {
    const rx_image *image;
    const uint8_t *mask;        /* [height][width] 0 = good */
    const struct rx_gaps *gaps; /* among what is masked; NULL: none */
    rx_coarse scale;            /* ADU per noise unit */
    float *x;                   /* [height][width] within +-1e7 */
} rx_network_input;

/* Writes input->x, the rest is given. Errors: RX_SYSTEM. */
rx_status rx_network_data(const rx_network_input *input, double psf_fwhm, const rx_blocks *blocks,
                          int nthreads, rx_error *err);

/* Row y in noise units, 0 under the mask: x[width] and the scale, unit[width]. room[width]: scratch. */
void rx_network_data_row(const rx_network_input *input, const rx_map *level, int y, float *unit, float *room,
                         float *x);

#endif
