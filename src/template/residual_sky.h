/* What the sky level still lacks once sources are modelled: a background that was measured around sources
 * holds some of their wings. */
#ifndef RX_TEMPLATE_RESIDUAL_SKY_H
#define RX_TEMPLATE_RESIDUAL_SKY_H

#include "base/error.h"
#include "fit/structure.h"
#include "template/crowd.h"
#include "template/fit_image.h"

/* What is measured: the sky between sources, or in a crowd, where no pixel is free of them, the sky and the noise of all
 * pixels. */
typedef struct rx_residual_sky {
    const int32_t *segments;  /* [height][width] free where 0; NULL: all are */
    const rx_crowding *crowd; /* only in these cells; NULL: everywhere */
    int cell;                 /* pixels */
} rx_residual_sky;

/* image->data less the smooth part of data - model: in cells of about `cell` pixels the mean over pixels in
 * no segment, clipped at 3 of their sigmas until nothing more goes; cells with too few of them take the mean
 * of their neighbours; bilinear between the cells' centres. *mean: what was taken off on average. The same
 * for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_residual_sky_subtract(rx_fit_image *image, const rx_residual_sky *where, double *mean,
                                   rx_error *err);

/* image->sigma times the width of (data - model) / error of those pixels, clipped alike, in which models are fainter than
 * the sky's noise. Errors: RX_SYSTEM. */
rx_status rx_residual_sky_rescale(rx_fit_image *image, const rx_residual_sky *where, rx_error *err);

/* Structure that the tile's PSF sees outside the crowd in data - model (fit/structure.h). Its level is taken off the data in place of that of
 * *structure, which is what was found before, or empty, and becomes what is found; *power: sum P^2 of the PSF. Errors: RX_SYSTEM. */
rx_status rx_residual_sky_structure(rx_fit_image *image, const rx_psf *psf, const rx_crowding *crowd,
                                    rx_structure *structure, double *power, rx_error *err);

#endif
